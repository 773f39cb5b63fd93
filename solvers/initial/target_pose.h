// The target's pose in one view, from the view alone.
#pragma once

#include <optional>
#include <vector>

#include "heba/data/problem.h"

namespace heba {

struct TargetPose {
  Rigid3d camera_from_target;
  double rms_px = 0;  // Root mean squared distance of the view's points, as SquaredErrors::RmsPx.
  // As PosePair::covariance_at_1px; nothing if the points leave a direction of the pose open.
  std::optional<Eigen::Matrix<double, 6, 6>> covariance_at_1px = std::nullopt;
};

// The local minima of the reprojection error for a target that is flat (its points at z = 0) or, by a tenth of its
// extent, nearly so, best first: a plane has up to two
// (Schweighofer and Pinz 2006), and which of them is right the view alone cannot always tell. Started from the two
// solutions of T. Collins and A. Bartoli, "Infinitesimal plane-based pose estimation", IJCV 109, 2014. Empty for fewer
// than 4 points, points on a line or far from a plane, or points that no pose explains.
std::vector<TargetPose> EstimateTargetPose(const Camera& camera, const Observations& observations);

// The best of them, to where a step would change less than a thousandth of the error's square: a start for what refines
// it together with others; without a covariance. Nothing where there is none.
std::optional<TargetPose> EstimateRoughPose(const Camera& camera, const Observations& observations);

// The homography H, up to scale, that maps (x, y, 1) of the columns of `from` to those of `to` by least squares in
// normalised coordinates (Hartley's direct linear transform). Nothing for fewer than 4 points or points on a line.
std::optional<Eigen::Matrix3d> EstimateHomography(const Points2& from, const Points2& to);

}  // namespace heba
