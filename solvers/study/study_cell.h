// One cell of a Monte-Carlo study, and the errors of its trials. A hand-eye calibration is a cell with one camera, one
// target and one arm, which have no names (heba/data/hand_eye.h).
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "heba/data/hand_eye.h"
#include "heba/pair_calibration_types.h"
#include "heba/simulation/scene.h"

namespace heba {

// A pose at which the trials predict the target's position in the camera.
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

struct StudyTarget {
  Observations points;  // The ids, points and radii as designed; the pixels are not used.
  bool z_out = false;   // Whether the target's z axis points out of its front side.
};

struct StudyCapture {
  SimulatedPose seen;  // It is set in a hand-eye calibration.
  ArmPoses arms = {};  // The exact poses of all arms are set in other cells.
};

// The ways to calibrate several cameras; their names are those of kStudyEstimatorNames, in this order.
enum class StudyEstimator {
  kJointly,   // Calibrate of all cameras.
  kOneByOne,  // Calibrate of each camera by itself, with the targets that it sees and the arms that move them.
};
inline constexpr std::array<const char*, 2> kStudyEstimatorNames = {"jointly", "one_by_one"};

// One cell of a study: a scene, its noise, and the options of the estimators. The poses of the arms are the same in
// every trial; the noise is not.
struct StudyCell {
  Problem problem;  // With the true cameras and the designed targets, without captures.
  CellPoses poses;
  std::vector<StudyTarget> targets;
  std::vector<StudyCapture> captures;
  int num_repeats = 1;                           // The captures at each pose, with one error of the robot.
  double margin_px = MotionOptions().margin_px;  // Named targets are seen at this distance from the image's border.
  // The true shape of each target; the estimators know the design only.
  std::array<double, TargetShape::kNumParams> shape_params = TargetShape().params;
  double pixel_sigma_px = 0;
  RobotNoise robot_noise;
  std::optional<StudyRobot> robot;  // For a hand-eye calibration.
  // Probabilities: that a point is displaced by up to 40 px in u and in v, and that the stated poses of a capture are
  // wrong by 5 mm and 0.02 rad (one sigma along and about each axis).
  double outlier_points = 0;
  double wrong_captures = 0;
  bool gives_cameras = true;  // Otherwise the trials estimate the cameras, whose models are known.
  // The setup, the camera, the target and the free intrinsics in the options are replaced by those of the cell.
  PairCalibrationOptions options;
  // For named cameras. A hand-eye calibration has every closed form, the chain and the bundle adjustment instead.
  std::vector<StudyEstimator> estimators = {StudyEstimator::kJointly, StudyEstimator::kOneByOne};
};

// Returns whether a cell is a hand-eye calibration.
bool IsHandEye(const StudyCell& cell);
// The setup and the true poses of a hand-eye calibration.
Setup SetupOf(const StudyCell& cell);
HandEye HandEyeOf(const StudyCell& cell);

// Returns whether the 95 % confidence region of an estimate whose covariance has `dof` degrees of freedom contains the
// truth.
bool IsCovered(const Eigen::VectorXd& error, const Eigen::MatrixXd& covariance, double dof);

// The errors of the predicted target at the places of a cell (StudyRobot::places).
struct PlaceErrors {
  double sum_m2 = 0;
  // Number of errors within the 95 % confidence region, which includes the noise of a further capture.
  int num_covered = 0;
  int num = 0;

  void Add(const PlaceErrors& other) {
    sum_m2 += other.sum_m2;
    num_covered += other.num_covered;
    num += other.num;
  }
};

// Errors of one estimate, in the tangent spaces of the child frames (m, rad): of a hand-eye calibration, the hand-eye
// pose (6), the board pose (6), then the free intrinsics; otherwise those of one pose (6).
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
  std::optional<double> board_m;  // Set for a hand-eye calibration; the errors of another pose are the two above.
  std::optional<double> board_rad;
  std::optional<double> focal_px;  // RMS over fx and fy; not set unless both are free.
  // The predicted target at the places inside and outside the captured configurations; not set if there are none.
  std::optional<double> inside_m;
  std::optional<double> outside_m;
};

}  // namespace heba
