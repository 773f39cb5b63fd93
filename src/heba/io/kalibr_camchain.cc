#include "heba/io/kalibr_camchain.h"

#include <algorithm>

#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/io/camera_format.h"
#include "heba/io/import_text.h"

namespace heba {
namespace {

// The camera's part of a file.
struct Entry {
  std::string camera_model;
  std::string distortion_model;
  ConfigValue intrinsics;
  ConfigValue distortion_coeffs;
  std::vector<double> coefficients;
};

// Reads a pinhole camera without distortion.
Camera ReadPinhole(const Entry& entry) {
  const std::vector<double> pinhole = ReadNumbers(entry.intrinsics);
  if (pinhole.size() != 4) entry.intrinsics.Fail("four numbers are needed: [fu, fv, cu, cv]");
  return {"pinhole", 0, 0, pinhole};
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
  if (entry.camera_model == "pinhole" && entry.distortion_model == "none") return ReadPinhole(entry);
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

Camera ReadCamera(const ConfigValue& value) {
  MapReader reader(value);
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

// Returns the names of the cameras, in the order of their numbers; none if the entry of one camera stands alone.
std::vector<std::string> NamesOfCameras(const ConfigValue& root) {
  std::vector<std::string> names;
  if (!root.IsMap()) return names;
  for (const auto& entry : root.node()) {
    constexpr std::string_view kPrefix = "cam";
    const std::string& name = entry.first.Scalar();
    const bool is_camera = name.starts_with(kPrefix) && name.size() > kPrefix.size() &&
                           name.find_first_not_of("0123456789", kPrefix.size()) == std::string::npos;
    if (is_camera) names.push_back(name);
  }
  std::sort(names.begin(), names.end(), NaturalLess);
  return names;
}

}  // namespace

bool IsCamchain(const std::string& text) { return HasKey(text, "distortion_coeffs") && HasKey(text, "intrinsics"); }

bool IsChainOfSeveral(const std::string& text) { return IsCamchain(text) && HasKey(text, "cam1"); }

Camera ReadCamchainCamera(const std::string& text, const std::filesystem::path& file, const std::string& camera) {
  const ConfigValue root = ParseYaml(text, file);
  const std::vector<std::string> names = NamesOfCameras(root);
  if (!camera.empty() && std::find(names.begin(), names.end(), camera) == names.end()) {
    throw InputError(file.string() + ": " +
                     (names.empty() ? "its camera has no name, so that none is called " + Quoted(camera)
                                    : "the camera " + UnknownName(camera, names)));
  }
  if (camera.empty() && names.size() > 1) {
    throw InputError(file.string() + ": contains several cameras, " + Join(names, ", ") +
                     "; state the one that is meant, such as intrinsics: {file: " + file.filename().string() +
                     ", camera: " + names.back() + "}; 'heba import' writes a file for each");
  }
  // Users often extract the camera alone, without its name.
  if (names.empty()) return ReadCamera(root);
  MapReader chain(root);
  return ReadCamera(chain.Get(camera.empty() ? names.front() : camera));
}

std::vector<ChainedCamera> ReadCamchain(const std::string& text, const std::filesystem::path& file) {
  const ConfigValue root = ParseYaml(text, file);
  MapReader chain(root);
  std::vector<ChainedCamera> cameras;
  for (const std::string& name : NamesOfCameras(root)) {
    const ConfigValue value = chain.Get(name);
    const std::string expected = "cam" + std::to_string(cameras.size());
    if (name != expected) value.Fail("stands where " + expected + " is expected; the cameras are numbered from cam0");
    ChainedCamera& camera = cameras.emplace_back();
    camera.name = name;
    camera.camera = ReadCamera(value);
    if (cameras.size() == 1) continue;
    MapReader reader(value);
    const ConfigValue matrix = reader.Get("T_cn_cnm1");
    const std::string where = matrix.Where();
    camera.camera_from_previous = PoseOfMatrix(FlatNumbers(matrix), 1, where.substr(0, where.rfind(": ")));
  }
  if (cameras.empty()) throw InputError(file.string() + ": contains no cameras called cam0, cam1, ...");
  return cameras;
}

}  // namespace heba
