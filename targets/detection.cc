#include "heba/detection.h"

#include <algorithm>

#include <opencv2/core.hpp>

#include "heba/base/error.h"
#include "heba/data/prediction.h"
#include "targets/images/image.h"

namespace heba {

CaptureDetection DetectCapture(const Target& target, const std::filesystem::path& image,
                               const std::optional<ImageSize>& expected) {
  const cv::Mat grey = ReadGreyImage(image, expected);
  // OpenCV's detectors draw random numbers; a fixed seed makes each image independent of the others.
  cv::theRNG() = cv::RNG(1);
  constexpr int kSmallWidthPx = 640;
  return {grey.cols, grey.rows, target.Detect(grey), 0, SmallJpeg(grey, kSmallWidthPx), ""};
}

std::optional<Eigen::Vector2d> PixelOf(const TargetPoint& point, const Camera& camera,
                                       const Rigid3d& camera_from_target) {
  Observations observation;
  observation.ids = {point.id};
  observation.points_in_target = point.in_target;
  observation.pixels = Points2::Zero(2, 1);
  observation.radii_m = Eigen::VectorXd::Constant(1, point.radius_m);
  Points2 pixels;
  if (!Predict(camera.Model(), camera.params.data(), camera_from_target, observation, &pixels, nullptr)) {
    return std::nullopt;
  }
  return pixels.col(0);
}

Observations ObservationsOf(const Target& target, const Detection& detection) {
  const std::vector<TargetPoint>& points = target.points();
  Observations observations;
  observations.ids = detection.ids;
  const Eigen::Index n = static_cast<Eigen::Index>(detection.ids.size());
  observations.points_in_target.resize(3, n);
  observations.pixels.resize(2, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const int id = detection.ids[static_cast<size_t>(i)];
    const auto found = std::lower_bound(points.begin(), points.end(), id,
                                        [](const TargetPoint& point, int wanted) { return point.id < wanted; });
    CHECK(found != points.end() && found->id == id) << "detected id " << id << " is not on the target";
    observations.points_in_target.col(i) = found->in_target;
    observations.pixels.col(i) = detection.pixels[static_cast<size_t>(i)];
    if (found->radius_m > 0) {
      if (observations.radii_m.size() == 0) observations.radii_m.setZero(n);
      observations.radii_m[i] = found->radius_m;
    }
  }
  observations.covariances_px2 = detection.covariances_px2;
  return observations;
}

Observations AllPoints(const Target& target) {
  Detection all;
  for (const TargetPoint& point : target.points()) {
    all.ids.push_back(point.id);
    all.pixels.emplace_back(0, 0);
  }
  return ObservationsOf(target, all);
}

}  // namespace heba
