// The files of `heba camera`.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "heba/camera_calibration.h"
#include "tools/text/camera_text.h"

namespace heba {

// An image that is not part of the calibration has a reason.
struct UnusedImage {
  std::string image;
  std::string reason;
};

// Returns result.json with the schema heba/camera/1.
std::string CameraResultToJson(const std::string& name, const std::vector<std::pair<std::string, std::string>>& about,
                               const CameraCalibration& calibration, const CameraMap& map,
                               const std::vector<UnusedImage>& unused);

// Returns the names and the texts of the camera's files: heba's own, with sigmas, and those of other software that can
// hold its model.
std::vector<std::pair<std::string, std::string>> CameraFiles(const std::string& name,
                                                             const CameraCalibration& calibration);

}  // namespace heba
