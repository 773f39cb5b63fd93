// Maps between planes.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

namespace heba {

// The homography, to_from_from, of at least four points; no value for a degenerate arrangement.
std::optional<Eigen::Matrix3d> FitHomography(const std::vector<Eigen::Vector2d>& from,
                                             const std::vector<Eigen::Vector2d>& to);
Eigen::Vector2d ApplyHomography(const Eigen::Matrix3d& homography, const Eigen::Vector2d& point);

}  // namespace heba
