// Monte-Carlo: what methods make of simulated measurements with known truth, against the least error that any could
// have (the Cramer-Rao bound).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/simulation/scene.h"
#include "solvers/calibration/calibration.h"

namespace heba {

// One cell of a study: a scene, its noise, and what is asked of the estimators. The poses are the same in every trial;
// the noise is not.
struct StudyCell {
  Camera camera;  // Of the truth.
  HandEye hand_eye;
  Observations target;  // Ids, points and radii of what every capture sees; its pixels are not used.
  std::vector<SimulatedPose> poses;
  TargetShape shape;  // The true shape; the estimators know the design only.
  double pixel_sigma_px = 0;
  RobotNoise robot_noise;
  // Each point is, with this probability, anywhere within 40 px of its place; each capture's stated pose wrong by 5 mm
  // and 0.02 rad (one sigma along and about each axis).
  double outlier_points = 0;
  double wrong_captures = 0;
  // Its setup belongs to the scene too. Without a camera the trials estimate it.
  CalibrationOptions options;
};

// Errors of one estimate, m and rad, in the child frames' tangents: hand-eye (6), board (6), then the free intrinsics.
struct TrialEstimate {
  std::string method;
  bool ok = false;
  Eigen::VectorXd error;
  double axxb_mean_mm = 0;  // The paper's measure.
  // Of a refinement with a covariance: whether its 95 % region holds the truth.
  std::optional<bool> is_covered;
  // Whether a refinement that chose its model of the errors chose the cell's.
  std::optional<bool> has_right_model;
  std::optional<double> pixel_sigma_px;
  std::optional<RobotNoise> robot_noise;
};

// Trial `trial` of a cell: everything follows from `seed` and the number. One estimate a closed form, then chain and
// bundle.
std::vector<TrialEstimate> RunTrial(const StudyCell& cell, uint64_t seed, int trial);

// Root mean squares over trials of the norms; the bound's are those of its covariance.
struct StudyErrors {
  double hand_eye_m = 0;
  double hand_eye_rad = 0;
  double board_m = 0;
  double board_rad = 0;
  std::optional<double> focal_px;  // Of fx and fy together; if they are free.
};

// The covariance that no unbiased estimator is better than, for the cell's poses, all its points good, both noises
// known, and that part of the target's shape unknown in which it differs from its design: sum J^T (s^2 I + G Q G^T)^-1
// J over captures, inverted. With an exact robot without G. A Failure if the captures do not determine the unknowns.
Outcome<StudyErrors> ErrorBound(const StudyCell& cell);

struct MethodSummary {
  std::string method;
  int num_trials = 0;
  int num_failed = 0;
  StudyErrors rms;  // Over the trials that did not fail.
  double axxb_mean_mm = 0;
  std::optional<double> coverage;
  std::optional<double> right_model;  // The share of trials that chose the cell's model of the errors.
  // Medians of what the refinement found.
  std::optional<double> pixel_sigma_px;
  std::optional<RobotNoise> robot_noise;
};

// In the order of the first trial's methods.
std::vector<MethodSummary> Summarise(const StudyCell& cell, const std::vector<std::vector<TrialEstimate>>& trials);

}  // namespace heba
