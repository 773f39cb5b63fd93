// Which captures contradict the others: an image paired with the wrong pose, a mistyped pose, a robot that had not
// settled, a target read wrongly.
#pragma once

#include <vector>

#include "heba/data/solution.h"
#include "solvers/uncertainty/information.h"

namespace heba {

// How often a data set without any wrong capture has one named.
inline constexpr double kCaptureFalseAlarm = 0.01;

// The error of a view's points that no model of light, blur and print describes, px. A field of errors of this size, as
// smooth as a pose's, is part of the noise that a capture is tested by.
inline constexpr double kUnmodelledPx = 0.003;

struct CaptureVerdict {
  bool is_wrong = false;
  // The tail probability (F) of the distance between the gripper's pose that the capture's image shows and the one that
  // the robot stated, given the estimate from the *other* captures, the pixels' noise and the robot's own.
  double p_value = 1;
};

// One verdict a view, at an estimate that the wrong captures have not pulled away (RefineHandEye with the loss
// `truncated`). `free` says what the captures may disagree on without being wrong: what of the target's shape is
// unknown belongs to it. The robot's noise is found from the captures themselves: from the half of them that agree
// best, whose variances (restricted maximum likelihood, solvers/uncertainty/variance_components.h) judge the rest, then
// from all that pass, until nothing changes (as Rousseeuw and Van Driessen's reweighted estimator does, 1999). Each
// passes if its p-value exceeds kCaptureFalseAlarm over the number of captures; captures at one pose of the robot share
// its error and do not vouch for one another. Fewer than six captures cannot tell which of them is wrong: all pass.
// `solution` has an entry of rejected_ids for every view.
std::vector<CaptureVerdict> FindOutlierCaptures(const Problem& problem, const Solution& solution,
                                                const FreeParameters& free);

// The same test of `others`, by the noise and the estimate of the views of `problem_of_members`, at their solution:
// whether a capture that was left out would still be wrong. One verdict for each of the others.
std::vector<CaptureVerdict> TestLeftOutCaptures(const Problem& problem_of_members, const Solution& solution,
                                                const FreeParameters& free, const std::vector<View>& others);

}  // namespace heba
