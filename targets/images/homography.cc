#include "targets/images/homography.h"

#include <Eigen/Geometry>
#include <opencv2/calib3d.hpp>

namespace heba {

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

Eigen::Vector2d ApplyHomography(const Eigen::Matrix3d& homography, const Eigen::Vector2d& point) {
  return (homography * point.homogeneous()).hnormalized();
}

}  // namespace heba
