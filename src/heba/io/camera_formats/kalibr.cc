// Kalibr's camchain of one camera: camera_model pinhole with distortion_model none, radtan (k1 k2 p1 p2) or
// equidistant, and the models that name themselves in Kalibr's terms (CameraModelFacts::kalibr). More than one camera
// is an error, because the file does not state which one is meant.
#include <algorithm>

#include "heba/base/text.h"
#include "heba/io/camera_format.h"

namespace heba {
namespace {

bool Matches(const std::string& text) { return HasKey(text, "distortion_coeffs") && HasKey(text, "intrinsics"); }

// The camera's part of a file.
struct Entry {
  std::string camera_model;
  std::string distortion_model;
  ConfigValue intrinsics;
  ConfigValue distortion_coeffs;
  std::vector<double> coefficients;
};

Camera ReadPinhole(const Entry& entry) {
  const std::vector<double> pinhole = ReadNumbers(entry.intrinsics);
  if (pinhole.size() != 4) entry.intrinsics.Fail("four numbers are needed: [fu, fv, cu, cv]");
  Outcome<Camera> camera = CameraFromCoefficients(
      pinhole, entry.coefficients, entry.distortion_model == "equidistant" ? Lens::kFisheye : Lens::kPolynomial);
  if (!camera) entry.distortion_coeffs.Fail(camera.reason());
  return *camera;
}

// Reads a camera of `model`; without a distortion, those coefficients are 0.
Camera ReadNamed(const CameraModel& model, const Entry& entry) {
  const size_t num_projection = static_cast<size_t>(model.facts().kalibr.num_projection);
  const std::vector<std::string>& names = model.facts().distortion_names;
  const std::vector<double> intrinsics = ReadNumbers(entry.intrinsics);
  if (intrinsics.size() != num_projection + 4) {
    const std::vector<std::string> first(names.begin(), names.begin() + static_cast<std::ptrdiff_t>(num_projection));
    entry.intrinsics.Fail(std::to_string(num_projection + 4) + " numbers are needed: [" + Join(first, ", ") +
                          ", fu, fv, cu, cv]");
  }
  std::vector<double> distortion = entry.coefficients;
  if (entry.distortion_model == "none") distortion.assign(names.size() - num_projection, 0.0);
  if (distortion.size() != names.size() - num_projection) {
    entry.distortion_coeffs.Fail(std::to_string(distortion.size()) + " coefficients; " + entry.camera_model + " with " +
                                 entry.distortion_model + " has " + std::to_string(names.size() - num_projection));
  }
  const auto focal = intrinsics.begin() + static_cast<std::ptrdiff_t>(num_projection);
  Camera camera;
  camera.model = model.name();
  camera.params.assign(focal, intrinsics.end());
  camera.params.insert(camera.params.end(), intrinsics.begin(), focal);
  camera.params.insert(camera.params.end(), distortion.begin(), distortion.end());
  return camera;
}

Camera ReadEntry(const Entry& entry) {
  if (entry.camera_model == "pinhole") return ReadPinhole(entry);
  std::string distortion_models;
  for (const CameraModel* model : CameraModels()) {
    const KalibrNames& names = model->facts().kalibr;
    if (names.camera_model != entry.camera_model) continue;
    if (names.distortion_model == entry.distortion_model || entry.distortion_model == "none") {
      return ReadNamed(*model, entry);
    }
    distortion_models += ", " + names.distortion_model;
  }
  entry.intrinsics.Fail("camera_model " + entry.camera_model + " with distortion_model " + entry.distortion_model +
                        " is not supported; distortion_model can be none" + distortion_models);
}

std::vector<std::string> KalibrCameraModels() {
  std::vector<std::string> names = {"pinhole"};
  for (const CameraModel* model : CameraModels()) {
    const std::string& name = model->facts().kalibr.camera_model;
    if (!name.empty() && std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  }
  return names;
}

Camera Read(const std::string& text, const std::filesystem::path& name) {
  const ConfigValue root = ParseYaml(text, name);
  MapReader chain(root);
  std::optional<ConfigValue> only = chain.Find("cam0");
  if (only && chain.Has("cam1")) {
    only->Fail("the file contains a second camera, cam1; write the intended one to a separate file");
  }
  // Users often extract the camera alone, without its name.
  MapReader reader(only ? *only : root);
  const std::string camera_model = reader.Choice("camera_model", KalibrCameraModels(), "pinhole");
  const std::string distortion_model = reader.Choice("distortion_model", {"none", "radtan", "equidistant"});
  const ConfigValue coefficients = reader.Get("distortion_coeffs");
  Camera camera = ReadEntry({camera_model, distortion_model, reader.Get("intrinsics"), coefficients,
                             distortion_model == "none" ? std::vector<double>() : ReadNumbers(coefficients)});
  const std::vector<ConfigValue> size = reader.Get("resolution").AsList();
  if (size.size() != 2) reader.Get("resolution").Fail("two whole numbers are needed: [width, height]");
  constexpr IntRange kSizes = {1, 100000};
  camera.width_px = size[0].AsInt(kSizes);
  camera.height_px = size[1].AsInt(kSizes);
  return camera;
}

}  // namespace

CameraReader CameraReader_kalibr() { return {Matches, Read}; }

}  // namespace heba
