// Cells of studies of simulated scenes for tests.
#pragma once

#include "solvers/study/study_cell.h"
#include "tests/support/cell_scenes.h"

namespace heba {

// Returns a study's cell of the scene, whose calibration starts from the true cameras and takes the targets as
// designed.
StudyCell CellOf(const CellScene& scene, const CellSceneSetting& setting = {});

}  // namespace heba
