// Which captures contradict the others: an image paired with the wrong pose, a mistyped pose, a robot that had not
// settled, a target read wrongly.
#pragma once

#include <vector>

#include "heba/data/solution.h"
#include "solvers/information.h"

namespace heba {

// How often a data set without any wrong capture has one named.
inline constexpr double kCaptureFalseAlarm = 0.01;

struct CaptureVerdict {
  bool is_wrong = false;
  // What the capture's picture says that the gripper is off by from where the robot said that it was, over what the
  // estimate from the *other* captures, the pixels and the robot's own noise allow: the tail probability of F.
  double p_value = 1;
};

// One verdict a view, at an estimate that the wrong captures have not pulled away (RefineHandEye with the loss
// `truncated`, an exact robot). What robots of this kind are off by is found from the captures themselves: from the
// half of them that agree best, whose variances (restricted maximum likelihood, solvers/robot_noise.h) judge the rest,
// then from all that pass, until nothing changes (as Rousseeuw and Van Driessen's reweighted estimator does, 1999).
// Each passes if its p-value exceeds kCaptureFalseAlarm over the number of captures. Fewer than six captures cannot
// tell which of them is wrong: all pass. `solution` has an entry of rejected_ids for every view.
std::vector<CaptureVerdict> TestCaptures(const Problem& problem, const Solution& solution, const FreeParameters& free);

}  // namespace heba
