// Sub-pixel refinement of chessboard-like corners: points where four alternately black and white squares meet.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "heba/drawing.h"

namespace heba {

// Refines the saddle point near `start_px`. `reach_px` is the distance from the corner to the next edges (the
// shortest side of the squares around it, as imaged); the window stays within it. Returns nothing if the window would
// be too small or would leave the image, or if the corner moves by more than `max_move_px`.
std::optional<Eigen::Vector2d> RefineCorner(const cv::Mat& grey, const Eigen::Vector2d& start_px, double reach_px,
                                            double max_move_px);

struct MeasuredCorner {
  Eigen::Vector2d pixel;
  Eigen::Matrix2d covariance_px2;
  double outlier_share = 0;  // Share of the used grey values that show something else.
};

// The curvature of the map from a target to the image around one of its points: the coefficients of x^2, x y and y^2
// (px per squared unit of length) beyond a homography, each with the standard deviation `sigma`.
struct MapCurvature {
  Eigen::Matrix<double, 2, 3> squares = Eigen::Matrix<double, 2, 3>::Zero();
  double sigma = 0;
};
// Estimates the curvature from the residuals of a homography that was fitted to corners. `offsets` are the positions
// of the corners relative to the point, in units of length. Returns nothing if there are fewer than eight corners or
// if they are degenerate.
std::optional<MapCurvature> BendOf(const std::vector<Eigen::Vector2d>& offsets,
                                   const std::vector<Eigen::Vector2d>& residuals_px);

// Measures the corner at `at_m` of a target's drawing, near `start_px`, by a fit to the grey values within `half_m`
// of it along x and y, but at most within 20 px. What lies beyond `half_m` belongs to the next corner, so that no
// grey value is used twice. Returns nothing if the image does not show what is drawn. `image_from_board` is the
// homography around the corner up to a shift; `curvature`, in units of `half_m`, is estimated from the neighbouring
// corners. If it is given, all pixels of an edge determine the edge's position; if it is free, mainly those in the
// middle of the edge do.
std::optional<MeasuredCorner> MeasureCorner(const cv::Mat& grey, const Drawing& drawing, const Eigen::Vector2d& at_m,
                                            double half_m, const Eigen::Matrix3d& image_from_board,
                                            const Eigen::Vector2d& start_px,
                                            const std::optional<MapCurvature>& curvature = std::nullopt);

}  // namespace heba
