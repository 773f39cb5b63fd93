#include "tools/cli/pixel_flag.h"

#include <vector>

#include "heba/base/error.h"
#include "heba/base/text.h"

namespace heba {

Eigen::Vector2d PixelOfFlag(const std::string& text, const std::string& form) {
  const std::vector<std::string> fields = Split(text, ',');
  Eigen::Vector2d pixel;
  if (fields.size() != 2 || !ParseDouble(Trim(fields[0]), &pixel.x()) || !ParseDouble(Trim(fields[1]), &pixel.y()) ||
      !pixel.allFinite()) {
    throw InputError("--pixels: " + Quoted(Trim(text)) + " is not a pixel; " + form);
  }
  return pixel;
}

void CheckPixelInImage(const Eigen::Vector2d& pixel, const Camera& camera, const std::string& name) {
  if (pixel.minCoeff() >= -0.5 && pixel.x() <= camera.width_px - 0.5 && pixel.y() <= camera.height_px - 0.5) return;
  throw InputError("--pixels: " + Significant(pixel.x(), 6) + "," + Significant(pixel.y(), 6) +
                   " is outside the image of " + (name.empty() ? "" : "camera " + name + ", ") +
                   std::to_string(camera.width_px) + " x " + std::to_string(camera.height_px) + " px");
}

}  // namespace heba
