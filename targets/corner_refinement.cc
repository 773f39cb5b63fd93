#include "targets/corner_refinement.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "targets/homography.h"
#include "targets/pattern_fit.h"

namespace heba {

std::optional<Eigen::Vector2d> RefineCorner(const cv::Mat& grey, const Eigen::Vector2d& start_px, double reach_px,
                                            double max_move_px) {
  constexpr int kMinHalfWindow_px = 2;
  constexpr int kMaxHalfWindow_px = 11;
  // The window is upright while the squares may be turned: its corners reach sqrt(2) times as far, but count for
  // little. The pixel is for the blur of the next edge.
  const int half_px = std::min(static_cast<int>(std::floor((reach_px - 1.0) / 1.2)), kMaxHalfWindow_px);
  if (half_px < kMinHalfWindow_px) return std::nullopt;
  const double border_px = half_px + 1.0;
  if (!(start_px.x() >= border_px && start_px.y() >= border_px && start_px.x() <= grey.cols - 1 - border_px &&
        start_px.y() <= grey.rows - 1 - border_px)) {
    return std::nullopt;
  }
  std::vector<cv::Point2f> corner{cv::Point2f(static_cast<float>(start_px.x()), static_cast<float>(start_px.y()))};
  cv::cornerSubPix(grey, corner, cv::Size(half_px, half_px), cv::Size(-1, -1),
                   cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 50, 1e-3));
  const Eigen::Vector2d refined_px(corner[0].x, corner[0].y);
  // cornerSubPix gives the start back if it ends outside of its window.
  if (!((refined_px - start_px).norm() <= max_move_px)) return std::nullopt;
  return refined_px;
}

std::optional<MeasuredCorner> MeasureCorner(const cv::Mat& grey, const Drawing& drawing, const Eigen::Vector2d& at_m,
                                            double half_m, const Eigen::Matrix3d& picture_from_board,
                                            const Eigen::Vector2d& start_px) {
  Eigen::Matrix3d shift = Eigen::Matrix3d::Identity();
  shift.topRightCorner<2, 1>() = start_px - Map(picture_from_board, at_m);
  const Eigen::Matrix3d start = shift * picture_from_board;
  // Larger windows gain little, cost time and see more of the lens.
  constexpr double kMaxHalfPx = 20;
  // Below, perspective and lens within the window are not to be seen.
  constexpr double kMinQuadraticPx = 8;
  double widest_px = 0;
  for (const Eigen::Vector2d& direction : {Eigen::Vector2d(1, 0), Eigen::Vector2d(0, 1)}) {
    widest_px = std::max(widest_px, (Map(start, at_m + half_m * direction) - start_px).norm());
  }
  const double share = std::min(1.0, kMaxHalfPx / widest_px);
  PatternFitOptions options;
  options.min_m = at_m - Eigen::Vector2d::Constant(share * half_m);
  options.max_m = at_m + Eigen::Vector2d::Constant(share * half_m);
  options.freedom = widest_px < kMinQuadraticPx ? MapFreedom::kAffine : MapFreedom::kQuadratic;
  // Edges just beyond the window blur into it.
  const CellPattern pattern =
      CellsOf(drawing, at_m - Eigen::Vector2d::Constant(2 * half_m), at_m + Eigen::Vector2d::Constant(2 * half_m));
  const std::optional<PatternFit> fit = FitPattern(grey, pattern, start, {at_m}, options);
  if (!fit) return std::nullopt;
  return MeasuredCorner{fit->pixels.front(), fit->covariance_px2};
}

}  // namespace heba
