#include "tools/cli/pixel_flag.h"

#include <vector>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "tools/cli/flags.h"

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

std::optional<Plane> PlaneOfFlag() {
  if (FLAGS_plane == "target") return std::nullopt;
  const std::vector<std::string> fields = Split(FLAGS_plane, ',');
  Plane plane;
  bool are_numbers = fields.size() == 4;
  for (size_t i = 0; i < 3 && are_numbers; ++i) {
    are_numbers = ParseDouble(Trim(fields[i]), &plane.normal[static_cast<Eigen::Index>(i)]);
  }
  const bool is_direction = are_numbers && plane.normal.allFinite() && plane.normal.norm() > 1e-6;
  if (!is_direction) {
    throw InputError("--plane: " + Quoted(FLAGS_plane) +
                     " is not a plane; a normal in the base, or in the world of a rig, and the distance along it are "
                     "needed, such as 0,0,1,120 mm, or "
                     "target" +
                     DidYouMean(FLAGS_plane, {"target"}));
  }
  plane.normal.normalize();
  const ParsedQuantity distance = ParseQuantity(Trim(fields[3]), Quantity::kLength);
  if (!distance.fault.empty()) throw InputError("--plane: " + distance.fault);
  plane.distance_m = distance.value;
  return plane;
}

}  // namespace heba
