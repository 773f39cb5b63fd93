// The result of `heba camera` in words.
#pragma once

#include <string>

#include "heba/camera_calibration.h"

namespace heba {

// The projection uncertainty over the image, and the images' share of it.
struct CameraMap {
  int columns = 0;
  int rows = 0;
  std::vector<double> sigmas_px;  // ProjectionSigmasPx.
  std::vector<int> num_points;    // In each of these places of the image, row by row.
};

// Returns the table of the models, the intrinsics with their sigmas, and how well the projection is known.
std::string CameraTable(const CameraCalibration& calibration, const CameraMap& map);

// Returns the intrinsics with their sigmas, a line each.
std::string IntrinsicsLines(const CameraCalibration& calibration);
// Returns a sentence about the projection uncertainty and about the part of the image that no point was seen in.
std::string ProjectionText(const CameraMap& map);

}  // namespace heba
