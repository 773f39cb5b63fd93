// The poses whose errors a study of named cameras states, and their estimates in one trial.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/data/solution.h"
#include "heba/kernels/small_matrix.h"
#include "solvers/study/study_cell.h"

namespace heba {

// A pose of an estimate under the name of StudiedPoses, with its covariance (m, rad, in the child frame) and the
// degrees of freedom of that.
struct PoseEstimate {
  std::string name;
  Rigid3d pose;
  Matrix6 covariance = Matrix6::Zero();
  double dof = std::numeric_limits<double>::infinity();
};

// Returns the studied poses of a solution, in the order of StudiedPoses.
std::vector<PoseEstimate> PosesOf(const Problem& problem, const Solution& solution);
// Returns the true poses of a cell, without uncertainty.
std::vector<PoseEstimate> TruePoses(const StudyCell& cell);

// An estimate of each studied pose. Poses that the estimator cannot determine have none, those that it failed to
// determine have a Failure.
using PoseEstimates = std::vector<std::optional<Outcome<PoseEstimate>>>;

// Estimates the poses from the captures of `problem`. Of cameras that are calibrated one by one, a pose between two has
// the covariance of two independent ones, and that between two bases is taken from the camera that states the smallest
// sigma.
PoseEstimates EstimatePoses(const StudyCell& cell, StudyEstimator estimator, const Problem& problem);

}  // namespace heba
