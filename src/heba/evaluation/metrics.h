// Definitions of the error figures that heba reports. Each is defined here and nowhere else.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "heba/data/pair_problem.h"

namespace heba {

// Squared distances between predicted and observed points, which can be summed over views.
struct SquaredErrors {
  double sum_px2 = 0;
  int num_points = 0;
  void Add(const SquaredErrors& other) {
    sum_px2 += other.sum_px2;
    num_points += other.num_points;
  }
  // Returns sqrt(sum(du^2 + dv^2) / points); nothing if there are no points.
  std::optional<double> RmsPx() const;
};

// Returns predicted - observed, px; nothing if a point has no image from that pose.
std::optional<Points2> Residuals(const Camera& camera, const Rigid3d& camera_from_target,
                                 const Observations& observations);

// Returns nothing if a point has no image from that pose.
std::optional<SquaredErrors> ViewErrors(const Camera& camera, const Rigid3d& camera_from_target,
                                        const Observations& observations);
// Returns the errors over all views, each predicted from the robot's pose; nothing if a point of any view has no image.
std::optional<SquaredErrors> ReprojectionErrors(const HandEye& hand_eye, const Camera& camera,
                                                const std::vector<View>& views);

// A capture as a pair of poses: one according to the robot, one according to the camera.
struct PosePair {
  Rigid3d camera_mount_from_target_mount;
  Rigid3d camera_from_target;
  CaptureRole role = CaptureRole::kNone;
  // Covariance of camera_from_target for a pixel noise of 1 px, as a left perturbation (in the camera's frame: m, then
  // rad); nothing if it is unknown.
  std::optional<Eigen::Matrix<double, 6, 6>> covariance_at_1px = std::nullopt;
  std::shared_ptr<const PoseEffect> effect = nullptr;  // View::effect.
  std::vector<double> joints = {};                     // View::joints.
};

// Returns the mean over consecutive captures of the Frobenius norm of A X - X B (Fang et al. 2021, section 5), with
// translations in mm. A is the motion of the target's mount in the camera's mount, B the motion of the target in the
// camera frame, and X = camera_mount_from_camera. Returns nothing for fewer than two captures.
std::optional<double> AxxbMeanMm(const std::vector<PosePair>& pairs, const Rigid3d& camera_mount_from_camera);

// Returns the distance at which a camera works: the median distance of the targets, given their poses; 0 if there are
// none.
double WorkingDistance(const std::vector<Rigid3d>& camera_from_target);

// Scatter of the target's pose, as seen through each capture, about its mean in the frame in which the target is fixed
// (the target's mount): root mean squares over captures.
struct BoardScatter {
  double translation_rms_mm = 0;
  double rotation_rms_deg = 0;
};
std::optional<BoardScatter> ComputeBoardScatter(const std::vector<PosePair>& pairs, const HandEye& hand_eye);

struct TruthErrors {
  double hand_eye_mm = 0;
  double hand_eye_deg = 0;
  std::optional<double> board_mm;
  std::optional<double> board_deg;
  std::optional<double> focal_px;  // Root mean square of the errors of fx and fy.
};

struct Truth {
  Rigid3d camera_mount_from_camera;
  std::optional<Rigid3d> target_mount_from_target;
  std::optional<Camera> camera;
  Eigen::VectorXd arm_errors = {};  // One per parameter of the arm (heba/robot/arm.h); empty if not known.
};

// Computes the differences from the truth. `symmetries` are the motions (target_from_target) that map the target to
// itself, including the identity: if a board can be read in several orders, the nearest of the equivalent poses is
// compared.
TruthErrors CompareWithTruth(const HandEye& hand_eye, const Camera& camera, const Truth& truth,
                             const std::vector<Rigid3d>& symmetries);

}  // namespace heba
