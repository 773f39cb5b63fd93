#include "tools/config/common_keys.h"

#include <algorithm>
#include <limits>

#include "heba/io/camera_file.h"
#include "heba/session_check.h"

namespace heba {
namespace fs = std::filesystem;

namespace {

// Throws InputError if `value`, the mapping of a key, states single keys over a file that a layer below names: those of
// the file are not merged with it.
void RefuseKeysOverFile(const MapReader& reader, const std::string& key, const ConfigValue& value) {
  if (!value.IsMap() || value.node()["type"].IsDefined() || value.node()["target_type"].IsDefined()) return;
  for (const ConfigValue& layer : reader.value().Layers()) {
    const ConfigValue below(layer.node()[key], layer.file(), key);
    if (!below.node().IsDefined() || !below.IsText()) continue;
    value.Fail("the target is the file " + below.AsPath().string() + ", whose keys are edited there");
  }
}

}  // namespace

std::shared_ptr<const Target> ReadTarget(MapReader& reader, const std::string& key) {
  // A target that states its type replaces the one of the base file, because another type has other keys.
  const ConfigValue value = reader.Get(key).DownTo({"type", "target_type"});
  RefuseKeysOverFile(reader, key, value);
  MapReader target_reader(value.IsMap() ? value : ReadYamlFile(value.AsInputPath()));
  std::shared_ptr<const Target> target = CreateTarget(target_reader);
  reader.Record(key, target_reader.used());
  return target;
}

bool HoldsTargetKeys(MapReader& reader, const std::string& key) {
  const ConfigValue value = reader.Get(key).DownTo({"type", "target_type"});
  return value.IsMap() && MapReader(value).Has("type");
}

Rigid3d ReadPoseKey(MapReader& reader, const std::string& key) {
  const Rigid3d pose = ReadPose(reader.Get(key));
  reader.Record(key, PoseNode(pose));
  return pose;
}

RobotNoise ReadWobble(MapReader& root) {
  RobotNoise wobble = SessionOptions().wobble;
  if (!root.Has("check")) return wobble;
  MapReader check(root.Get("check"));
  if (check.Has("wobble")) {
    MapReader reader(check.Get("wobble"));
    wobble.translation_m = reader.Length("translation", wobble.translation_m);
    wobble.rotation_rad = reader.Angle("rotation", wobble.rotation_rad);
    for (const char* key : {"translation", "rotation"}) {
      const bool is_length = std::string_view(key) == "translation";
      if ((is_length ? wobble.translation_m : wobble.rotation_rad) < 0) reader.Get(key).Fail("must not be negative");
    }
    reader.Finish();
    check.Record("wobble", reader.used());
  }
  check.Finish();
  root.Record("check", check.used());
  return wobble;
}

std::string ReadFolderName(MapReader& reader, const std::string& fallback) {
  const std::string name = reader.Text("name", fallback);
  constexpr size_t kLongestName = 200;  // File systems allow 255 bytes; the names of staged folders are longer.
  const bool has_control =
      std::any_of(name.begin(), name.end(), [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; });
  if (name.find('/') != std::string::npos || name == "." || name == ".." || has_control || name.size() > kLongestName) {
    reader.Get("name").Fail("'" + name + "' cannot name a folder");
  }
  return name;
}

fs::path ReadOutput(MapReader& reader, const fs::path& fallback) {
  if (reader.Has("output")) return reader.Path("output");
  reader.Record("output", YAML::Node(fallback.string()));
  return fallback;
}

std::string UsedText(const MapReader& reader) {
  YAML::Emitter emitter;
  emitter << reader.used();
  return std::string(emitter.c_str()) + "\n";
}

std::vector<std::pair<std::string, std::string>> ReadAbout(MapReader& root) {
  std::vector<std::pair<std::string, std::string>> about;
  const std::optional<ConfigValue> value = root.Find("about");
  if (!value) return about;
  if (!value->IsMap()) value->Fail("a mapping is needed, such as {camera: serial number 4711}");
  MapReader reader(*value);
  for (const auto& entry : value->node()) {
    const std::string key = entry.first.Scalar();
    about.emplace_back(key, reader.Text(key));
  }
  root.Record("about", reader.used());
  return about;
}

Camera AsModel(const Camera& camera, const std::string& model, const ConfigValue& asked) {
  if (model.empty()) return camera;
  const std::optional<Camera> converted = ConvertCamera(camera, model);
  if (!converted) {
    asked.Fail("contains a " + camera.model + " camera, which cannot be converted to " + model +
               "; leave camera.model out or estimate the intrinsics");
  }
  return *converted;
}

CameraKeys ReadCameraKeys(MapReader& reader) {
  CameraKeys keys;
  if (const std::optional<ConfigValue> model = reader.Find("model")) {
    keys.model = model->AsText();
    if (keys.model == "auto") keys.model.clear();
    if (!keys.model.empty() && FindCameraModel(keys.model) == nullptr) {
      model->Fail(UnknownCameraModel(keys.model) + ", auto");
    }
  }
  if (const std::optional<ConfigValue> file = reader.Find("intrinsics")) {
    fs::path path;
    std::string name;
    if (file->IsMap()) {
      // A mapping replaces the file that a layer below names.
      MapReader choice(file->DownTo({"file"}));
      path = choice.InputPath("file");
      name = choice.Text("camera");
      choice.Finish();
      reader.Record("intrinsics", choice.used());
    } else {
      path = reader.InputPath("intrinsics");
    }
    keys.source = path.string();
    keys.camera = AsModel(ReadCameraFile(path, name), keys.model, *file);
  }
  return keys;
}

std::vector<ParameterGroup> ReadParameterGroups(const ConfigValue& value) {
  std::vector<ParameterGroup> groups;
  const std::vector<std::string> names(std::begin(kParameterGroupNames), std::end(kParameterGroupNames));
  for (const ConfigValue& item : value.AsList()) {
    const std::string name = item.AsChoice(names);
    const auto group = static_cast<ParameterGroup>(std::find(names.begin(), names.end(), name) - names.begin());
    if (std::find(groups.begin(), groups.end(), group) != groups.end()) item.Fail("is listed twice");
    groups.push_back(group);
  }
  return groups;
}

YAML::Node ParameterGroupsNode(const std::vector<ParameterGroup>& groups) {
  YAML::Node node(YAML::NodeType::Sequence);
  for (const ParameterGroup group : groups) {
    node.push_back(std::string(kParameterGroupNames[static_cast<size_t>(group)]));
  }
  return node;
}

std::vector<ParameterGroup> ReadFreeIntrinsics(MapReader& reader, const std::vector<ParameterGroup>& fallback) {
  const std::optional<ConfigValue> free = reader.Find("intrinsics");
  const std::vector<ParameterGroup> groups = free ? ReadParameterGroups(*free) : fallback;
  reader.Record("intrinsics", ParameterGroupsNode(groups));
  return groups;
}

std::optional<CameraPrior> ReadIntrinsicsPrior(MapReader& refine, const CameraKeys& camera,
                                               const std::vector<ParameterGroup>& free, const std::string& camera_key,
                                               bool is_none_without_key) {
  const std::string asked = refine.Choice("intrinsics_prior", {"none", "file"}, is_none_without_key ? "none" : "");
  const std::optional<CameraSigmas> known =
      asked != "none" && camera.camera && !free.empty() ? ReadCameraSigmas(camera.source) : std::nullopt;
  if (asked.empty()) refine.Record("intrinsics_prior", YAML::Node(known ? "file" : "none"));
  if (asked == "file" && !known) {
    const ConfigValue value = refine.Get("intrinsics_prior");
    if (!camera.camera) value.Fail("needs a camera file (" + camera_key + ")");
    if (free.empty())
      value.Fail("needs intrinsics that are free (the key 'intrinsics' beside it, or refine.intrinsics)");
    value.Fail("needs sigmas, which " + camera.source +
               " does not have (in heba's own form: std, as in the camera of a result.json)");
  }
  if (!known) return std::nullopt;
  // Parameters that the file's model does not have are unknown.
  CameraPrior prior{camera.camera->params, {}};
  for (const std::string& name : camera.camera->Model().param_names()) {
    const auto found = std::find(known->names.begin(), known->names.end(), name);
    prior.sigmas.push_back(found == known->names.end()
                               ? std::numeric_limits<double>::infinity()
                               : known->sigmas[static_cast<size_t>(found - known->names.begin())]);
  }
  return prior;
}

DriftOptions ReadDrift(MapReader& refine, const std::vector<std::pair<std::string, DriftBody>>& bodies) {
  DriftOptions drift;
  const std::optional<ConfigValue> value = refine.Find("drift");
  if (!value || value->IsText()) {
    const std::string name = value ? value->AsChoice({"auto", "none"}) : "auto";
    drift.is_tested = name == "auto";
    refine.Record("drift", YAML::Node(name));
    return drift;
  }
  drift.is_tested = false;
  std::vector<std::string> names;
  for (const auto& [name, body] : bodies) names.push_back(name);
  YAML::Node listed(YAML::NodeType::Sequence);
  for (const ConfigValue& item : value->AsList()) {
    const std::string name = item.AsChoice(names);
    if (std::count(names.begin(), names.end(), name) > 1) {
      item.Fail("is the name of a camera and of a target; give one of them another name");
    }
    const DriftBody& body =
        bodies[static_cast<size_t>(std::find(names.begin(), names.end(), name) - names.begin())].second;
    const bool is_new = std::find(drift.wanted.begin(), drift.wanted.end(), body) == drift.wanted.end();
    if (!is_new) item.Fail("is listed twice");
    drift.wanted.push_back(body);
    listed.push_back(name);
  }
  refine.Record("drift", listed);
  return drift;
}

FreeShape ReadFreeShape(MapReader& refine) {
  FreeShape shape;
  // The bend of a config is the complete quadratic surface.
  using Group = TargetShapeGroup;
  const std::vector<std::pair<std::string, std::vector<Group>>> named = {{"scale", {Group::kScale}},
                                                                         {"bend", {Group::kBend, Group::kTwist}},
                                                                         {"cubic", {Group::kCubic}},
                                                                         {"points", {Group::kPoints}}};
  std::vector<std::string> names;
  for (const auto& [name, groups] : named) names.push_back(name);
  const std::optional<ConfigValue> free = refine.Find("target_shape");
  if (!free || free->IsText()) {
    const std::string name = free ? free->AsChoice({"auto", "none", "exact"}) : "auto";
    shape.is_chosen = name == "auto";
    refine.Record("target_shape", YAML::Node(name));
    return shape;
  }
  YAML::Node groups(YAML::NodeType::Sequence);
  for (const ConfigValue& item : free->AsList()) {
    const std::string name = item.AsChoice(names);
    const auto index = std::find(names.begin(), names.end(), name) - names.begin();
    for (const Group group : named[static_cast<size_t>(index)].second) {
      const bool is_new = std::find(shape.groups.begin(), shape.groups.end(), group) == shape.groups.end();
      if (!is_new) item.Fail("is listed twice");
      shape.groups.push_back(group);
    }
    groups.push_back(name);
  }
  std::sort(shape.groups.begin(), shape.groups.end());
  refine.Record("target_shape", groups);
  return shape;
}

std::optional<double> ReadPixelNoise(MapReader& refine) {
  const std::optional<ConfigValue> value = refine.Find("pixel_noise");
  if (!value || (value->IsText() && value->node().Scalar() == "auto")) {
    refine.Record("pixel_noise", YAML::Node("auto"));
    return std::nullopt;
  }
  const double noise_px = value->AsQuantity(Quantity::kPixels);
  if (!(noise_px > 0)) value->Fail("must be greater than zero");
  refine.Record("pixel_noise", QuantityNode(noise_px, Quantity::kPixels));
  return noise_px;
}

}  // namespace heba
