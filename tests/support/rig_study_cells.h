// Cells of studies of simulated rigs for tests.
#pragma once

#include "solvers/rig/rig_study.h"
#include "tests/support/rig_scenes.h"

namespace heba {

// Returns a study's cell of the scene, whose calibration starts from the true cameras and takes the targets as
// designed.
RigStudyCell CellOf(const RigScene& scene, const RigSceneSetting& setting = {});

}  // namespace heba
