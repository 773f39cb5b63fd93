// Runs the trials of one cell of a study.
#pragma once

#include <functional>
#include <vector>

#include "tools/study/study_rows.h"

namespace heba {

// Runs all trials of a cell on `num_threads` threads and summarises them, with one result for each pose of
// StudiedPoses. The result does not depend on the threads. `progress` is called after each trial, by one thread at a
// time.
std::vector<CellResult> RunCell(const StudyConfig& study, int cell, int num_threads,
                                const std::function<void()>& progress);

}  // namespace heba
