// result.json and truth.json.
#pragma once

#include <filesystem>
#include <string>

#include "heba/data/setup.h"
#include "heba/evaluation/evaluation.h"

namespace heba {

// The text of result.json ("heba/result/1"). A figure that does not exist is null.
std::string ResultToJson(const RunResult& result);

// The text of truth.json.
std::string TruthToJson(const Truth& truth, Setup setup);
// Reads truth.json: `hand_eye` and, if it is there, `board` and `camera`, as in result.json. InputError names the file
// and what is wrong, a pose between other frames than the set-up's included.
Truth ReadTruth(const std::filesystem::path& path, Setup setup);

// The version that files and `heba --version` name.
std::string Version();

}  // namespace heba
