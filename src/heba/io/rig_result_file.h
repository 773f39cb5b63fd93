// The files result.json and truth.json of a run with a rig.
//
//   const heba::RigResult result = heba::ReadRigResult("runs/cell/result.json");
//   for (const heba::RelativePose& pose : result.relative_cameras) Use(pose);
#pragma once

#include <filesystem>
#include <string>

#include "heba/evaluation/rig_evaluation.h"

namespace heba {

inline constexpr const char* kRigSchema = "heba/rig/1";

// Returns whether a result.json is that of a rig, by its schema. Throws InputError if it cannot be read.
bool IsRigResult(const std::filesystem::path& path);

// Returns the text of result.json. A figure that does not exist is null.
std::string RigResultToJson(const RigResult& result);
// Reads result.json. Throws InputError with the file and the fault.
RigResult ReadRigResult(const std::filesystem::path& path);

// Returns the text of truth.json: the poses in the form of result.json.
std::string RigTruthToJson(const RigProblem& rig, const RigTruth& truth);
// Reads truth.json, which must have the cameras of `rig`, and may have its targets and arms, with their mounts. Throws
// InputError with the file and the fault.
RigTruth ReadRigTruth(const std::filesystem::path& path, const RigProblem& rig);

}  // namespace heba
