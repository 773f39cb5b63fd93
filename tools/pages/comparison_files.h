// A comparison reads finished runs and writes a folder.
#pragma once

#include <filesystem>
#include <vector>

#include "tools/pages/comparison.h"

namespace heba {

// Reads finished runs: each path is a run, its result.json, or a batch's folder, whose runs are sorted by name. A run
// is called by its name or, if several have that name, by its folder. Throws InputError if there is none in a path.
std::vector<ComparedRun> ReadComparedRuns(const std::vector<std::filesystem::path>& paths);

// Writes compare.csv, pairs.csv and compare.html into a folder, which is whole or not there.
void WriteComparison(const Comparison& comparison, const std::filesystem::path& folder);

}  // namespace heba
