#include "targets/render/overlay.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <opencv2/imgproc.hpp>

namespace heba {
namespace {

// The colours of the points of the first target, the second, and so on.
const std::array<cv::Scalar, 4> kPointColours = {cv::Scalar(0, 200, 0), cv::Scalar(255, 160, 0),
                                                 cv::Scalar(0, 220, 220), cv::Scalar(60, 60, 255)};
const cv::Scalar kCaptionColour(255, 255, 255);
const cv::Scalar kIdColour(0, 120, 255);
const cv::Scalar kResidualColour(255, 60, 200);

// OpenCV draws coordinates with `kShift` fractional bits.
constexpr int kShift = 4;
cv::Point SubPixel(const Eigen::Vector2d& pixel) {
  return {static_cast<int>(std::lround(pixel.x() * (1 << kShift))),
          static_cast<int>(std::lround(pixel.y() * (1 << kShift)))};
}

}  // namespace

cv::Mat DrawOverlay(const cv::Mat& grey, const std::vector<OverlayPoints>& targets) {
  cv::Mat image;
  cv::cvtColor(grey, image, cv::COLOR_GRAY2BGR);
  // Small images are enlarged so that the ids are legible.
  const double zoom = std::max(1.0, std::ceil(1200.0 / std::max(1, grey.cols)));
  if (zoom > 1) cv::resize(image, image, {}, zoom, zoom, cv::INTER_NEAREST);
  const double size = std::max(1.0, image.cols / 1600.0);
  const int thickness = std::max(1, static_cast<int>(std::lround(size)));
  // The centre of pixel (0, 0) lies in the middle of its zoom x zoom block.
  const auto place = [&](const Eigen::Vector2d& pixel) -> Eigen::Vector2d {
    return zoom * pixel + Eigen::Vector2d::Constant(0.5 * (zoom - 1));
  };
  const auto draw_points = [&](const OverlayPoints& target, const cv::Scalar& colour) {
    for (int i = 0; i < target.observations.size(); ++i) {
      const Eigen::Vector2d at = place(target.observations.pixels.col(i));
      const double arm = 6 * size;
      for (const Eigen::Vector2d& direction : {Eigen::Vector2d(arm, 0), Eigen::Vector2d(0, arm)}) {
        cv::line(image, SubPixel(at - direction), SubPixel(at + direction), colour, thickness, cv::LINE_AA, kShift);
      }
      if (target.residuals) {
        const Eigen::Vector2d end = at + zoom * target.magnification * target.residuals->col(i);
        cv::arrowedLine(image, SubPixel(at), SubPixel(end), kResidualColour, thickness, cv::LINE_AA, kShift, 0.2);
      }
      const cv::Point label(static_cast<int>(at.x() + 4 * size), static_cast<int>(at.y() - 4 * size));
      cv::putText(image, std::to_string(target.observations.ids[static_cast<size_t>(i)]), label,
                  cv::FONT_HERSHEY_SIMPLEX, 0.42 * size, kIdColour, thickness, cv::LINE_AA);
    }
  };
  const auto colour_of = [&](size_t target) { return kPointColours[target % kPointColours.size()]; };
  for (size_t t = 0; t < targets.size(); ++t) draw_points(targets[t], colour_of(t));
  for (size_t t = 0; t < targets.size(); ++t) {
    const cv::Point origin(static_cast<int>(10 * size), static_cast<int>(24 * size * static_cast<double>(t + 1)));
    cv::putText(image, targets[t].caption, origin, cv::FONT_HERSHEY_SIMPLEX, 0.6 * size, cv::Scalar(0, 0, 0),
                4 * thickness, cv::LINE_AA);
    cv::putText(image, targets[t].caption, origin, cv::FONT_HERSHEY_SIMPLEX, 0.6 * size,
                targets.size() > 1 ? colour_of(t) : kCaptionColour, thickness, cv::LINE_AA);
  }
  return image;
}

}  // namespace heba
