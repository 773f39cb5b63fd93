#include "targets/corner_refinement.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

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

std::optional<Eigen::Matrix3d> FitHomography(const std::vector<Eigen::Vector2d>& from,
                                             const std::vector<Eigen::Vector2d>& to) {
  std::vector<cv::Point2d> from_cv;
  std::vector<cv::Point2d> to_cv;
  for (const Eigen::Vector2d& point : from) from_cv.emplace_back(point.x(), point.y());
  for (const Eigen::Vector2d& point : to) to_cv.emplace_back(point.x(), point.y());
  const cv::Mat fitted = cv::findHomography(from_cv, to_cv, 0);
  if (fitted.empty()) return std::nullopt;
  Eigen::Matrix3d homography;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) homography(row, column) = fitted.at<double>(row, column);
  }
  if (!homography.allFinite()) return std::nullopt;
  return homography;
}

Eigen::Vector2d Map(const Eigen::Matrix3d& homography, const Eigen::Vector2d& point) {
  return (homography * point.homogeneous()).hnormalized();
}

}  // namespace heba
