// The config of `heba camera`: images of a target, without a robot.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "heba/camera_calibration.h"
#include "heba/target.h"

namespace heba {

struct CameraConfig {
  std::filesystem::path file;
  std::string name;
  std::vector<std::pair<std::string, std::string>> about;
  std::shared_ptr<const Target> target;
  std::string target_used;  // The target with every default filled in, as YAML.
  std::vector<std::filesystem::path> images;
  CameraCalibrationOptions options;  // Without the size of the images and the shape of the target.
  std::filesystem::path output;
  std::string used;  // The config as used, with every default filled in.
};

// Reads name, about, target, camera.model, captures.images and exclude, refine.target_shape and loss, evaluate.folds
// and output. The config of a run with one camera serves, too: its robot is not used. Throws InputError on any error.
CameraConfig ReadCameraConfig(const std::filesystem::path& path, const std::vector<std::string>& settings = {});

}  // namespace heba
