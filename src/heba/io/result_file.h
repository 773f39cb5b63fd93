// The files result.json and truth.json.
//
//   const heba::RunResult result = heba::ReadResult("runs/cell/result.json");
//   const heba::Estimate* const refined = heba::FindRefined(result);
#pragma once

#include <filesystem>
#include <string>

#include "heba/data/setup.h"
#include "heba/evaluation/evaluation.h"

namespace heba {

inline constexpr const char* kResultSchema = "heba/result/1";

// Returns the text of result.json. A figure that does not exist is null.
std::string ResultToJson(const RunResult& result);
// Reads result.json. The parts of a Solution that the file does not contain (corrections, rejected points) stay empty.
// Throws InputError with the file and the fault.
RunResult ReadResult(const std::filesystem::path& path);

// Returns the text of truth.json.
std::string TruthToJson(const Truth& truth, Setup setup);
// Reads truth.json: `hand_eye` and, if present, `board` and `camera`, in the format of result.json. Throws InputError
// with the file and the fault; a pose between other frames than those of the setup is a fault.
Truth ReadTruth(const std::filesystem::path& path, Setup setup);

// Returns the version that files and `heba --version` state.
std::string Version();

}  // namespace heba
