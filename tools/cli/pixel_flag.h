// Reads pixels, and the plane that they show, from the command line.
#pragma once

#include <optional>
#include <string>

#include <Eigen/Core>

#include "heba/camera/camera.h"
#include "heba/location_types.h"

namespace heba {

// Returns the pixel that `text`, a part of --pixels, gives as "u,v" in px. Throws InputError, which ends with `form`,
// if it is malformed.
Eigen::Vector2d PixelOfFlag(const std::string& text, const std::string& form);
// Throws InputError, which names the camera if `name` is not empty, unless the pixel is in the camera's image.
void CheckPixelInImage(const Eigen::Vector2d& pixel, const Camera& camera, const std::string& name = "");

// Returns the plane that --plane gives, "nx, ny, nz, 120 mm"; nothing for "target". Throws InputError if it is
// malformed.
std::optional<Plane> PlaneOfFlag();

}  // namespace heba
