// Sub-pixel places of chessboard-like corners: points where four alternately black and white squares meet.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

namespace heba {

// The saddle near `start_px`. `reach_px` is how far the edges through the corner go on before another edge comes near
// (the smallest side of the squares around it, as seen): the window stays inside. No value if the window would be too
// small or leaves the picture, or if the corner moves farther than `max_move_px`.
std::optional<Eigen::Vector2d> RefineCorner(const cv::Mat& grey, const Eigen::Vector2d& start_px, double reach_px,
                                            double max_move_px);

// The homography, to_from_from, of at least four points; no value for a degenerate arrangement.
std::optional<Eigen::Matrix3d> FitHomography(const std::vector<Eigen::Vector2d>& from,
                                             const std::vector<Eigen::Vector2d>& to);
Eigen::Vector2d Map(const Eigen::Matrix3d& homography, const Eigen::Vector2d& point);

}  // namespace heba
