// Homographies between planes.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

namespace heba {

// Returns the homography to_from_from fitted to at least four pairs of points, or nothing if they are degenerate.
std::optional<Eigen::Matrix3d> FitHomography(const std::vector<Eigen::Vector2d>& from,
                                             const std::vector<Eigen::Vector2d>& to);
Eigen::Vector2d ApplyHomography(const Eigen::Matrix3d& homography, const Eigen::Vector2d& point);

}  // namespace heba
