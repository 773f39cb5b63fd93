// Detection of captures that contradict the others: an image paired with the wrong pose, a mistyped pose, a robot
// that had not settled, a target that was read wrongly. Equation (13) of docs/estimation.md.
#pragma once

#include <vector>

#include "heba/data/problem.h"
#include "heba/data/solution.h"
#include "solvers/refine/judged_problem.h"

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

// Returns the images of the captures that are wrong.
ImageSet WrongOf(const std::vector<CaptureVerdict>& verdicts);

// Returns the problem without noisy joints. Captures are judged by a white noise of the robot, which contains that of
// the joints.
Problem WithoutNoisyJoints(Problem problem);

// Returns one verdict per capture of a problem with one camera, one target and one arm, whose captures have one image
// each, at an estimate that is not biased by the wrong captures (RefineProblem with the loss `truncated`). A capture
// without points passes. The errors of the arm that the solution has found count as known.
//
// The robot noise is estimated from the captures themselves: first from the half of them that agree best, whose
// variances (restricted maximum likelihood, solvers/uncertainty/variance_components.h) are used to test the rest;
// then from all captures that pass, until the selection no longer changes, as in the reweighted estimator of
// Rousseeuw and Van Driessen (1999). A capture passes if its p-value is at least kCaptureFalseAlarm divided by the
// number of captures. Captures at one robot pose share its error and do not confirm one another. A capture with a point
// that cannot be projected at the estimate is wrong, with p-value 0. With fewer than six captures, or fewer than six
// degrees of freedom, it cannot be decided which one is wrong: all pass.
std::vector<CaptureVerdict> FindOutlierCaptures(const Problem& problem, const Solution& solution);

// Applies the same test to the captures `left_out`, with the noise and the estimate of the others at their solution, to
// find whether a capture that was left out is still wrong. Smooth errors at its pose count as unknown. Returns one
// verdict per element of `left_out`.
std::vector<CaptureVerdict> TestLeftOutCaptures(const Problem& problem, const Solution& solution,
                                                const std::vector<size_t>& left_out);

}  // namespace heba
