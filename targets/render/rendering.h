// Pictures of a drawing as a camera sees it: exact in geometry, then degraded in known ways.
#pragma once

#include <cstdint>
#include <string>

#include <opencv2/core/mat.hpp>

#include "heba/camera/camera.h"
#include "heba/data/target_shape.h"
#include "heba/geometry/rigid3.h"
#include "targets/drawing.h"

namespace heba {

enum class GreyDepth { k8Bit, k16Bit };

struct RenderOptions {
  // Gaussian, beside the pixel's own box. Less than 0.02 px counts as 0.02 px.
  double blur_sigma_px = 0.7;
  // The scene at each pixel's centre alone, without blur or pixel box, as renderers without anti-aliasing draw it.
  bool is_point_sampled = false;
  double noise_sigma_grey = 0;  // Grey levels are of 255, at either depth.
  double black_grey = 30;       // Of albedo 0.
  double white_grey = 220;      // Of albedo 1.
  // Uneven light, as a share of the brightest: a slope in a random direction and a fall towards the corners, which take
  // away this much together. In [0, 1).
  double light_gradient = 0;
  double background_albedo = 0.35;  // Around the sheet, without clutter.
  bool clutter = false;             // Random shapes around the sheet.
  TargetShape shape;                // Of the sheet in space.
  GreyDepth depth = GreyDepth::k8Bit;
  uint64_t seed = 0;  // Of noise, light and clutter.
  // Every violated constraint, one a line; empty if the options are valid.
  [[nodiscard]] std::string Check() const;
};

// A pixel is the integral of the scene over its box and the blur, (0, 0) being the centre of the first one (or the
// scene at that centre, see is_point_sampled); then come light, noise (clipped) and rounding. The scene is the sheet,
// plain grey from behind, before the background, which also shows where a pixel has no ray. Edges are exact but for
// that of the sheet before clutter: there the two are blurred apart. CV_8UC1, or CV_16UC1 with 257 units a grey level.
// The same inputs give the same bytes, on any thread. `options` and `camera` must be valid.
cv::Mat RenderView(const Drawing& drawing, const Camera& camera, const Rigid3d& camera_from_target,
                   const RenderOptions& options = {});

}  // namespace heba
