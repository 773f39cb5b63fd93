// Finds a mount that moved during the captures: a linear creep, or one step.
//
// The errors of a robot depend on its pose, and poses follow a path: seen in the order of the captures they look like a
// drift. A drift is therefore found only on evidence that excludes them (DriftEvidence).
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heba/data/drift.h"
#include "heba/data/problem.h"
#include "heba/data/solution.h"
#include "heba/evaluation/finding.h"

namespace heba {

// When the captures of a problem were taken: for each its place in the order of time, and the number of all captures.
struct CaptureTimes {
  std::vector<size_t> places;
  size_t num_captures = 0;
};
// Returns the times of captures that are in the order of time, none of which is missing.
CaptureTimes TimesInOrder(size_t num_captures);

// Below this probability by chance, for all drifts that are tested, captures at one pose show a drift.
inline constexpr double kDriftByChance = 0.01;
// Likewise beside the estimated errors of an arm. What its model lacks follows the path of the captures, too: a
// recorded UR5 without a drift (55 captures in three configurations) has p = 5e-6, while a creep of .05 deg in 20
// simulated captures of a UR5e has less than 1e-17.
inline constexpr double kDriftByChanceBesideArm = 1e-8;
// Likewise if the errors of an arm are not estimated: those of neighbouring poses are alike, so that even in a mixed
// order the captures say less about them than independent ones would. Of 60 simulated sessions of arms with usual
// errors and no drift, p was below 0.01 in 8 and below 0.0005 in none.
inline constexpr double kDriftByChanceInOrder = 1e-5;

struct DriftSearch {
  std::optional<Drift> found;
  // `drift_unseen`, if there is no evidence to tell a drift by.
  std::optional<Finding> unseen;
};

// All captures as they were detected, with those that the calibration left out: captures that a drift puts aside look
// like outliers. Without effects of the arm, which are the same at one pose.
struct DetectedCaptures {
  Problem problem;
  CaptureTimes times;
};

// Looks for a drift of the camera or of the target of a single camera, one target and one arm. `problem` holds the
// points that the solution used, `detected` all of them, of which those at one pose are compared with each other. With
// the unknowns x of the solution, which has the covariance C, and the columns D = s(t) A of a drift h, where A are the
// columns of the body's pose and s is its share of the motion, all whitened with the noise of the solution,
//   T = g^T S g,  g = D^T r,  S = (D^T D - D^T A_x C A_x^T D)^-1,  h = S g
// is compared with the squares R of the residuals, which the noise was estimated from: (T / 6) / ((R - T) / (dof - 6))
// follows F if there is none. Captures at one pose are judged by T alone, with the repeatability of robots; at least
// two poses must have been taken again, and what the drift leaves of their differences must be noise. p-values are
// corrected for the bodies, forms and steps that are tested. Returns neither a drift nor a finding for fewer than eight
// captures.
DriftSearch FindDrift(const Problem& problem, const Solution& solution, const CaptureTimes& times,
                      const DetectedCaptures& detected);

// Looks for a linear creep of one of several cameras: errors of the arms, whose noise must be modelled, are common to
// all images of a capture. Returns the clearest, by the test of FindDrift, of the cameras that share eight captures
// with others; nothing unless its p-value is below kDriftByChanceBesideArm.
std::optional<Drift> FindCreepOfCamera(const Problem& problem, const Solution& solution, const CaptureTimes& times);

// Returns drifts of the same bodies and forms as `drifts`, estimated together from all captures without a test: what is
// left of them at the solution. The problem may have any number of cameras, targets and arms. Returns nothing if the
// captures do not determine them.
std::optional<std::vector<Drift>> EstimateDrifts(const Problem& problem, const Solution& solution,
                                                 const CaptureTimes& times, std::vector<Drift> drifts);

// Returns the changes of an estimate by the uncertainty of drifts that it was corrected for, as the columns that
// WithChanges takes: C A_x^T D S^(1/2).
std::vector<Eigen::VectorXd> ChangesByDrifts(const Problem& problem, const Solution& solution,
                                             const CaptureTimes& times, const std::vector<Drift>& drifts);

// The finding `drift`. `problem` names the body; `capture` is the name of Drift::capture; `is_corrected`: whether the
// result was corrected for it.
Finding DescribeDrift(const Problem& problem, const Drift& drift, const std::string& capture, bool is_corrected);

// Returns how much of the captures' order is a function of their poses: the coefficient of determination of the
// leave-one-out kernel regression of the place on the pose, at the best width; 0 for fewer than three.
double OrderByPose(const std::vector<Rigid3d>& poses, const std::vector<size_t>& places);

}  // namespace heba
