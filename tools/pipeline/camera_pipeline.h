// Runs `heba camera`: from the images of its config to the folder with its files.
#pragma once

#include <filesystem>

#include "heba/base/error.h"
#include "heba/camera_calibration.h"
#include "tools/config/camera_config.h"
#include "tools/text/camera_text.h"
#include "tools/text/console.h"

namespace heba {

struct CalibratedCamera {
  CameraCalibration calibration;
  CameraMap map;
};

// Calibrates the camera and writes the folder: result.json, report.html, detections.json, config.yaml, log.txt and the
// camera's files. Returns a Failure if the images do not determine the camera. Throws InputError if an image cannot be
// read or the folder cannot be written.
Outcome<CalibratedCamera> RunCamera(const CameraConfig& config, const std::filesystem::path& output, int num_threads,
                                    Console* console);

}  // namespace heba
