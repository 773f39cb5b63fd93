// One cell of a Monte-Carlo study, and the errors of its trials.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "heba/calibration_types.h"
#include "heba/simulation/scene.h"

namespace heba {

// A pose at which the trials predict the target's place in the camera.
struct StudyPlace {
  Rigid3d camera_mount_from_target_mount;  // The pose that the robot reports.
  std::shared_ptr<const PoseEffect> effect;
  Matrix6X gripper_by_joints;  // View::gripper_by_joints.
  // Whether the arm is in a configuration in which there are captures.
  bool is_inside = true;
};

// The errors of a robot that each trial draws anew.
struct StudyRobot {
  // The systematic errors. The standard deviations of their groups are those with which they are drawn.
  std::shared_ptr<const SharedEffects> errors;
  double joint_noise_rad = 0;  // One sigma of each joint in each capture.
  // For each capture: View::effect and View::gripper_by_joints.
  std::vector<std::shared_ptr<const PoseEffect>> effects;
  std::vector<Matrix6X> gripper_by_joints;
  std::vector<StudyPlace> places;
};

// One cell of a study: a scene, its noise, and the options of the estimators. The poses are the same in every trial;
// the noise is not.
struct StudyCell {
  Camera camera;  // The true camera.
  HandEye hand_eye;
  Observations target;  // Ids, points and radii that every capture sees; its pixels are not used.
  std::vector<SimulatedPose> poses;
  int num_repeats = 1;  // The captures at each pose, with one error of the robot.
  TargetShape shape;    // The true shape; the estimators know the design only.
  double pixel_sigma_px = 0;
  RobotNoise robot_noise;
  std::optional<StudyRobot> robot;
  // Probabilities: that a point is displaced by up to 40 px in u and in v, and that the stated pose of a capture is
  // wrong by 5 mm and 0.02 rad (one sigma along and about each axis).
  double outlier_points = 0;
  double wrong_captures = 0;
  // The setup in the options is that of the scene too. If the options have no camera, the trials estimate it.
  CalibrationOptions options;
};

// The errors of the predicted target at the places of a cell (StudyRobot::places).
struct PlaceErrors {
  double sum_m2 = 0;
  // Number of errors within the 95 % confidence region, which includes the noise of a further capture.
  int num_covered = 0;
  int num = 0;
};

// Errors of one estimate, in the tangent spaces of the child frames (m, rad): hand-eye pose (6), board pose (6), then
// the free intrinsics. In the study of a rig, an estimate is that of one pose (6).
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
  // The figures below exist for refinements in a cell whose robot has systematic errors.
  std::optional<bool> has_effects;  // Whether such errors were estimated.
  PlaceErrors inside;
  PlaceErrors outside;
};

// RMS over trials of the norms of the errors; for the bound, the square roots of the traces of its covariance.
struct StudyErrors {
  double hand_eye_m = 0;
  double hand_eye_rad = 0;
  std::optional<double> board_m;  // Not set for the poses of a rig, whose errors are in hand_eye_m and hand_eye_rad.
  std::optional<double> board_rad;
  std::optional<double> focal_px;  // RMS over fx and fy; not set unless both are free.
  // The predicted target at the places inside and outside the captured configurations; not set if there are none.
  std::optional<double> inside_m;
  std::optional<double> outside_m;
};

}  // namespace heba
