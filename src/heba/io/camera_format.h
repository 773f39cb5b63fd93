// The interface of a camera file format, and common functions of the formats.
#pragma once

#include <filesystem>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

#include "heba/base/error.h"
#include "heba/camera/camera.h"
#include "heba/config/yaml_reader.h"

namespace heba {

// The functions that a file in camera_formats/ provides.
struct CameraReader {
  // Returns whether a file appears to have this format; it may still be faulty.
  bool (*matches)(const std::string& text);
  // Returns the camera. InputErrors call the file `name`. The values are not yet checked (CheckCamera).
  Camera (*read)(const std::string& text, const std::filesystem::path& name);
  // Likewise, for a format that holds several cameras: returns the one called `camera`. Null for all others.
  Camera (*read_named)(const std::string& text, const std::filesystem::path& name, const std::string& camera) = nullptr;
};

struct CameraFormat {
  std::string_view name;
  std::string_view description;
  CameraReader reader;
};

// Returns all formats, in the order of camera_formats.def.
const std::vector<CameraFormat>& CameraFormats();

// Returns whether `key` occurs anywhere in `text` as a key, that is, quoted or not, before a colon.
bool HasKey(std::string_view text, std::string_view key);

// Returns the first mapping within `root`, itself included, that has one of `keys`; `root` if there is none.
ConfigValue MapWithAny(const ConfigValue& root, std::initializer_list<const char*> keys);

// Returns the numbers of a list.
std::vector<double> ReadNumbers(const ConfigValue& list);
// Returns the numbers of a matrix {rows, cols, data: [...]}, row by row, or of a plain list.
std::vector<double> ReadMatrix(const ConfigValue& value);

// Returns fx, fy, cx, cy of a camera matrix that is given row by row. Returns a Failure if it is not [fx 0 cx; 0 fy cy;
// 0 0 1].
Outcome<std::vector<double>> PinholeFromMatrix(const std::vector<double>& matrix);

// The kinds of lens that the distortion models of other software describe.
enum class Lens { kPolynomial, kFisheye };
// Returns a camera without image size from fx, fy, cx, cy and coefficients in OpenCV's order. Their number may be 0, 4,
// 5 or 8, or 12 or 14 if those after the eighth are zero; for a fisheye lens it must be 4. Returns a Failure for any
// other number.
Outcome<Camera> CameraFromCoefficients(const std::vector<double>& pinhole, const std::vector<double>& coefficients,
                                       Lens lens);

// Returns the lens that a ROS distortion model describes; a Failure that lists the known names if it is unknown.
Outcome<Lens> LensOfRosModel(const std::string& distortion_model);

}  // namespace heba
