// The report of `heba camera`.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "heba/camera_calibration.h"
#include "tools/files/camera_result.h"
#include "tools/text/camera_text.h"

namespace heba {

// Returns the page: the lens with its sigmas, the map of the projection uncertainty, the models that were compared, and
// the images.
std::string CameraPage(const std::string& name, const CameraCalibration& calibration, const CameraMap& map,
                       const std::vector<UnusedImage>& unused);

}  // namespace heba
