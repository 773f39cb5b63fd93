// Creates targets from text, and compares detections in rendered images with the truth.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "heba/base/rng.h"
#include "heba/camera/camera.h"
#include "heba/detection.h"
#include "heba/geometry/rigid3.h"
#include "heba/target.h"
#include "targets/render/rendering.h"

namespace heba {

std::unique_ptr<Target> MakeTarget(const std::string& yaml);

// Returns a camera with some distortion, because a target's own geometry must not rely on straight lines.
Camera ImageCamera();

// Returns a pose with the middle of the sheet near the optical axis and its front towards the camera, tilted by 0.3
// to 1 of `max_tilt_rad` and rolled by up to `max_roll_rad`, so that the sheet takes about `share` of the image
// height.
Rigid3d RandomView(const Drawing& drawing, double share, double max_tilt_rad, double max_roll_rad, Rng& rng);

struct DetectionErrors {
  size_t num_found = 0;
  size_t num_unknown_ids = 0;  // Ids that do not belong to the target, or are repeated.
  Eigen::Vector2d sum_px = Eigen::Vector2d::Zero();
  double sum_squares_px2 = 0;
  double max_px = 0;

  double BiasPx() const { return num_found == 0 ? 0 : (sum_px / static_cast<double>(num_found)).norm(); }
  // Returns the RMS of the distances.
  double RmsPx() const { return num_found == 0 ? 0 : std::sqrt(sum_squares_px2 / static_cast<double>(num_found)); }
  void Add(const DetectionErrors& other) {
    num_found += other.num_found;
    num_unknown_ids += other.num_unknown_ids;
    sum_px += other.sum_px;
    sum_squares_px2 += other.sum_squares_px2;
    max_px = std::max(max_px, other.max_px);
  }
};

// Returns the differences between `detection` and the projected points. If the target has symmetries, the best one is
// used.
DetectionErrors ErrorsOf(const Target& target, const Camera& camera, const Rigid3d& camera_from_target,
                         const Detection& detection);

// Returns the errors in `num_views` rendered views.
DetectionErrors DetectRendered(const Target& target, int num_views, double share, uint64_t seed, double noise_grey = 2);

}  // namespace heba
