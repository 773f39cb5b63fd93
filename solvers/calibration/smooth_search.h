// The search for errors of a robot's poses that vary smoothly with the pose, among captures that are linearised at an
// estimate without them.
#pragma once

#include <vector>

#include "heba/data/pair_solution.h"
#include "heba/data/problem.h"
#include "heba/data/smooth_errors.h"
#include "heba/data/solution.h"
#include "heba/evaluation/finding.h"
#include "solvers/uncertainty/linearisation.h"
#include "solvers/uncertainty/variance_components.h"

namespace heba {

struct SmoothSearch {
  std::vector<LinearisedView> views;  // One per robot pose, and then the priors of other unknowns.
  std::vector<Rigid3d> poses;         // base_from_gripper of each, as the robot reports it.
  std::vector<VarianceGroup> groups;  // The groups without those of smooth errors.
  // Column of LinearisedView::by_effects of the correction of the robot's pose, the first of six.
  Eigen::Index first_column = 0;
  bool is_exact_without = false;  // Whether the model without smooth errors has no noise of the robot either.
};

struct FoundSmoothErrors {
  SmoothErrors errors;             // With the most probable standard deviations.
  double log_likelihood_gain = 0;  // The log-likelihood ratio (restricted) to a model without smooth errors.
  bool is_exact_without = false;   // SmoothSearch::is_exact_without.
  // How many times as likely the model without smooth errors is as that with at least half of the variances of its
  // white noise, or, beside an exact robot, with at least those of the most accurate robots (0.01 mm, 0.002 deg).
  double odds_without = 1;
};

// Returns the smooth errors whose lengths the captures make most probable: the restricted likelihood times a prior by
// which the lengths of arms scatter by a factor of two, and the priors of EffectGroup::half_cauchy_sigma. They are
// found by descent over factors of 2, 2^(1/2) and 2^(1/4), and by a parabola through the last steps. If there are more
// than 250 poses, as many of them are used, and the gain is theirs.
FoundSmoothErrors FindSmoothErrors(const SmoothSearch& search);

// Returns whether smooth errors are part of the model. They are left out only if the captures do not reject the model
// without them (kRandomErrorsRejected), and if the captures show that they are small (kLeastOdds): less than half of
// the white noise, or less than the most accurate robots have. Errors of robots are smooth as a rule, and those that
// are left out because a few captures cannot show them make sigmas too small.
bool AreLikely(const FoundSmoothErrors& found);

// Returns the probability of a gain at least as large if the robot has no smooth errors (an upper bound).
double PValueWithout(const FoundSmoothErrors& found);

// The smooth errors that explain the captures of an arm best.
struct SmoothErrorsOfArm {
  size_t robot = 0;
  FoundSmoothErrors found;
};

// Returns those of each arm that moves a target against a camera and of which no errors are estimated, linearised at a
// solution of the problem. They are compared with exact arms if the solution has no noise of the arms. Returns an empty
// list if a point cannot be projected.
std::vector<SmoothErrorsOfArm> FindSmoothErrorsOfArms(const Problem& problem, const Solution& solution);

// The finding `smooth_errors` states these figures.
struct SmoothErrorsFigures {
  RobotNoise smooth;  // Standard deviations of the smooth errors.
  SmoothLengths lengths;
  RobotNoise noise;            // The noise of the robot beside them.
  RobotNoise noise_without;    // Its noise without them.
  double p_value_without = 0;  // PValueWithout.
};
Finding DescribeSmoothErrors(const SmoothErrorsFigures& figures);

}  // namespace heba
