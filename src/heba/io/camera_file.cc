#include "heba/io/camera_file.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/config/yaml_reader.h"
#include "heba/io/camera_format.h"

namespace heba {

Camera ParseCameraFile(const std::string& text, const std::filesystem::path& name, const std::string& camera_name) {
  std::vector<std::string> descriptions;
  for (const CameraFormat& format : CameraFormats()) {
    descriptions.emplace_back(format.description);
    if (!format.reader.matches(text)) continue;
    if (!camera_name.empty() && format.reader.read_named == nullptr) {
      throw InputError(name.string() + ": contains one camera without a name, so that none is called " +
                       Quoted(camera_name));
    }
    Camera camera =
        camera_name.empty() ? format.reader.read(text, name) : format.reader.read_named(text, name, camera_name);
    Camera checked = camera;
    if (camera.width_px == 0 && camera.height_px == 0) checked.width_px = checked.height_px = 1;
    std::string faults = CheckCamera(checked);
    std::replace(faults.begin(), faults.end(), '\n', ';');
    if (!faults.empty()) throw InputError(name.string() + ": " + faults);
    return camera;
  }
  throw InputError(name.string() +
                   ": contains no camera in a format that heba reads; one of: " + Join(descriptions, "; "));
}

Camera ReadCameraFile(const std::filesystem::path& path, const std::string& camera) {
  return ParseCameraFile(ReadTextFile(path), path, camera);
}

Camera ReadCamera(const ConfigValue& value) {
  MapReader reader(value);
  Camera camera;
  camera.model = reader.Choice("model", CameraModelNames());
  const ConfigValue size = reader.Get("image_size");
  const std::vector<ConfigValue> sizes = size.AsList();
  if (sizes.size() != 2) size.Fail("two whole numbers are needed: [width, height]");
  constexpr IntRange kSizes = {1, 100000};
  camera.width_px = sizes[0].AsInt(kSizes);
  camera.height_px = sizes[1].AsInt(kSizes);
  const std::vector<std::string>& names = camera.Model().param_names();
  for (size_t i = 0; i < 4; ++i) camera.params.push_back(reader.Number(names[i]));
  const size_t num_distortion = names.size() - 4;
  std::optional<ConfigValue> distortion = reader.Find("distortion");
  // The list may be missing if the model has no distortion.
  if (!distortion && num_distortion > 0) distortion = reader.Get("distortion");
  if (distortion) {
    const std::vector<double> coefficients = ReadNumbers(*distortion);
    if (coefficients.size() != num_distortion) {
      const std::vector<std::string> needed(names.begin() + 4, names.end());
      distortion->Fail(std::to_string(coefficients.size()) + " coefficients; " + camera.model + " has " +
                       std::to_string(num_distortion) + (needed.empty() ? "" : ": " + Join(needed, ", ")));
    }
    camera.params.insert(camera.params.end(), coefficients.begin(), coefficients.end());
  }
  reader.Has("std");
  reader.Finish();
  std::string faults = CheckCamera(camera);
  std::replace(faults.begin(), faults.end(), '\n', ';');
  if (!faults.empty()) value.Fail(faults);
  return camera;
}

std::optional<CameraSigmas> ReadCameraSigmas(const std::filesystem::path& path) {
  const std::string text = ReadTextFile(path);
  const CameraFormat* own = nullptr;
  for (const CameraFormat& format : CameraFormats()) {
    if (own == nullptr && format.reader.matches(text)) own = &format;
  }
  if (own == nullptr || own->name != "native") return std::nullopt;
  const Camera camera = ParseCameraFile(text, path);
  MapReader reader(ParseYaml(text, path));
  const std::optional<ConfigValue> std_value = reader.Find("std");
  if (!std_value || std_value->node().IsNull()) return std::nullopt;
  MapReader std_reader(*std_value);
  const auto sigma_of = [](const ConfigValue& value) {
    if (value.node().IsNull()) return std::numeric_limits<double>::infinity();
    const double sigma = value.AsNumber();
    if (!(sigma > 0)) value.Fail("a sigma greater than zero is needed");
    return sigma;
  };
  const std::vector<std::string>& names = camera.Model().param_names();
  std::vector<double> sigmas(names.size(), std::numeric_limits<double>::infinity());
  for (size_t i = 0; i < 4; ++i) {
    if (const std::optional<ConfigValue> value = std_reader.Find(names[i])) sigmas[i] = sigma_of(*value);
  }
  if (const std::optional<ConfigValue> distortion = std_reader.Find("distortion")) {
    const std::vector<ConfigValue> values = distortion->AsList();
    if (values.size() != names.size() - 4) {
      distortion->Fail(std::to_string(values.size()) + " sigmas for " + std::to_string(names.size() - 4) +
                       " coefficients");
    }
    for (size_t i = 0; i < values.size(); ++i) sigmas[4 + i] = sigma_of(values[i]);
  }
  std_reader.Finish();
  return CameraSigmas{names, std::move(sigmas)};
}

std::string CameraToYaml(const Camera& camera) {
  CHECK_EQ(CheckCamera(camera), "");
  std::string text = "model: " + camera.model + "\nimage_size: [" + std::to_string(camera.width_px) + ", " +
                     std::to_string(camera.height_px) + "]\n";
  const std::vector<std::string>& names = camera.Model().param_names();
  for (size_t i = 0; i < 4; ++i) text += names[i] + ": " + RoundTrip(camera.params[i]) + "\n";
  std::vector<std::string> coefficients;
  for (size_t i = 4; i < camera.params.size(); ++i) coefficients.push_back(RoundTrip(camera.params[i]));
  return text + "distortion: [" + Join(coefficients, ", ") + "]\n";
}

}  // namespace heba
