// The files result.json and truth.json, of one camera (schema heba/result/1) and of several (heba/rig/1).
//
//   const heba::RunResult result = heba::ReadWholeResult("runs/cell/result.json");
//   const heba::Rigid3d& mount_from_camera = result.solution.poses.mount_from_camera[0];
#pragma once

#include <filesystem>
#include <string>

#include "heba/data/setup.h"
#include "heba/evaluation/evaluation.h"
#include "heba/evaluation/run_result.h"

namespace heba {

inline constexpr const char* kResultSchema = "heba/result/1";
inline constexpr const char* kLongSchema = "heba/rig/1";

// Returns the text of result.json, in the short form if the result has it (IsShort). A figure that does not exist is
// null.
std::string ResultToJson(const RunResult& result);

// Reads result.json of either schema. Poses of the captures, their corrections and rejected points stay empty. A result
// of the short form may have no estimate. Throws InputError with the file and the fault.
RunResult ReadRunResult(const std::filesystem::path& path);
// Returns whether a result.json has the short form, by its schema. Throws InputError if it cannot be read.
bool IsShortFile(const std::filesystem::path& path);
// Reads result.json, of the short form that of FindFinal (WithEstimate); that there is none is a fault.
RunResult ReadWholeResult(const std::filesystem::path& path);

// Return the text of truth.json: the poses in the form of result.json.
std::string TruthToJson(const Truth& truth, Setup setup);
std::string TruthToJson(const Problem& rig, const CellTruth& truth);
// Reads truth.json: `hand_eye` and, if present, `board` and `camera`, in the format of result.json. Throws InputError
// with the file and the fault; a pose between other frames than those of the setup is a fault.
Truth ReadTruth(const std::filesystem::path& path, Setup setup);
// Likewise for several cameras: it must have the cameras of `rig`, and may have its targets and arms, with their
// mounts.
CellTruth ReadCellTruth(const std::filesystem::path& path, const Problem& rig);

// Returns the version that files and `heba --version` state.
std::string Version();

}  // namespace heba
