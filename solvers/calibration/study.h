// Monte-Carlo study: the errors of methods on simulated measurements with known truth, compared with the smallest
// error that any unbiased estimator can have (the Cramer-Rao bound).
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "solvers/calibration/study_cell.h"

namespace heba {

// Runs trial `trial` of a cell; `seed` and `trial` determine all random numbers. Returns one estimate per closed form,
// then those of chain and bundle.
std::vector<TrialEstimate> RunTrial(const StudyCell& cell, uint64_t seed, int trial);

// Returns the Cramer-Rao bound for the cell's poses: the errors that no unbiased estimator can undercut if all points
// are inliers, both noises and the standard deviations of the robot's systematic errors are known, and the unknown
// parts of the target's shape are those that differ from the design. The covariance is the inverse of the sum over
// captures of J^T (s^2 I + G Q G^T)^-1 J, without G Q G^T for an exact robot. Returns a Failure if the captures do not
// determine the unknowns.
Outcome<StudyErrors> ErrorBound(const StudyCell& cell);

struct MethodSummary {
  std::string method;
  int num_trials = 0;
  int num_failed = 0;
  StudyErrors rms;  // Over the trials that did not fail.
  double axxb_mean_mm = 0;
  std::optional<double> coverage;
  std::optional<double> right_model;        // Share of trials that chose the cell's error model.
  std::optional<double> estimated_effects;  // Share of trials that estimated systematic errors of the robot.
  // Shares of the places whose confidence region contains the truth.
  std::optional<double> coverage_inside;
  std::optional<double> coverage_outside;
  // Medians of the sigmas that the refinement estimated.
  std::optional<double> pixel_sigma_px;
  std::optional<RobotNoise> robot_noise;
};

// Summarises trials, in the order of the first trial's methods. `errors_of` returns the errors that belong to the mean
// squared error of each unknown (TrialEstimate::error).
std::vector<MethodSummary> SummariseTrials(const std::vector<std::vector<TrialEstimate>>& trials,
                                           const std::function<StudyErrors(const Eigen::VectorXd&)>& errors_of);
// Likewise, for the trials of a cell.
std::vector<MethodSummary> Summarise(const StudyCell& cell, const std::vector<std::vector<TrialEstimate>>& trials);

}  // namespace heba
