#include "targets/corners/corner_refinement.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>
#include <opencv2/imgproc.hpp>

#include "heba/geometry/homography.h"
#include "targets/corners/pattern_fit.h"

namespace heba {

std::optional<Eigen::Vector2d> RefineCorner(const cv::Mat& grey, const Eigen::Vector2d& start_px, double reach_px,
                                            double max_move_px) {
  constexpr int kMinHalfWindow_px = 2;
  constexpr int kMaxHalfWindow_px = 11;
  // The window is axis-aligned, while the squares may be rotated: its corners reach sqrt(2) times as far, but have
  // little weight. One pixel is subtracted for the blur of the next edge.
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
  // cornerSubPix returns the start if it ends outside its window.
  if (!((refined_px - start_px).norm() <= max_move_px)) return std::nullopt;
  return refined_px;
}

std::optional<MapCurvature> BendOf(const std::vector<Eigen::Vector2d>& offsets,
                                   const std::vector<Eigen::Vector2d>& residuals_px) {
  constexpr Eigen::Index kNumTerms = 6;
  constexpr double kNumHomography = 8;
  // The sigma of a corner that is not measured yet.
  constexpr double kCornerSigmaPx = 0.03;
  // The assumed ratio of third-order terms, which are not modelled, to the curvature.
  constexpr double kThirdOrder = 0.2;
  const auto num_corners = static_cast<Eigen::Index>(offsets.size());
  const double dof = 2.0 * static_cast<double>(num_corners - 3) - kNumHomography;
  if (dof <= 0) return std::nullopt;
  Eigen::MatrixXd terms(num_corners, kNumTerms);
  Eigen::MatrixX2d residuals(num_corners, 2);
  for (Eigen::Index k = 0; k < num_corners; ++k) {
    const Eigen::Vector2d& at = offsets[static_cast<size_t>(k)];
    terms.row(k) << 1, at.x(), at.y(), at.x() * at.x(), at.x() * at.y(), at.y() * at.y();
    residuals.row(k) = residuals_px[static_cast<size_t>(k)].transpose();
  }
  const Eigen::Matrix<double, kNumTerms, kNumTerms> covariance = (terms.transpose() * terms).inverse();
  const Eigen::Matrix<double, kNumTerms, 2> solution = covariance * (terms.transpose() * residuals);
  MapCurvature curvature;
  curvature.squares = solution.bottomRows<3>().transpose();
  const double variance_px2 = kCornerSigmaPx * kCornerSigmaPx + (residuals - terms * solution).squaredNorm() / dof;
  curvature.sigma = std::sqrt(variance_px2 * covariance.diagonal().tail<3>().maxCoeff() +
                              std::pow(kThirdOrder * curvature.squares.cwiseAbs().maxCoeff(), 2));
  if (!std::isfinite(curvature.sigma)) return std::nullopt;
  return curvature;
}

std::optional<MeasuredCorner> MeasureCorner(const cv::Mat& grey, const Drawing& drawing, const Eigen::Vector2d& at_m,
                                            double half_m, const Eigen::Matrix3d& image_from_board,
                                            const Eigen::Vector2d& start_px,
                                            const std::optional<MapCurvature>& curvature) {
  Eigen::Matrix3d shift = Eigen::Matrix3d::Identity();
  shift.topRightCorner<2, 1>() = start_px - ApplyHomography(image_from_board, at_m);
  const Eigen::Matrix3d start = shift * image_from_board;
  // Larger windows gain little, take more time and include more lens distortion.
  constexpr double kMaxHalfPx = 20;
  // Perspective and lens distortion are not visible within windows smaller than this.
  constexpr double kMinQuadraticPx = 8;
  double widest_px = 0;
  for (const Eigen::Vector2d& direction : {Eigen::Vector2d(1, 0), Eigen::Vector2d(0, 1)}) {
    widest_px = std::max(widest_px, (ApplyHomography(start, at_m + half_m * direction) - start_px).norm());
  }
  const double share = std::min(1.0, kMaxHalfPx / widest_px);
  PatternFitOptions options;
  options.min_m = at_m - Eigen::Vector2d::Constant(share * half_m);
  options.max_m = at_m + Eigen::Vector2d::Constant(share * half_m);
  options.freedom = widest_px < kMinQuadraticPx ? MapFreedom::kAffine : MapFreedom::kQuadratic;
  if (curvature) {
    options.squares_px = share * share * curvature->squares;
    options.squares_sigma_px = share * share * curvature->sigma;
  }
  // Edges just outside the window blur into it.
  const CellPattern pattern =
      CellsOf(drawing, at_m - Eigen::Vector2d::Constant(2 * half_m), at_m + Eigen::Vector2d::Constant(2 * half_m));
  const std::optional<PatternFit> fit = FitPattern(grey, pattern, start, {at_m}, options);
  if (!fit) return std::nullopt;
  return MeasuredCorner{fit->pixels.front(), fit->covariance_px2, fit->outlier_share};
}

}  // namespace heba
