// Files that hold a camera's parameters: heba's own and those of other software (camera_formats.def).
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "heba/camera/camera.h"
#include "heba/config/yaml_reader.h"

namespace heba {

// Reads a file of any form of camera_formats.def. The camera passes CheckCamera, but for one thing: OpenCV's files may
// have no image size; width_px and height_px are then 0, and the caller takes them from the images. InputError names
// the file and, where it is known, the line.
Camera ReadCameraFile(const std::filesystem::path& path);
// The same from text; `name` is what messages call it.
Camera ParseCameraFile(const std::string& text, const std::filesystem::path& name);

// One sigma of each parameter, as a file of heba's own form may have them under `std` (null or left out: nothing is
// known of it, infinite). Nothing if the file is of another form or has no `std`.
std::optional<std::vector<double>> ReadCameraSigmas(const std::filesystem::path& path);

// heba's own form: {model: brown5, image_size: [w, h], fx, fy, cx, cy, distortion: [...]}, plain numbers in px; a
// `std`, as result.json has it, is ReadCameraSigmas' to read. The camera passes CheckCamera.
Camera ReadCamera(const ConfigValue& value);
// The text of a file of that form. The camera must pass CheckCamera.
std::string CameraToYaml(const Camera& camera);

}  // namespace heba
