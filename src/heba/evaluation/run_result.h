// The result of a run: the adjustment of any number of cameras, targets and arms, its errors on captures that it was
// given and on held-out ones, and the verdict.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "heba/data/problem.h"
#include "heba/data/solution.h"
#include "heba/evaluation/evaluation.h"
#include "heba/evaluation/finding.h"

namespace heba {

// The error figures of one camera. Figures that do not exist are empty.
struct CameraErrors {
  std::optional<double> reprojection_rms_px;
  std::optional<double> holdout_rms_px;
  // Difference between the predicted pose of the target and its pose estimated from the image alone, root mean square
  // over the held-out images.
  std::optional<double> holdout_target_mm;
  std::optional<double> holdout_target_deg;
  // Likewise of the images that were left out because they contradict the others.
  std::optional<double> left_out_rms_px = {};
  std::optional<double> left_out_target_mm = {};
  std::optional<double> distance_m = {};  // Median distance of the targets from the camera.
  // Differences of the pose of the camera in its mount from the truth.
  std::optional<double> truth_mm = {};
  std::optional<double> truth_deg = {};
  // The reason if captures were held out, but a figure of them does not exist.
  Failure holdout_reason = {};
};

// The points of one target in one image.
struct TargetInImage {
  std::string target;
  int num_points = 0;
  int num_rejected = 0;  // Number of points that the estimate rejected.
  // RMS of the points that the estimate used, or of all if it used none, with the estimate and the poses of the arms as
  // given.
  std::optional<double> rms_px;
  bool used = false;
  std::string reason = {};  // The reason why it was not used; empty in a result that was read from a file.
};

// The outcome for one image of one capture.
struct ImageResult {
  std::string capture;  // Empty for an image without a pose of the arms; for a pose without a capture, its row.
  std::string camera;   // Empty for a capture without images.
  std::string image;    // File name.
  bool used = false;
  std::string reason;                  // Reason why it, or one of its targets, was not used.
  std::vector<TargetInImage> targets;  // Empty if no target was seen.
  bool was_searched = true;            // False for what the run left out before it searched the images.
  // The distance between the predicted pose of a target and the pose that this image shows, in a fold of the
  // cross-validation that was estimated without it: RMS over its targets.
  std::optional<double> holdout_target_mm = {};
  // The change of the pose of this camera if the capture, with its images of all cameras, is left out
  // (solvers/calibration/influence.h).
  std::optional<CaptureMove> move_without = {};
  std::string repeat_of = {};  // CaptureResult::repeat_of.
};

// A capture: the poses of the arms, and their corrections.
struct CapturePoses {
  std::string name;
  std::vector<Rigid3d> base_from_gripper;  // One per arm, as reported.
  std::vector<Rigid3d> corrections;        // One per arm; empty if the arms are exact.
};

// The exact poses of a rig. Those of targets and bases may be unknown; the first base is the world.
struct CellTruth {
  std::vector<Rigid3d> mount_from_camera;
  std::vector<std::optional<Rigid3d>> mount_from_target;
  std::vector<std::optional<Rigid3d>> world_from_base;
  std::vector<std::optional<Camera>> cameras;
  // One per arm: the errors of its parameters (ArmParamPlace), for the record; empty if they are not known.
  std::vector<Eigen::VectorXd> arm_errors = {};
};

// The distance and the angle between a pose and the true one.
struct PoseError {
  double mm = 0;
  double deg = 0;
};

// The differences of a rig's poses from the truth. Each list is empty, or has an entry for each pose, which is empty if
// the truth is not known.
struct CellPoseErrors {
  // A target that looks the same in several orientations is compared in the nearest.
  std::vector<std::optional<PoseError>> targets;
  std::vector<std::optional<PoseError>> bases;             // One per arm; the first has none.
  std::vector<std::optional<PoseError>> relative_cameras;  // One for each of RunResult::relative_cameras.
};

// Returns the entry of such a list; nothing if the list is empty.
std::optional<PoseError> ErrorAt(const std::vector<std::optional<PoseError>>& errors, size_t place);

// The accuracy that one camera reaches where one is required.
struct CameraRequirement {
  size_t camera = 0;
  Requirement requirement;
};

// A finished run, from which result.json is written.
struct RunResult {
  std::string name;
  std::vector<std::pair<std::string, std::string>> about;  // PairResult::about.
  // The names, mounts, cameras and targets, and the errors of the arms' kinematics that were estimated. It has no
  // captures.
  Problem rig;
  // One per arm: its kinematics, if the data set names them; or an empty list.
  std::vector<std::optional<RobotSummary>> arms;
  std::vector<std::string> target_types;
  Solution solution;                 // Without the outcomes of the captures.
  std::vector<CameraErrors> errors;  // One per camera.
  // One per camera, or empty in a result of an earlier version.
  std::vector<std::optional<WorkingPoint>> working_points;
  std::optional<double> holdout_chi2;          // Held-out chi-square per degree of freedom.
  std::vector<RelativePose> relative_cameras;  // RelativeCameraPoses.
  std::vector<RelativePose> relative_targets;
  std::vector<RelativePose> relative_bases;
  CellPoseErrors truth;
  std::vector<CapturePoses> captures;
  // One per camera and capture, in the order of the captures; then what was left out before.
  std::vector<ImageResult> images;
  // In the order of the requirements; a requirement has an entry for every camera that it concerns, whose built-in
  // limits on uncertainty and hold-out errors it replaces.
  std::vector<CameraRequirement> requirements;
  std::vector<Finding> observations;             // Findings about the run that its figures do not show.
  std::vector<PointDeviation> point_deviations;  // PairResult::point_deviations.
  Verdict verdict;                               // Result of JudgeRun.
  Timing timing;
};

// Returns the result of one camera, which must have a refined estimate, as that of a rig whose parts have no names
// (heba/data/hand_eye.h). It has no captures: the poses of the arm are not part of such a result.
RunResult AsRunResult(const PairResult& result);
// Likewise with one of its estimates that are ok. That of a closed form has no covariance, and that of poses alone no
// camera. The arm is part of the refined estimate or, if there is none, of that of the poses.
RunResult AsRunResult(const PairResult& result, const Estimate& estimate);

// Returns the kinematics of an arm whose errors are part of the solution; null if they were not estimated.
const RobotSummary* FindEstimatedArm(const RunResult& result, size_t robot);
// Returns the reason why they were not, in words.
std::string WhyNotEstimated(const RunResult& result, size_t robot);

}  // namespace heba
