// The target as a point: what methods use that need no orientation of it, and so are not misled by the two poses that a
// flat target can have in one picture.
#pragma once

#include <vector>

#include "heba/evaluation/metrics.h"

namespace heba {

// One capture: where the point of the target is in the camera, m, and its covariance there for a pixel noise of 1 px.
struct TargetPosition {
  Eigen::Vector3d in_camera;
  Eigen::Matrix3d covariance_at_1px;
};

struct TargetPositions {
  Eigen::Vector3d point_in_target;
  std::vector<TargetPosition> captures;  // One a pair.
};

// Positions of that point of the target's plane z = 0 that the pictures know best (the volumes of its regions of
// confidence are least): near the middle of its points, as the paper's centre of four. Pairs of unknown
// covariance count like the mean of the others; if none is known, the point is the origin and every covariance the
// identity.
TargetPositions BestKnownPositions(const std::vector<PosePair>& pairs);

// The hand-eye pose with the board that it implies: the orientation is the mean over captures, and the target's point
// stands at `point_in_mount`.
HandEye WithBoardAtPoint(const std::vector<PosePair>& pairs, const Rigid3d& camera_mount_from_camera,
                         const Eigen::Vector3d& point_in_target, const Eigen::Vector3d& point_in_mount);

}  // namespace heba
