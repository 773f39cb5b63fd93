// The search for errors of a robot's poses that vary smoothly with the pose, among captures that are linearised at an
// estimate without them.
#pragma once

#include <vector>

#include "heba/data/smooth_errors.h"
#include "heba/data/solution.h"
#include "heba/evaluation/finding.h"
#include "solvers/uncertainty/linearisation.h"
#include "solvers/uncertainty/variance_components.h"

namespace heba {

struct SmoothSearch {
  std::vector<LinearisedView> views;  // One per robot pose, and then the priors of other unknowns.
  std::vector<Rigid3d> poses;         // base_from_gripper of each, as the robot reports it.
  double unit_px = 1;                 // RestrictedLogLikelihood.
  std::vector<VarianceGroup> groups;  // The groups without those of smooth errors.
  // Column of LinearisedView::by_effects of the correction of the robot's pose, the first of six.
  Eigen::Index first_column = 0;
};

struct FoundSmoothErrors {
  SmoothErrors errors;             // With the most likely standard deviations.
  double log_likelihood_gain = 0;  // The log-likelihood ratio (restricted) to a model without smooth errors.
};

// Returns the smooth errors whose lengths explain the captures best: those of the largest restricted likelihood, found
// by descent over factors of two. If there are more than 250 poses, as many of them are used, and the gain is theirs.
FoundSmoothErrors FindSmoothErrors(const SmoothSearch& search);

// Returns the finding `smooth_errors`: their standard deviations and lengths, and the noise of the robot without and
// with them.
Finding DescribeSmoothErrors(const RobotNoise& smooth, const SmoothLengths& lengths, const RobotNoise& before,
                             const RobotNoise& after);

}  // namespace heba
