// Sub-pixel places of chessboard-like corners: points where four alternately black and white squares meet.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "targets/drawing.h"

namespace heba {

// The saddle near `start_px`. `reach_px` is how far the edges through the corner go on before another edge comes near
// (the smallest side of the squares around it, as seen): the window stays inside. No value if the window would be too
// small or leaves the picture, or if the corner moves farther than `max_move_px`.
std::optional<Eigen::Vector2d> RefineCorner(const cv::Mat& grey, const Eigen::Vector2d& start_px, double reach_px,
                                            double max_move_px);

struct MeasuredCorner {
  Eigen::Vector2d pixel;
  Eigen::Matrix2d covariance_px2;
  double outlier_share = 0;  // The share of its grey values that show something else.
};

// How the map from a board into the image bends about one of its points beyond a homography: terms of x^2, x y and y^2
// (px by squared units of length), each give or take `sigma`.
struct MapCurvature {
  Eigen::Matrix<double, 2, 3> squares = Eigen::Matrix<double, 2, 3>::Zero();
  double sigma = 0;
};
// By the residuals of corners' homography: `offsets` are the corners' places about the point, in units of length.
// Nothing if there are too few.
std::optional<MapCurvature> BendOf(const std::vector<Eigen::Vector2d>& offsets,
                                   const std::vector<Eigen::Vector2d>& residuals_px);

// The corner at `at_m` of a board's drawing, near `start_px`, from the grey values of all that is drawn up to
// `half_m` away from it along x and y (what lies beyond belongs to the next corner: no grey value counts twice).
// Nothing where the picture does not show what is drawn. `image_from_board` tells how the board lies there,
// `curvature`, in units of `half_m`, what the corners around it know of the lens: an edge is then placed by all of its
// pixels together, where one that may curvature is placed by those in its middle.
std::optional<MeasuredCorner> MeasureCorner(const cv::Mat& grey, const Drawing& drawing, const Eigen::Vector2d& at_m,
                                            double half_m, const Eigen::Matrix3d& image_from_board,
                                            const Eigen::Vector2d& start_px,
                                            const std::optional<MapCurvature>& curvature = std::nullopt);

}  // namespace heba
