// The target reduced to one point, for methods that do not use its orientation and are therefore not affected by the
// two-fold pose ambiguity of a planar target.
#pragma once

#include <vector>

#include "heba/evaluation/metrics.h"

namespace heba {

// The position of the target's point in the camera frame, m, and its covariance, m^2, for a pixel noise of 1 px.
struct TargetPosition {
  Eigen::Vector3d in_camera;
  Eigen::Matrix3d covariance_at_1px;
};

struct TargetPositions {
  Eigen::Vector3d point_in_target;
  std::vector<TargetPosition> captures;  // One per pair.
};

// Returns the positions of the point in the target's plane z = 0 that the images determine best (minimal volume of
// the confidence regions): it lies near the centre of the target's points, like the paper's centre of four. A pair
// without covariance is given an isotropic one with the mean variance of the others; if no pair has a covariance, the
// point is the origin and every covariance is the identity.
TargetPositions BestKnownPositions(const std::vector<PosePair>& pairs);

// Returns the hand-eye pose together with the board pose that it implies: the orientation is the mean over the
// captures, and the translation is such that the target's point lies at `point_in_mount`.
HandEye WithBoardAtPoint(const std::vector<PosePair>& pairs, const Rigid3d& camera_mount_from_camera,
                         const Eigen::Vector3d& point_in_target, const Eigen::Vector3d& point_in_mount);

}  // namespace heba
