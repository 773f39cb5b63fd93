// Homographies between planes.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

namespace heba {

// Returns the homography H, up to scale, that maps (x, y, 1) of the columns of `from` to those of `to`: linear least
// squares in normalised coordinates (the normalised direct linear transform: R. Hartley, "In defense of the eight-point
// algorithm", PAMI 19(6), 1997), an initial guess. Returns nothing for fewer than 4 points, for collinear points, for
// coordinates that are not finite and for points that do not determine the homography.
std::optional<Eigen::Matrix3d> LinearHomography(const Eigen::Matrix2Xd& from, const Eigen::Matrix2Xd& to);

// Returns the homography that minimises the sum of squared distances between mapped points and `to`, from
// LinearHomography, in the same cases.
std::optional<Eigen::Matrix3d> FitHomography(const std::vector<Eigen::Vector2d>& from,
                                             const std::vector<Eigen::Vector2d>& to);

Eigen::Vector2d ApplyHomography(const Eigen::Matrix3d& homography, const Eigen::Vector2d& point);
// Returns the ratio of a small area around the mapped point to the area around `point`; negative if the homography
// mirrors it.
double AreaScale(const Eigen::Matrix3d& homography, const Eigen::Vector2d& point);

}  // namespace heba
