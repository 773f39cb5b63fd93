#include "tools/config/pair_config.h"

#include <algorithm>
#include <set>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/io/camera_file.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/residuals/loss.h"
#include "tools/config/capture_section.h"
#include "tools/config/common_keys.h"
#include "tools/config/file_kind.h"
#include "tools/config/given_detections.h"
#include "tools/config/long_form.h"
#include "tools/config/plan_section.h"
#include "tools/config/prior_section.h"
#include "tools/config/requirements.h"
#include "tools/config/robot_noise_config.h"
#include "tools/config/robot_section.h"
#include "tools/run/captures.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

// Reads the setup. An imported data set provides the default.
void ReadSetup(MapReader& root, PairConfig* config) {
  std::optional<std::string> fallback;
  if (config->imported && config->imported->setup) fallback = SetupName(*config->imported->setup);
  config->data.setup = *FindSetup(root.Choice("setup", SetupNames(), fallback));
}

// Gives points that are listed in the order of the target's points their ids.
void NumberPoints(PairConfig* config) {
  const std::vector<TargetPoint>& points = config->data.target->points();
  for (size_t i = 0; i < config->data.given_detections.size(); ++i) {
    std::vector<int>& ids = config->data.given_detections[i].detection.ids;
    if (!ids.empty() && ids.size() != points.size()) {
      throw InputError(config->data.detections_source + ": " + config->data.captures[i].name + ": " +
                       std::to_string(ids.size()) + " points, but the target has " + std::to_string(points.size()));
    }
    for (size_t k = 0; k < ids.size(); ++k) ids[k] = points[k].id;
  }
}

void ReadTargetSection(MapReader& root, PairConfig* config) {
  if (!root.Has("target")) {
    if (config->imported && !config->imported->target.empty()) {
      MapReader target(ParseYaml(config->imported->target, config->imported->files.front()));
      config->data.target = CreateTarget(target);
      root.Record("target", target.used());
    } else if (!config->data.target_poses.empty()) {
      return;
    }
  }
  if (!config->data.target) {
    config->data.target = ReadTarget(root, "target");
    config->has_target_keys = HoldsTargetKeys(root, "target");
  }
  config->target_used = YAML::Dump(root.used()["target"]);
  if (config->are_points_in_order) NumberPoints(config);
  for (size_t i = 0; i < config->data.given_detections.size(); ++i) {
    CheckGivenDetection(*config->data.target, config->data.given_detections[i].detection,
                        config->data.detections_source + ": " + config->data.captures[i].name + ": ");
  }
}

void ReadCameraSection(MapReader& root, PairConfig* config) {
  MapReader reader = root.Section("camera");
  CameraKeys keys = ReadCameraKeys(reader);
  if (!keys.camera && config->imported && config->imported->camera) {
    keys.source = config->imported->files.front().string();
    keys.camera = AsModel(*config->imported->camera, keys.model, root.Get("captures"));
  }
  if (keys.camera) {
    config->data.camera_source = keys.source;
    config->data.camera = keys.camera;
    config->options.camera_model = keys.camera->model;
  } else {
    config->options.choose_camera_model = keys.model.empty();
    config->options.camera_model = keys.model.empty() ? "auto" : keys.model;
  }
  reader.Record("model", YAML::Node(config->options.camera_model));
  reader.Finish();
  root.Record("camera", reader.used());
}

// Reads {joints: auto}: the noise of the joints is estimated beside that of the poses.
void ReadJointNoise(MapReader* noise, PairConfig* config) {
  noise->Choice("joints", {"auto"});
  noise->Finish();
  config->options.joint_noise = true;
  config->options.choose.robot_noise = false;
  config->options.bundle.robot = BundleOptions::Robot::kEstimatedNoise;
}

// Reads "auto", "none" (or "exact"), "white" (auto without smooth errors), "smooth", both sigmas, or {joints: auto}.
void ReadRobotModel(MapReader* refine, PairConfig* config) {
  const std::optional<ConfigValue> value = refine->Find("robot_noise");
  if (!value || value->IsText()) {
    const std::string name = value ? value->AsChoice({"auto", "none", "exact", "white", "smooth"}) : "auto";
    config->options.choose.robot_noise = name == "auto" || name == "white";
    config->options.smooth = name == "auto"     ? SmoothPoseErrors::kAuto
                             : name == "smooth" ? SmoothPoseErrors::kAlways
                                                : SmoothPoseErrors::kNone;
    if (name == "smooth") config->options.bundle.robot = BundleOptions::Robot::kEstimatedNoise;
    refine->Record("robot_noise", YAML::Node(name));
    return;
  }
  MapReader reader(*value);
  config->options.smooth = SmoothPoseErrors::kNone;
  if (reader.Has("joints")) {
    if (!config->data.robot) value->Fail("the noise of joints needs an arm (robot.model)");
    ReadJointNoise(&reader, config);
    refine->Record("robot_noise", reader.used());
    return;
  }
  if (!reader.Has("translation") && !reader.Has("rotation")) {
    value->Fail("must be one of: auto, none, white, smooth, {translation: ..., rotation: ...}, {joints: auto}");
  }
  config->options.bundle.robot = BundleOptions::Robot::kGivenNoise;
  config->options.bundle.robot_noise = ReadRobotNoise(reader);
  refine->Record("robot_noise", reader.used());
}

void ReadRefine(MapReader& root, PairConfig* config) {
  MapReader reader = root.Section("refine");
  config->options.bundle.free_intrinsics = ReadFreeIntrinsics(reader, config->options.bundle.free_intrinsics);
  const FreeShape shape = ReadFreeShape(reader);
  config->options.choose.target_shape = shape.is_chosen;
  config->options.bundle.free_shape = shape.groups;
  ReadRobotModel(&reader, config);
  std::vector<Arm> arms;
  if (config->data.robot) arms.push_back(config->data.robot->arm);
  config->options.kinematics = ReadKinematics(reader, arms, "robot.model");
  config->options.bundle.pixel_noise_px = ReadPixelNoise(reader);
  // The camera of an imported data set is in no camera file.
  const std::string& source = config->data.camera_source;
  const bool is_imported = config->imported && source == config->imported->files.front().string();
  config->options.bundle.camera_prior =
      ReadIntrinsicsPrior(reader, {is_imported ? std::nullopt : config->data.camera, source, ""},
                          config->options.bundle.free_intrinsics, "camera.intrinsics");
  config->options.bundle.loss = *FindLossKind(reader.Choice("loss", LossNames(), "truncated"));
  std::vector<std::pair<std::string, DriftBody>> bodies;
  for (const DriftSide side : {DriftSide::kHand, DriftSide::kWorld}) {
    bodies.emplace_back(kDriftSideNames[static_cast<size_t>(side)], BodyOn(config->data.setup, side));
  }
  config->options.drift = ReadDrift(reader, bodies);
  if (!config->options.drift.wanted.empty() && !config->data.target_poses.empty()) {
    reader.Get("drift").Fail("a drift is estimated from images or points, not from captures.target_poses");
  }
  reader.Finish();
  root.Record("refine", reader.used());
}

void ReadEvaluate(MapReader& root, PairConfig* config) {
  MapReader reader = root.Section("evaluate");
  config->options.folds = reader.Int("folds", {0, 1000000}, 5);
  if (config->options.folds == 1) {
    reader.Get("folds").Fail("one fold leaves no training data; use 0 for none, or at least 2");
  }
  if (reader.Has("truth")) config->truth = reader.Path("truth");
  config->options.requirements = ReadRequirements(reader);
  reader.Finish();
  root.Record("evaluate", reader.used());
}

}  // namespace

std::vector<std::string> ReadMethods(MapReader& reader) {
  const std::optional<ConfigValue> methods = reader.Find("methods");
  if (!methods || (methods->IsText() && methods->AsText() == "all")) {
    reader.Record("methods", YAML::Node("all"));
    return {};
  }
  if (methods->AsList().empty()) methods->Fail("the list is empty; name a method, or leave the key out for all");
  std::vector<std::string> names;
  for (const ConfigValue& item : methods->AsList()) {
    const std::string name = item.AsChoice(HandEyeMethodNames());
    if (std::find(names.begin(), names.end(), name) != names.end()) item.Fail("'" + name + "' is listed twice");
    names.push_back(name);
  }
  reader.Record("methods", YAML::Node(names));
  return names;
}

PairConfig ReadPairConfig(const fs::path& path, const std::vector<std::string>& settings) {
  PairConfig config;
  config.file = path;
  config.options.choose = {};
  config.options.choose_camera_model = false;
  RefuseFolder(path, FileKind::kRunConfig);
  const ConfigValue file = ReadYamlFileOverBases(path, {"name", "output"});
  const ConfigValue value = settings.empty() ? file : ConfigValue::Stack({ParseSettings(settings), file});
  if (HasLongForm(value)) {
    throw InputError(path.string() +
                     ": is the config of a rig (cameras, targets, robots); this command needs a config of one camera "
                     "and one target");
  }
  RefuseOtherKind(value, path, FileKind::kRunConfig);
  MapReader reader(value);
  config.data.name = ReadFolderName(reader, path.stem().string());
  config.data.about = ReadAbout(reader);
  const YAML::Node captures_used = ReadCaptures(reader.Get("captures"), &config);
  if (!config.data_files.empty()) config.data.detections_source = config.data_files.front().string();
  ReadRobotSection(reader, &config);
  ReadSetup(reader, &config);
  ReadTargetSection(reader, &config);
  ReadCameraSection(reader, &config);
  if (!config.data.given_detections.empty() && !IsImageSizeKnown(config.data)) {
    throw InputError(config.data.detections_source +
                     ": does not state the image size; provide a camera file that does (camera.intrinsics)");
  }
  reader.Record("captures", captures_used);
  std::vector<std::string> seeds = HandEyeMethodNames();
  seeds.emplace_back(kBestSeed);
  config.options.seed = reader.Choice("seed", seeds, kBestSeed);
  config.options.methods = ReadMethods(reader);
  ReadRefine(reader, &config);
  ReadEvaluate(reader, &config);
  config.options.earlier = ReadPrior(reader, &config.data_files);
  ReadWobble(reader);  // `heba check` needs it.
  ReadPlan(reader);    // `heba plan` needs it.
  config.output = ReadOutput(reader, fs::absolute(path).parent_path() / "runs" / config.data.name);
  reader.Finish();
  config.used = UsedText(reader);
  return config;
}

}  // namespace heba
