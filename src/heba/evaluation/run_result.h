// The result of a run: the adjustment of any number of cameras, targets and arms, its errors on captures that it was
// given and on held-out ones, and the verdict. That of one camera whose parts have no names has the short form: it has
// the estimates of all methods beside the adjustment.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "heba/data/capture_role.h"
#include "heba/data/point_offsets.h"
#include "heba/data/problem.h"
#include "heba/data/setup.h"
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
  // The number of points that were found only in the second pass, near their pixels predicted by the first estimate.
  int num_second_pass = 0;
};

// The outcome for one image of one capture.
struct ImageResult {
  // The name is empty for an image without a pose of the arms, or that of the image in the short form; a pose without a
  // capture has that of its row.
  std::string capture;
  std::string camera;  // Empty for a capture without images.
  std::string image;   // File name.
  bool used = false;
  std::string reason;                  // The reason why it, one of its targets, or some of their points were not used.
  std::vector<TargetInImage> targets;  // Empty if no target was seen.
  bool was_searched = true;            // False for what the run left out before it searched the images.
  // The distance between the predicted pose of a target and the pose that this image shows, in a fold of the
  // cross-validation that was estimated without it: RMS over its targets.
  std::optional<double> holdout_target_mm = {};
  // The change of the pose of this camera if the capture, with its images of all cameras, is left out
  // (solvers/calibration/influence.h).
  std::optional<CaptureMove> move_without = {};
  // The name of the capture that this one duplicates, in image and pose; empty for all others. Duplicates are not used.
  std::string repeat_of = {};
  CaptureRole role = CaptureRole::kNone;
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
// How much later than the camera's clock that of a robot shows the same time (Dataset::stream).
struct EstimatedTimeOffset {
  double value_s = 0;
  double sigma_s = 0;
};

struct RunResult {
  std::string name;
  // Remarks on the cell from the config, for the record: serial numbers, an operator's name.
  std::vector<std::pair<std::string, std::string>> about;
  // The names, mounts, cameras and targets, and the errors of the arms' kinematics that were estimated. It has no
  // captures.
  Problem rig;
  // One per arm: its kinematics, if the data set names them; or an empty list.
  std::vector<std::optional<RobotSummary>> arms;
  std::vector<std::string> target_types;  // Each target has one; an empty text if only poses of it were given.
  std::vector<int> num_target_points;     // Each target has one, 0 if only poses of it were given; or an empty list.
  Solution solution;                      // Without the outcomes of the captures.
  // The estimates of all methods, of which `solution` is that of FindFinal, and the model are set for one camera, one
  // target and one arm. They are not written to files of the long form.
  std::vector<Estimate> estimates;
  ModelSummary model;
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
  std::vector<Finding> observations;  // Findings about the run that its figures do not show.
  // One per target: the points that are not where the design has them, by the estimate; or an empty list.
  std::vector<PointOffsets> point_offsets;
  std::optional<EstimatedTimeOffset> time_offset;  // The offset is set if that of a stream of poses was estimated.
  // The points of the targets that were seen often enough. Not written to files.
  std::vector<PointDeviation> point_deviations;
  Verdict verdict;  // Result of JudgeRun.
  Timing timing;
};

// Returns a result of the short form without captures and estimates.
RunResult ShortResult(Setup setup, std::string target_type, int num_target_points);
// Return whether a result has the short form: that of one camera whose parts have no names.
bool IsShort(const Problem& rig);
bool IsShort(const RunResult& result);

// Returns the final refinement of reprojection errors that has a covariance; null if there is none, and in a result
// that has no estimates.
const Estimate* FindRefined(const RunResult& result);
// Returns the estimate that stands for the whole result: the refined one. A run on poses of the target has none: there
// it is the chain, unless the least-squares form of the two-step method predicts held-out captures clearly better,
// whose rotation and translation are estimated one after the other. Null if there is no estimate.
const Estimate* FindFinal(const RunResult& result);
// Returns the closed-form estimate with the lowest value of a figure; null if none has the figure.
const Estimate* FindBestClosedForm(const RunResult& result, FigureOf figure);

// Returns the estimate that the errors of the arm are part of: that of the refinement of reprojection errors, unless
// only that of the poses has a result. Null if there is neither.
const Estimate* EstimateWithArm(const RunResult& result);
// Returns a result of the short form whose poses, cameras, shapes and errors are those of FindFinal; without an
// estimate it stays as it is.
RunResult WithFinalEstimate(RunResult result);
// Likewise with one of its estimates that are ok, and without the arm if its errors are not part of that estimate. A
// closed form has no covariance, and an estimate from poses alone no camera.
RunResult WithEstimate(RunResult result, const Estimate& estimate);

// Returns how many captures are named among the images, those included that were left out, and how many of them have an
// image that was used.
int NumCaptures(const RunResult& result);
int NumUsedCaptures(const RunResult& result);

// Returns the kinematics of an arm whose errors are part of the solution; null if they were not estimated.
const RobotSummary* FindEstimatedArm(const RunResult& result, size_t robot);
// Returns the reason why they were not, in words.
std::string WhyNotEstimated(const RunResult& result, size_t robot);

}  // namespace heba
