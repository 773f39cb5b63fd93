#include "heba/io/camera_format.h"

#include <algorithm>
#include <cctype>

#include "heba/base/registry.h"
#include "heba/base/text.h"

namespace heba {

#define HEBA_CAMERA_FORMAT(name, description) CameraReader CameraReader_##name();
#include "heba/io/camera_formats.def"
#undef HEBA_CAMERA_FORMAT

const std::vector<CameraFormat>& CameraFormats() {
  static const std::vector<CameraFormat> formats = {
#define HEBA_CAMERA_FORMAT(name, description) {#name, description, CameraReader_##name()},
#include "heba/io/camera_formats.def"
#undef HEBA_CAMERA_FORMAT
  };
  return formats;
}

namespace {

std::optional<ConfigValue> FindMapWithAny(const ConfigValue& value, std::initializer_list<const char*> keys,
                                          int depth) {
  constexpr int kDeepest = 6;
  if (!value.IsMap() || depth > kDeepest) return std::nullopt;
  MapReader reader(value);
  for (const char* const key : keys) {
    if (reader.Has(key)) return value;
  }
  for (const auto& entry : value.node()) {
    if (!entry.first.IsScalar()) continue;
    const ConfigValue member(entry.second, value.file(), entry.first.Scalar());
    if (std::optional<ConfigValue> found = FindMapWithAny(member, keys, depth + 1)) return found;
  }
  return std::nullopt;
}

}  // namespace

bool HasKey(std::string_view text, std::string_view key) {
  const auto in_name = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '.'; };
  for (size_t at = text.find(key); at != std::string_view::npos; at = text.find(key, at + 1)) {
    if (at > 0 && in_name(text[at - 1])) continue;
    size_t end = at + key.size();
    if (end < text.size() && (text[end] == '"' || text[end] == '\'')) ++end;
    while (end < text.size() && (text[end] == ' ' || text[end] == '\t')) ++end;
    if (end < text.size() && text[end] == ':') return true;
  }
  return false;
}

ConfigValue MapWithAny(const ConfigValue& root, std::initializer_list<const char*> keys) {
  const std::optional<ConfigValue> found = FindMapWithAny(root, keys, 0);
  return found ? *found : root;
}

std::vector<double> ReadNumbers(const ConfigValue& list) {
  std::vector<double> numbers;
  for (const ConfigValue& item : list.AsList()) numbers.push_back(item.AsNumber());
  return numbers;
}

std::vector<double> ReadMatrix(const ConfigValue& value) {
  if (value.IsList()) return ReadNumbers(value);
  MapReader reader(value);
  constexpr IntRange kSizes = {0, 1000};
  const int rows = reader.Int("rows", kSizes);
  const int cols = reader.Int("cols", kSizes);
  const ConfigValue data = reader.Get("data");
  std::vector<double> numbers = ReadNumbers(data);
  if (static_cast<int>(numbers.size()) != rows * cols) {
    data.Fail(std::to_string(numbers.size()) + " numbers, but a matrix of " + std::to_string(rows) + " x " +
              std::to_string(cols) + " has " + std::to_string(rows * cols));
  }
  return numbers;
}

Outcome<std::vector<double>> PinholeFromMatrix(const std::vector<double>& matrix) {
  if (matrix.size() != 9) {
    return Failure{"a camera matrix has 3 x 3 numbers, not " + std::to_string(matrix.size())};
  }
  if (matrix[1] != 0) return Failure{"the camera matrix has a skew of " + RoundTrip(matrix[1]) + "; heba needs 0"};
  if (matrix[3] != 0 || matrix[6] != 0 || matrix[7] != 0 || matrix[8] != 1) {
    return Failure{"the camera matrix is not [fx 0 cx; 0 fy cy; 0 0 1], row by row"};
  }
  return std::vector<double>{matrix[0], matrix[4], matrix[2], matrix[5]};
}

Outcome<Camera> CameraFromCoefficients(const std::vector<double>& pinhole, const std::vector<double>& coefficients,
                                       Lens lens) {
  CHECK_EQ(pinhole.size(), 4u);
  Camera camera;
  camera.params = pinhole;
  camera.params.insert(camera.params.end(), coefficients.begin(), coefficients.end());
  const size_t count = coefficients.size();
  if (lens == Lens::kFisheye) {
    if (count != 4) return Failure{std::to_string(count) + " coefficients; a fisheye lens has 4"};
    camera.model = "kannala_brandt4";
    return camera;
  }
  if (count == 0) {
    camera.model = "pinhole";
  } else if (count == 4 || count == 5) {
    camera.model = "brown5";
    camera.params.resize(9, 0.0);
  } else if (count == 8 || count == 12 || count == 14) {
    if (std::any_of(coefficients.begin() + 8, coefficients.end(), [](double c) { return c != 0; })) {
      return Failure{"the coefficients after the eighth (thin prism, tilt) are not zero; heba does not support them"};
    }
    camera.model = "rational8";
    camera.params.resize(12);
  } else {
    return Failure{std::to_string(count) + " coefficients; 0, 4, 5 or 8 are possible"};
  }
  return camera;
}

Outcome<Lens> LensOfRosModel(const std::string& distortion_model) {
  if (distortion_model == "plumb_bob" || distortion_model == "rational_polynomial") return Lens::kPolynomial;
  if (distortion_model == "equidistant") return Lens::kFisheye;
  return Failure{"distortion model " +
                 UnknownName(distortion_model, {"plumb_bob", "rational_polynomial", "equidistant"})};
}

}  // namespace heba
