// Renders a drawing as a camera sees it: geometrically exact, then degraded in known ways.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "heba/camera/camera.h"
#include "heba/data/target_shape.h"
#include "heba/drawing.h"
#include "heba/geometry/rigid3.h"

namespace heba {

enum class GreyDepth { k8Bit, k16Bit };

struct RenderOptions {
  // Sigma of the Gaussian blur, applied in addition to the pixel's own box. Values below 0.02 px count as 0.02 px.
  double blur_sigma_px = 0.7;
  // Samples the scene at the centre of each pixel only, without blur or pixel box, as renderers without anti-aliasing
  // do.
  bool is_point_sampled = false;
  double noise_sigma_grey = 0;  // Pixel noise; grey levels range from 0 to 255 at either depth.
  double black_grey = 30;       // Grey value of albedo 0.
  double white_grey = 220;      // Grey value of albedo 1.
  // Uneven light, as a share of the brightest: a slope in a random direction and a fall-off towards the corners,
  // which together take away at most this much. Must be in [0, 1).
  double light_gradient = 0;
  double background_albedo = 0.35;  // Albedo around the sheet if there is no clutter.
  bool clutter = false;             // Draws random shapes around the sheet.
  TargetShape shape;                // Shape of the sheet in space.
  GreyDepth depth = GreyDepth::k8Bit;
  uint64_t seed = 0;  // Seed of noise, light and clutter.
  // Returns the violated constraints, separated by semicolons, in the words of a scene's keys; empty if the options are
  // valid.
  [[nodiscard]] std::string Check() const;
};

// Renders an image. The value of a pixel is the integral of the scene over its box and the blur (or the scene at its
// centre, see is_point_sampled), followed by light, noise (clipped) and rounding; (0, 0) is the centre of the first
// pixel. The scene is the sheet, which is plain grey from behind, in front of the background; a pixel without a ray
// shows the background too. Edges are exact except for the border of the sheet in front of clutter, where the two are
// blurred separately. Returns CV_8UC1, or CV_16UC1 with 257 units per grey level. Equal inputs give equal bytes, on
// any thread. `options` and `camera` must be valid.
cv::Mat RenderView(const Drawing& drawing, const Camera& camera, const Rigid3d& camera_from_target,
                   const RenderOptions& options = {});

// A sheet in front of a camera.
struct RenderedSheet {
  const Drawing* drawing = nullptr;
  Rigid3d camera_from_target;
  TargetShape shape;
};

// Likewise for several sheets; nearer ones hide others. `options.shape` is not used. The sheets must not intersect.
cv::Mat RenderScene(const std::vector<RenderedSheet>& sheets, const Camera& camera, const RenderOptions& options = {});

}  // namespace heba
