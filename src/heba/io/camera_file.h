// Files that contain the parameters of a camera: heba's own format and those of other software (camera_formats.def).
//
//   const heba::Camera camera = heba::ReadCameraFile("camera_info.yaml");
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "heba/camera/camera.h"

namespace heba {

class ConfigValue;

// Reads a file in any format of camera_formats.def. The camera passes CheckCamera with one exception: OpenCV's files
// may lack an image size; width_px and height_px are then 0, and the caller takes them from the images. Throws
// InputError with the file and, if it is known, the line. `camera` is the name of the camera that is meant in a file of
// several (cam1 in Kalibr's camchain); it may be empty if the file has one camera only, and must be if the format gives
// its camera no name.
Camera ReadCameraFile(const std::filesystem::path& path, const std::string& camera = "");
// Parses text; `name` is the name of the file in messages.
Camera ParseCameraFile(const std::string& text, const std::filesystem::path& name, const std::string& camera = "");

// One sigma of each parameter of a camera, by its name.
struct CameraSigmas {
  std::vector<std::string> names;  // CameraModel::param_names.
  std::vector<double> sigmas;
};
// Returns the sigmas that a file in heba's own format may contain under `std`. A sigma that is null or missing is
// infinite: the parameter is unknown. Returns nothing if the file has another format or no `std`.
std::optional<CameraSigmas> ReadCameraSigmas(const std::filesystem::path& path);

// Reads a camera in heba's own format: {model: brown5, image_size: [w, h], fx, fy, cx, cy, distortion: [...]}, plain
// numbers in px. An entry `std`, as result.json has it, is accepted but ignored; ReadCameraSigmas reads it. The camera
// passes CheckCamera.
Camera ReadCamera(const ConfigValue& value);
// Returns the text of a file in this format. The camera must pass CheckCamera.
std::string CameraToYaml(const Camera& camera);

}  // namespace heba
