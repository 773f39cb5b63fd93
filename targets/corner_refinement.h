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
};

// The corner at `at_m` of a board's drawing, near `start_px`, from the grey values of all that is drawn up to
// `half_m` away from it along x and y (what lies beyond belongs to the next corner: no grey value counts twice).
// Nothing where the picture does not show what is drawn. `picture_from_board` tells how the board lies there.
std::optional<MeasuredCorner> MeasureCorner(const cv::Mat& grey, const Drawing& drawing, const Eigen::Vector2d& at_m,
                                            double half_m, const Eigen::Matrix3d& picture_from_board,
                                            const Eigen::Vector2d& start_px);

}  // namespace heba
