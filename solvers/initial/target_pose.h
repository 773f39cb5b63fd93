// Estimates the target pose in one view from that view alone.
#pragma once

#include <optional>
#include <vector>

#include "heba/data/pair_problem.h"

namespace heba {

struct TargetPose {
  Rigid3d camera_from_target;
  double rms_px = 0;  // See SquaredErrors::RmsPx.
  // See PosePair::covariance_at_1px; nothing if the points do not determine the pose.
  std::optional<Eigen::Matrix<double, 6, 6>> covariance_at_1px = std::nullopt;
};

// Returns the local minima of the reprojection error, best first, for a target that is planar (points at z = 0) or
// deviates from a plane by at most a tenth of its extent. A planar target has up to two (Schweighofer and Pinz 2006),
// and one view alone cannot always tell which one is correct. The initial guesses are the two solutions of T. Collins
// and A. Bartoli, "Infinitesimal plane-based pose estimation", IJCV 109, 2014. Returns an empty list for fewer than 4
// points, for points that are collinear or far from a plane, and for points that no pose explains.
std::vector<TargetPose> EstimateTargetPose(const Camera& camera, const Observations& observations);

// Returns the best of these poses, without covariance, refined until a step changes the squared error by less than a
// thousandth: an initial guess for a joint refinement. Returns nothing if there is no pose.
std::optional<TargetPose> EstimateRoughPose(const Camera& camera, const Observations& observations);

}  // namespace heba
