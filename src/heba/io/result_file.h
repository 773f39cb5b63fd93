// result.json and truth.json.
#pragma once

#include <filesystem>
#include <string>

#include "heba/data/setup.h"
#include "heba/evaluation/evaluation.h"

namespace heba {

inline constexpr const char* kResultSchema = "heba/result/1";

// The text of result.json. A figure that does not exist is null.
std::string ResultToJson(const RunResult& result);
// Reads result.json: all that is in it; of a Solution what the file does not hold (corrections, rejected points) stays
// empty. InputError names the file and what is wrong.
RunResult ReadResult(const std::filesystem::path& path);

// The text of truth.json.
std::string TruthToJson(const Truth& truth, Setup setup);
// Reads truth.json: `hand_eye` and, if it is there, `board` and `camera`, as in result.json. InputError names the file
// and what is wrong, a pose between other frames than the set-up's included.
Truth ReadTruth(const std::filesystem::path& path, Setup setup);

// The version that files and `heba --version` name.
std::string Version();

}  // namespace heba
