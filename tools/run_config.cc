#include "tools/run_config.h"

#include <algorithm>
#include <cctype>
#include <limits>
#include <map>

#include <glob.h>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/io/camera_file.h"
#include "heba/io/pose_file.h"
#include "heba/robot/ur_kinematics.h"
#include "solvers/hand_eye_method.h"
#include "solvers/loss.h"
#include "targets/image.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

std::vector<fs::path> ListFolder(const ConfigValue& value, const fs::path& folder) {
  std::vector<fs::path> images;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.is_regular_file() && HasImageSuffix(entry.path())) images.push_back(entry.path());
  }
  if (images.empty()) value.Fail("the folder " + folder.string() + " holds no pictures");
  return images;
}

std::vector<fs::path> ExpandGlob(const ConfigValue& value, const fs::path& pattern) {
  glob_t found;
  std::vector<fs::path> images;
  if (glob(pattern.c_str(), 0, nullptr, &found) == 0) {
    for (size_t i = 0; i < found.gl_pathc; ++i) images.emplace_back(found.gl_pathv[i]);
  }
  globfree(&found);
  if (images.empty()) value.Fail("no file matches " + pattern.string());
  return images;
}

// A folder, a glob or a list, sorted by name unless it is a list.
std::vector<fs::path> FindImages(const ConfigValue& value) {
  std::vector<fs::path> images;
  if (value.IsList()) {
    for (const ConfigValue& item : value.AsList()) {
      const fs::path path = item.AsPath();
      if (!fs::is_regular_file(path)) item.Fail("there is no picture " + path.string());
      images.push_back(path);
    }
    if (images.empty()) value.Fail("the list is empty; pictures are needed");
    return images;
  }
  const fs::path path = value.AsPath();
  if (fs::is_directory(path)) {
    images = ListFolder(value, path);
  } else if (path.string().find_first_of("*?[") != std::string::npos) {
    images = ExpandGlob(value, path);
  } else {
    value.Fail("there is no folder " + path.string() + "; a folder, a glob such as images/*.png, or a list is needed");
  }
  std::sort(images.begin(), images.end(), [](const fs::path& a, const fs::path& b) {
    return NaturalLess(a.filename().string(), b.filename().string());
  });
  return images;
}

}  // namespace

PoseReading ReadPoseReading(MapReader& reader) {
  PoseFormat format = *FindPoseFormat("ros");
  const std::optional<ConfigValue> format_value = reader.Find("pose_format");
  const bool has_joints = format_value && format_value->IsText() && format_value->AsText() == "joints";
  if (has_joints) {
    const std::string robot = reader.Choice("robot", UrRobotNames());
    format = JointFormat(robot, reader.Choice("joint_angles", {"rad", "deg"}, "rad"));
  } else if (format_value) {
    format = ReadPoseFormat(format_value->Top());
  }
  reader.Record("pose_format", PoseFormatNode(format));
  if (const std::optional<ConfigValue> units = reader.Find("units")) {
    format = WithUnits(format, *units);
    reader.Record("units", units->node());
  }
  const std::string direction =
      reader.Choice("poses_are", {"base_from_gripper", "gripper_from_base"}, "base_from_gripper");
  return {format, direction == "base_from_gripper"};
}

Rigid3d BaseFromGripper(const PoseReading& reading, const Rigid3d& pose) {
  return reading.is_base_from_gripper ? pose : Inverse(pose);
}

namespace {

void ReadCaptures(MapReader& root, RunConfig* config) {
  const ConfigValue captures = root.Get("captures");
  MapReader reader(captures);
  const ConfigValue images_value = reader.Get("images");
  const std::vector<fs::path> images = FindImages(images_value);
  if (images_value.IsList()) {
    YAML::Node list;
    for (const fs::path& image : images) list.push_back(fs::absolute(image).lexically_normal().string());
    reader.Record("images", list);
  } else {
    reader.Record("images", YAML::Node(fs::absolute(images_value.AsPath()).lexically_normal().string()));
  }
  const ConfigValue poses_value = reader.Get("poses");
  const fs::path poses_file = reader.Path("poses");
  config->poses_file = poses_file;
  const PoseReading poses = ReadPoseReading(reader);
  config->pose_reading = poses;
  reader.Finish();
  root.Record("captures", reader.used());

  std::map<std::string, fs::path> by_name;
  for (const fs::path& image : images) {
    const std::string name = image.filename().string();
    if (!by_name.emplace(name, image).second) {
      images_value.Fail("two pictures are called " + name + "; poses are found by file name, so names must differ");
    }
  }
  const std::vector<PoseRow> rows = ReadPoseFile(poses_file, poses.format);
  const bool has_names = !rows.empty() && !rows.front().image.empty();
  if (!has_names && rows.size() != images.size()) {
    throw InputError(poses_file.string() + ": has " + std::to_string(rows.size()) +
                     " rows without an image column for " + std::to_string(images.size()) +
                     " pictures; the counts must agree, or name the pictures");
  }
  for (size_t i = 0; i < rows.size(); ++i) {
    Capture capture;
    if (has_names) {
      const auto found = by_name.find(rows[i].image);
      if (found == by_name.end()) {
        std::vector<std::string> names;
        for (const auto& entry : by_name) names.push_back(entry.first);
        throw InputError(poses_file.string() + ":" + std::to_string(rows[i].line) + ": the picture " + rows[i].image +
                         " is not among those of " + images_value.key() + DidYouMean(rows[i].image, names));
      }
      capture.image = found->second;
      by_name.erase(found);
    } else {
      capture.image = images[i];
    }
    capture.name = capture.image.filename().string();
    capture.role = rows[i].role;
    capture.base_from_gripper = BaseFromGripper(poses, rows[i].pose);
    config->captures.push_back(capture);
    config->pose_numbers.push_back(rows[i].numbers);
  }
  if (has_names) {
    for (const auto& entry : by_name) config->images_without_pose.push_back(entry.first);
  }
}

void ReadCameraSection(MapReader& root, RunConfig* config) {
  YAML::Node empty(YAML::NodeType::Map);
  const std::optional<ConfigValue> value = root.Find("camera");
  MapReader reader(value ? *value : ConfigValue(empty, config->file, "camera"));
  std::optional<std::string> model;
  if (const std::optional<ConfigValue> model_value = reader.Find("model")) {
    model = model_value->AsChoice(CameraModelNames());
  }
  if (const std::optional<ConfigValue> file = reader.Find("intrinsics")) {
    const fs::path path = reader.Path("intrinsics");
    config->camera_file = path.string();
    Camera camera = ReadCameraFile(path);
    if (model) {
      const std::optional<Camera> converted = ConvertCamera(camera, *model);
      if (!converted) {
        file->Fail("holds a " + camera.model + " camera, which cannot be written as " + *model +
                   "; leave camera.model out or estimate the intrinsics");
      }
      camera = *converted;
    }
    config->camera = camera;
    config->camera_model = camera.model;
  } else {
    config->camera_model = model.value_or("brown5");
  }
  reader.Record("model", YAML::Node(config->camera_model));
  reader.Finish();
  root.Record("camera", reader.used());
}

// "auto", or both sigmas.
void ReadRobotNoise(const ConfigValue& value, MapReader* refine, RunConfig* config) {
  if (value.IsText()) {
    value.AsChoice({"auto"});
    config->bundle.robot = BundleOptions::Robot::kEstimatedNoise;
    refine->Record("robot_noise", YAML::Node("auto"));
    return;
  }
  MapReader reader(value);
  config->bundle.robot = BundleOptions::Robot::kGivenNoise;
  config->bundle.robot_noise.rotation_rad = reader.Angle("rotation");
  config->bundle.robot_noise.translation_m = reader.Length("translation");
  for (const char* key : {"rotation", "translation"}) {
    const bool is_negative = (std::string_view(key) == "rotation" ? config->bundle.robot_noise.rotation_rad
                                                                  : config->bundle.robot_noise.translation_m) < 0;
    if (is_negative) reader.Get(key).Fail("must not be negative");
  }
  reader.Finish();
  refine->Record("robot_noise", reader.used());
}

// `file`: what the camera file says of its own parameters' sigmas.
void ReadIntrinsicsPrior(MapReader* refine, RunConfig* config) {
  if (refine->Choice("intrinsics_prior", {"none", "file"}, "none") == "none") return;
  const ConfigValue value = refine->Get("intrinsics_prior");
  if (!config->camera) value.Fail("needs a camera file (camera.intrinsics)");
  std::optional<std::vector<double>> sigmas = ReadCameraSigmas(config->camera_file);
  if (!sigmas) {
    value.Fail("needs sigmas, which " + config->camera_file +
               " does not have (in heba's own form: std, as in the camera of a result.json)");
  }
  // Coefficients that the file's model does not have are unknown.
  sigmas->resize(config->camera->params.size(), std::numeric_limits<double>::infinity());
  config->bundle.camera_prior = CameraPrior{config->camera->params, *sigmas};
}

// What of the target's shape is unknown too.
void ReadFreeShape(MapReader* refine, RunConfig* config) {
  const std::vector<std::string> names(kTargetShapeGroupNames.begin(), kTargetShapeGroupNames.end());
  YAML::Node groups(YAML::NodeType::Sequence);
  if (const std::optional<ConfigValue> free = refine->Find("target_shape")) {
    for (const ConfigValue& item : free->AsList()) {
      const std::string name = item.AsChoice(names);
      const auto index = std::find(names.begin(), names.end(), name) - names.begin();
      config->bundle.free_shape.push_back(static_cast<TargetShapeGroup>(index));
      groups.push_back(name);
    }
  }
  refine->Record("target_shape", groups);
}

void ReadRefine(MapReader& root, RunConfig* config) {
  YAML::Node empty(YAML::NodeType::Map);
  const std::optional<ConfigValue> value = root.Find("refine");
  MapReader reader(value ? *value : ConfigValue(empty, config->file, "refine"));
  if (const std::optional<ConfigValue> free = reader.Find("intrinsics")) {
    config->bundle.free_intrinsics.clear();
    const std::vector<std::string> names(std::begin(kParameterGroupNames), std::end(kParameterGroupNames));
    for (const ConfigValue& item : free->AsList()) {
      const std::string name = item.AsChoice(names);
      const auto group = static_cast<ParameterGroup>(std::find(names.begin(), names.end(), name) - names.begin());
      config->bundle.free_intrinsics.push_back(group);
    }
  }
  YAML::Node groups(YAML::NodeType::Sequence);
  for (const ParameterGroup group : config->bundle.free_intrinsics) {
    groups.push_back(std::string(kParameterGroupNames[static_cast<size_t>(group)]));
  }
  reader.Record("intrinsics", groups);
  ReadFreeShape(&reader, config);
  if (const std::optional<ConfigValue> noise = reader.Find("robot_noise")) ReadRobotNoise(*noise, &reader, config);
  const std::optional<ConfigValue> pixel_noise = reader.Find("pixel_noise");
  if (pixel_noise && !(pixel_noise->IsText() && pixel_noise->node().Scalar() == "auto")) {
    config->bundle.pixel_noise_px = pixel_noise->AsQuantity(Quantity::kPixels);
    if (!(*config->bundle.pixel_noise_px > 0)) pixel_noise->Fail("must be greater than zero");
    reader.Record("pixel_noise", QuantityNode(*config->bundle.pixel_noise_px, Quantity::kPixels));
  } else {
    reader.Record("pixel_noise", YAML::Node("auto"));
  }
  ReadIntrinsicsPrior(&reader, config);
  config->bundle.loss = reader.Choice("loss", LossNames(), "truncated");
  reader.Finish();
  root.Record("refine", reader.used());
}

void ReadEvaluate(MapReader& root, RunConfig* config) {
  YAML::Node empty(YAML::NodeType::Map);
  const std::optional<ConfigValue> value = root.Find("evaluate");
  MapReader reader(value ? *value : ConfigValue(empty, config->file, "evaluate"));
  config->folds = reader.Int("folds", {0, 1000000}, 5);
  if (config->folds == 1) reader.Get("folds").Fail("one fold leaves nothing to learn from; 0 for none, or 2 and more");
  if (reader.Has("truth")) config->truth = reader.Path("truth");
  reader.Finish();
  root.Record("evaluate", reader.used());
}

}  // namespace

std::shared_ptr<const Target> ReadTarget(MapReader& reader, const std::string& key) {
  // A target that says what it is replaces the one below: another type has other keys.
  const ConfigValue value = reader.Get(key).DownTo({"type", "target_type"});
  MapReader target_reader(value.IsMap() ? value : ReadYamlFile(value.AsPath()));
  std::shared_ptr<const Target> target = CreateTarget(target_reader);
  reader.Record(key, target_reader.used());
  return target;
}

RunConfig ReadRunConfig(const fs::path& path, const std::vector<std::string>& settings) {
  RunConfig config;
  config.file = path;
  const ConfigValue file = ReadYamlFileOverBases(path, {"name", "output"});
  MapReader reader(settings.empty() ? file : ConfigValue::Stack({ParseSettings(settings), file}));
  config.name = reader.Text("name", path.stem().string());
  if (config.name.find('/') != std::string::npos || config.name == "." || config.name == "..") {
    reader.Get("name").Fail("'" + config.name + "' cannot name a folder");
  }
  config.setup = *FindSetup(reader.Choice("setup", {"eye_to_hand", "eye_in_hand"}));
  config.target = ReadTarget(reader, "target");
  config.target_used = YAML::Dump(reader.used()["target"]);
  ReadCameraSection(reader, &config);
  ReadCaptures(reader, &config);
  std::vector<std::string> seeds = HandEyeMethodNames();
  seeds.emplace_back(kBestSeed);
  config.seed = reader.Choice("seed", seeds, kBestSeed);
  if (const std::optional<ConfigValue> methods = reader.Find("methods")) {
    if (methods->AsList().empty()) methods->Fail("the list is empty; name a method, or leave the key out for all");
    for (const ConfigValue& item : methods->AsList()) {
      const std::string name = item.AsChoice(HandEyeMethodNames());
      if (std::find(config.methods.begin(), config.methods.end(), name) != config.methods.end()) {
        item.Fail("'" + name + "' stands here twice");
      }
      config.methods.push_back(name);
    }
  }
  if (!config.methods.empty()) reader.Record("methods", YAML::Node(config.methods));
  ReadRefine(reader, &config);
  ReadEvaluate(reader, &config);
  if (reader.Has("output")) {
    config.output = reader.Path("output");
  } else {
    config.output = fs::absolute(path).parent_path() / "runs" / config.name;
    reader.Record("output", YAML::Node(config.output.string()));
  }
  reader.Finish();
  YAML::Emitter emitter;
  emitter << reader.used();
  config.used = std::string(emitter.c_str()) + "\n";
  return config;
}

}  // namespace heba
