// What a form of camera file is, and what the forms share.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "heba/base/error.h"
#include "heba/camera/camera.h"
#include "heba/config/yaml_reader.h"

namespace heba {

// What a file in camera_formats/ brings.
struct CameraReader {
  // Whether a file is meant to be of this form; it may still be faulty.
  bool (*matches)(const std::string& text);
  // The camera; InputErrors call the file `name`. Values are not yet checked (CheckCamera).
  Camera (*read)(const std::string& text, const std::filesystem::path& name);
};

struct CameraFormat {
  std::string_view name;
  std::string_view description;
  CameraReader reader;
};

// In the order of camera_formats.def.
const std::vector<CameraFormat>& CameraFormats();

// Whether `key` stands anywhere in `text` as a key, quoted or not, before a colon.
bool HasKey(std::string_view text, std::string_view key);

// The numbers of a list.
std::vector<double> ReadNumbers(const ConfigValue& list);
// The numbers of a matrix {rows, cols, data: [...]}, row by row, or of a plain list.
std::vector<double> ReadMatrix(const ConfigValue& value);

// fx, fy, cx, cy from a camera matrix, row by row. A Failure if it is not [fx 0 cx; 0 fy cy; 0 0 1].
Outcome<std::vector<double>> PinholeFromMatrix(const std::vector<double>& matrix);

// How a file names its distortion.
enum class Lens { kPolynomial, kFisheye };
// A camera without its image size from fx, fy, cx, cy and coefficients in OpenCV's order: none, 4, 5, 8, or 12 and 14
// if those after the eighth are zero; for a fisheye lens 4. A Failure for another number of them.
Outcome<Camera> CameraFromCoefficients(const std::vector<double>& pinhole, const std::vector<double>& coefficients,
                                       Lens lens);

// The lens of a ROS distortion model's name; a Failure that lists the names if it is unknown.
Outcome<Lens> LensOfRosModel(const std::string& distortion_model);

}  // namespace heba
