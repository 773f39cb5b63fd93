// Monte-Carlo study: the errors of methods on simulated measurements with known truth, compared with the smallest
// error that any unbiased estimator can have (the Cramer-Rao bound).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/calibration.h"
#include "heba/simulation/scene.h"

namespace heba {

// One cell of a study: a scene, its noise, and the options of the estimators. The poses are the same in every trial;
// the noise is not.
struct StudyCell {
  Camera camera;  // The true camera.
  HandEye hand_eye;
  Observations target;  // Ids, points and radii that every capture sees; its pixels are not used.
  std::vector<SimulatedPose> poses;
  TargetShape shape;  // The true shape; the estimators know the design only.
  double pixel_sigma_px = 0;
  RobotNoise robot_noise;
  // Probabilities: that a point is displaced by up to 40 px in u and in v, and that the stated pose of a capture is
  // wrong by 5 mm and 0.02 rad (one sigma along and about each axis).
  double outlier_points = 0;
  double wrong_captures = 0;
  // The setup in the options is that of the scene too. If the options have no camera, the trials estimate it.
  CalibrationOptions options;
};

// Errors of one estimate, in the tangent spaces of the child frames (m, rad): hand-eye pose (6), board pose (6), then
// the free intrinsics.
struct TrialEstimate {
  std::string method;
  bool ok = false;
  Eigen::VectorXd error;
  double axxb_mean_mm = 0;  // AxxbMeanMm.
  // Whether the 95 % confidence region of a refinement with a covariance contains the truth.
  std::optional<bool> is_covered;
  // Whether a refinement that chose its error model chose that of the cell.
  std::optional<bool> has_right_model;
  std::optional<double> pixel_sigma_px;
  std::optional<RobotNoise> robot_noise;
};

// Runs trial `trial` of a cell; `seed` and `trial` determine all random numbers. Returns one estimate per closed form,
// then those of chain and bundle.
std::vector<TrialEstimate> RunTrial(const StudyCell& cell, uint64_t seed, int trial);

// RMS over trials of the norms of the errors; for the bound, the square roots of the traces of its covariance.
struct StudyErrors {
  double hand_eye_m = 0;
  double hand_eye_rad = 0;
  double board_m = 0;
  double board_rad = 0;
  std::optional<double> focal_px;  // RMS over fx and fy; not set unless both are free.
};

// Returns the Cramer-Rao bound for the cell's poses: the errors that no unbiased estimator can undercut if all points
// are inliers, both noises are known, and the unknown parts of the target's shape are those that differ from the
// design. The covariance is the inverse of the sum over captures of J^T (s^2 I + G Q G^T)^-1 J, without G Q G^T for an
// exact robot. Returns a Failure if the captures do not determine the unknowns.
Outcome<StudyErrors> ErrorBound(const StudyCell& cell);

struct MethodSummary {
  std::string method;
  int num_trials = 0;
  int num_failed = 0;
  StudyErrors rms;  // Over the trials that did not fail.
  double axxb_mean_mm = 0;
  std::optional<double> coverage;
  std::optional<double> right_model;  // Share of trials that chose the cell's error model.
  // Medians of the sigmas that the refinement estimated.
  std::optional<double> pixel_sigma_px;
  std::optional<RobotNoise> robot_noise;
};

// Summarises trials, in the order of the first trial's methods.
std::vector<MethodSummary> Summarise(const StudyCell& cell, const std::vector<std::vector<TrialEstimate>>& trials);

}  // namespace heba
