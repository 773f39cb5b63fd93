// The estimates of a hand-eye calibration in one trial of a study.
#pragma once

#include <vector>

#include "heba/base/rng.h"
#include "heba/data/unknowns.h"
#include "solvers/study/study_cell.h"

namespace heba {

// Simulates the captures of a trial and returns the estimates of every closed form, of the chain and of the bundle
// adjustment.
std::vector<TrialEstimate> EstimateHandEye(const StudyCell& cell, Rng& rng);

// Returns the unknowns of a layout whose errors are studied: all but the robot's systematic errors and the target's
// shape.
std::vector<Eigen::Index> StudiedUnknowns(const UnknownLayout& layout);

}  // namespace heba
