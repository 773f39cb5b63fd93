// Detection of captures that contradict the others: an image paired with the wrong pose, a mistyped pose, a robot
// that had not settled, a target that was read wrongly. Equation (13) of docs/estimation.md.
#pragma once

#include <vector>

#include "heba/data/free_parameters.h"
#include "heba/data/solution.h"

namespace heba {

// Probability that a data set without any wrong capture has at least one reported as wrong.
inline constexpr double kCaptureFalseAlarm = 0.01;

// Error of a view's points that no model of light, blur and print describes, px. A smooth field of errors of this
// size, with the shape of a pose error, is part of the noise in the test of a capture.
inline constexpr double kUnmodelledPx = 0.003;

struct CaptureVerdict {
  bool is_wrong = false;
  // The tail probability (F) of the distance between the gripper pose that the image shows and the one that the robot
  // reported, given the estimate from the *other* captures, the pixel noise and the robot noise.
  double p_value = 1;
};

// Returns one verdict per view, at an estimate that is not biased by the wrong captures (RefineHandEye with the loss
// `truncated`). `free` lists what captures may disagree about without being wrong; it includes the unknown parameters
// of the target's shape.
//
// The robot noise is estimated from the captures themselves: first from the half of them that agree best, whose
// variances (restricted maximum likelihood, solvers/uncertainty/variance_components.h) are used to test the rest;
// then from all captures that pass, until the selection no longer changes, as in the reweighted estimator of
// Rousseeuw and Van Driessen (1999). A capture passes if its p-value is at least kCaptureFalseAlarm divided by the
// number of captures. Captures at one robot pose share its error and do not confirm one another. A view with a point
// that cannot be projected at the estimate is wrong, with p-value 0. With fewer than six captures, or fewer than six
// degrees of freedom, it cannot be decided which one is wrong: all pass. Solution::views must have an entry for every
// view.
std::vector<CaptureVerdict> FindOutlierCaptures(const Problem& problem, const Solution& solution,
                                                const FreeUnknowns& free);

// Applies the same test to `others`, with the noise and the estimate of the views of `problem_of_members` at their
// solution, to find whether a capture that was left out is still wrong. Smooth errors at its pose count as unknown.
// Returns one verdict per element of `others`.
std::vector<CaptureVerdict> TestLeftOutCaptures(const Problem& problem_of_members, const Solution& solution,
                                                const FreeUnknowns& free, const std::vector<View>& others);

}  // namespace heba
