// Monte-Carlo study: the errors of estimators on simulated captures with known truth, compared with the smallest error
// that any unbiased estimator can have (the Cramer-Rao bound). The errors are those of the poses of StudiedPoses, in
// whose order all vectors below are.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "solvers/study/study_cell.h"

namespace heba {

// Returns the names of the poses whose errors a study states: every camera in its mount ("camera left in world"), every
// camera in another one whose relative pose is constant ("camera right in camera left"), and every base in another one
// ("arm right in arm left"). The poses of a hand-eye calibration are one entry without a name.
std::vector<std::string> StudiedPoses(const StudyCell& cell);

// Runs trial `trial` of a cell; `seed` and `trial` determine all random numbers. Returns the estimates of each pose: of
// a hand-eye calibration one for each closed form, then those of chain and bundle; otherwise one for each estimator.
// Poses that no camera determines by itself have no estimate of kOneByOne.
std::vector<std::vector<TrialEstimate>> RunTrial(const StudyCell& cell, uint64_t seed, int trial);

// The Cramer-Rao bound of the unknowns in TrialEstimate::error: their smallest covariance.
struct PoseBound {
  Eigen::MatrixXd covariance;
  StudyErrors errors;
};
// Returns the bound of each pose for the cell's captures: the errors that no unbiased estimator can undercut if all
// points are inliers, both noises and the standard deviations of the robot's systematic errors are known, and the
// unknown parts of the targets' shapes are those that differ from the design. The covariance is the inverse of the sum
// over captures of J^T (s^2 I + G Q G^T)^-1 J, without G Q G^T for an exact robot. Returns a Failure if the captures do
// not determine the unknowns.
Outcome<std::vector<PoseBound>> ErrorBounds(const StudyCell& cell);

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

// A pose's bound and the errors of its estimators.
struct PoseSummary {
  std::string pose;
  Outcome<StudyErrors> bound = {};
  std::vector<MethodSummary> methods;  // In the order of the first trial.
};
// Summarises the trials of a cell.
std::vector<PoseSummary> Summarise(const StudyCell& cell,
                                   const std::vector<std::vector<std::vector<TrialEstimate>>>& trials);

}  // namespace heba
