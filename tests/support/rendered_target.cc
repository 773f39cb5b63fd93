#include "tests/support/rendered_target.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "heba/base/units.h"

namespace heba {

std::unique_ptr<Target> MakeTarget(const std::string& yaml) { return ParseTarget(yaml); }

Camera ImageCamera() { return {"brown5", 1000, 800, {900, 905, 502.3, 398.6, -0.1, 0.03, 1e-3, -5e-4, 0}}; }

Rigid3d RandomView(const Drawing& drawing, double share, double max_tilt_rad, double max_roll_rad, Rng& rng) {
  const Camera camera = ImageCamera();
  const Eigen::Vector2d middle_m = 0.5 * (drawing.min_m + drawing.max_m);
  const Eigen::Quaterniond front =
      drawing.y_up ? ExpRotation(kPi * Eigen::Vector3d::UnitX()) : Eigen::Quaterniond::Identity();
  const double towards_rad = rng.Uniform(-kPi, kPi);
  const double tilt_rad = rng.Uniform(0.3, 1) * max_tilt_rad;
  const Eigen::Quaterniond rotation =
      ExpRotation(tilt_rad * Eigen::Vector3d(std::cos(towards_rad), std::sin(towards_rad), 0)) *
      ExpRotation(rng.Uniform(-max_roll_rad, max_roll_rad) * Eigen::Vector3d::UnitZ()) * front;
  const double distance_m =
      camera.params[0] * (drawing.max_m - drawing.min_m).norm() / (1.3 * share * camera.height_px);
  const double right_m = rng.Uniform(-0.03, 0.03) * distance_m;
  const double down_m = rng.Uniform(-0.03, 0.03) * distance_m;
  const Eigen::Vector3d place_m(right_m, down_m, distance_m);
  return {rotation, place_m - rotation * Eigen::Vector3d(middle_m.x(), middle_m.y(), 0)};
}

DetectionErrors ErrorsOf(const Target& target, const Camera& camera, const Rigid3d& camera_from_target,
                         const Detection& detection) {
  DetectionErrors best;
  best.sum_squares_px2 = std::numeric_limits<double>::infinity();
  for (const Rigid3d& target_from_target : target.Symmetries()) {
    DetectionErrors errors;
    std::set<int> seen;
    for (size_t i = 0; i < detection.ids.size(); ++i) {
      const auto point = std::find_if(target.points().begin(), target.points().end(),
                                      [&](const TargetPoint& candidate) { return candidate.id == detection.ids[i]; });
      if (point == target.points().end() || !seen.insert(detection.ids[i]).second) {
        ++errors.num_unknown_ids;
        continue;
      }
      const Eigen::Vector2d error_px =
          detection.pixels[i] - PixelOf(*point, camera, camera_from_target * target_from_target).value();
      ++errors.num_found;
      errors.sum_px += error_px;
      errors.sum_squares_px2 += error_px.squaredNorm();
      errors.max_px = std::max(errors.max_px, error_px.norm());
    }
    if (errors.sum_squares_px2 < best.sum_squares_px2) best = errors;
  }
  return best;
}

DetectionErrors DetectRendered(const Target& target, int num_views, double share, uint64_t seed, double noise_grey) {
  const Camera camera = ImageCamera();
  const Drawing& drawing = target.Draw();
  DetectionErrors total;
  for (int view = 0; view < num_views; ++view) {
    Rng rng(seed, static_cast<uint64_t>(view));
    const Rigid3d camera_from_target = RandomView(drawing, share, /*max_tilt_rad=*/0.7, /*max_roll_rad=*/0.6, rng);
    RenderOptions options;
    options.noise_sigma_grey = noise_grey;
    options.seed = seed + static_cast<uint64_t>(view);
    const Detection detection = target.Detect(RenderView(drawing, camera, camera_from_target, options));
    total.Add(ErrorsOf(target, camera, camera_from_target, detection));
  }
  return total;
}

}  // namespace heba
