// The numbers that heba reports: each is defined here and nowhere else.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/data/problem.h"

namespace heba {

// Squared distances between predicted and observed points, to be put together over views.
struct SquaredErrors {
  double sum_px2 = 0;
  int num_points = 0;
  void Add(const SquaredErrors& other) {
    sum_px2 += other.sum_px2;
    num_points += other.num_points;
  }
  // sqrt(sum(du^2 + dv^2) / points); nothing without points.
  std::optional<double> RmsPx() const;
};

// predicted - observed, px. Nothing if a point has no image from that pose.
std::optional<Points2> Residuals(const Camera& camera, const Rigid3d& camera_from_target,
                                 const Observations& observations);

// Nothing if a point has no image from that pose.
std::optional<SquaredErrors> ViewErrors(const Camera& camera, const Rigid3d& camera_from_target,
                                        const Observations& observations);
// Over all views, each predicted from the robot's pose. Nothing if a point of any view has no image.
std::optional<SquaredErrors> ReprojectionErrors(const HandEye& hand_eye, const Camera& camera,
                                                const std::vector<View>& views);

// One capture as a pair of poses: what the robot says and what the camera sees.
struct PosePair {
  Rigid3d camera_mount_from_target_mount;
  Rigid3d camera_from_target;
  // What the capture is for, as in poses.csv: home, translate_x, translate_y, rotate, free; empty if nobody said.
  std::string role = {};
  // How well the picture knows camera_from_target, of its left perturbation (in the camera's frame: m, then rad), for a
  // pixel noise of 1 px. Nothing: nobody knows.
  std::optional<Eigen::Matrix<double, 6, 6>> covariance_at_1px = std::nullopt;
};

// The mean over consecutive captures of the Frobenius norm of A X - X B (Fang et al. 2021, section 5), translations in
// mm, with A = mount motion, B = camera motion, X = camera_mount_from_camera. Nothing for fewer than two captures.
std::optional<double> AxxbMeanMm(const std::vector<PosePair>& pairs, const Rigid3d& camera_mount_from_camera);

// How far the target's pose, seen through each capture, scatters about its mean in the frame where it stands still
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
};

// `symmetries` are the motions (target_from_target) that map the target to itself, the identity among them: where a
// board can be read in several orders, its pose is compared with the nearest.
TruthErrors CompareWithTruth(const HandEye& hand_eye, const Camera& camera, const Truth& truth,
                             const std::vector<Rigid3d>& symmetries);

}  // namespace heba
