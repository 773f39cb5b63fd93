#include "tools/config/short_run_config.h"

#include <algorithm>
#include <set>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/data/hand_eye.h"
#include "heba/io/camera_file.h"
#include "heba/run.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/residuals/loss.h"
#include "tools/config/capture_section.h"
#include "tools/config/common_keys.h"
#include "tools/config/given_detections.h"
#include "tools/config/plan_section.h"
#include "tools/config/robot_noise_config.h"
#include "tools/config/robot_section.h"
#include "tools/config/stream_section.h"
#include "tools/config/target_shape_key.h"
#include "tools/run/captures.h"

namespace heba {
namespace {

// Reads the setup. An imported data set provides the default.
void ReadSetup(MapReader& root, RunConfig* config) {
  std::optional<std::string> fallback;
  if (config->imported && config->imported->setup) fallback = SetupName(*config->imported->setup);
  const Setup setup = *FindSetup(root.Choice("setup", SetupNames(), fallback));
  config->data.rig = DatasetOf(setup, nullptr).rig;
}

// Gives points that are listed in the order of the target's points their ids.
void NumberPoints(Dataset* data) {
  const std::vector<TargetPoint>& points = data->targets.front()->points();
  for (TargetDetection& given : data->given_detections) {
    std::vector<int>& ids = given.detection.detection.ids;
    if (!ids.empty() && ids.size() != points.size()) {
      throw InputError(data->detections_source + ": " + data->captures[given.capture].name + ": " +
                       std::to_string(ids.size()) + " points, but the target has " + std::to_string(points.size()));
    }
    for (size_t k = 0; k < ids.size(); ++k) ids[k] = points[k].id;
  }
}

// Reads the target; none is needed with poses of the target.
void ReadTargetSection(MapReader& root, bool are_points_in_order, RunConfig* config) {
  Dataset& data = config->data;
  std::shared_ptr<const Target>& target = data.targets.front();
  config->targets_used = {""};
  config->has_target_keys = {false};
  if (!root.Has("target")) {
    if (config->imported && !config->imported->target.empty()) {
      MapReader reader(ParseYaml(config->imported->target, config->imported->files.front()));
      target = CreateTarget(reader);
      root.Record("target", reader.used());
    } else if (!data.target_poses.empty()) {
      return;
    }
  }
  if (!target) {
    target = ReadTarget(root, "target");
    config->has_target_keys = {HoldsTargetKeys(root, "target")};
  }
  config->targets_used = {YAML::Dump(root.used()["target"])};
  if (are_points_in_order) NumberPoints(&data);
  for (const TargetDetection& given : data.given_detections) {
    CheckGivenDetection(*target, given.detection.detection,
                        data.detections_source + ": " + data.captures[given.capture].name + ": ");
  }
}

void ReadCameraSection(MapReader& root, RunConfig* config) {
  MapReader reader = root.Section("camera");
  CameraKeys keys = ReadCameraKeys(reader);
  if (!keys.camera && config->imported && config->imported->camera) {
    keys.source = config->imported->files.front().string();
    keys.camera = AsModel(*config->imported->camera, keys.model, root.Get("captures"));
  }
  if (keys.camera) config->data.camera_sources = {keys.source};
  config->data.has_camera = {keys.camera.has_value()};
  Camera& camera = config->data.rig.cameras.front().camera;
  camera = keys.camera.value_or(Camera{keys.model, 0, 0, {}});
  reader.Record("model", YAML::Node(camera.model.empty() ? "auto" : camera.model));
  reader.Finish();
  root.Record("camera", reader.used());
}

void ReadRefine(MapReader& root, RunConfig* config) {
  MapReader reader = root.Section("refine");
  Dataset& data = config->data;
  ProblemCamera& camera = data.rig.cameras.front();
  camera.free_intrinsics = ReadFreeIntrinsics(reader, camera.free_intrinsics);
  ReadTargetShape(reader, config);
  ReadRobotErrors(reader, data, &config->options);
  std::vector<Arm> arms;
  if (data.arms.front()) arms.push_back(data.arms.front()->arm);
  config->options.kinematics = ReadKinematics(reader, arms, "robot.model");
  AdjustmentOptions& adjustment = config->options.calibration.adjustment;
  adjustment.pixel_noise_px = ReadPixelNoise(reader);
  // The camera of an imported data set is in no camera file.
  const std::string& source = data.camera_sources.front();
  const bool is_imported = config->imported && source == config->imported->files.front().string();
  const bool has_file = data.has_camera.front() && !is_imported;
  camera.prior = ReadIntrinsicsPrior(reader, {has_file ? std::optional(camera.camera) : std::nullopt, source, ""},
                                     camera.free_intrinsics, "camera.intrinsics");
  adjustment.loss = *FindLossKind(reader.Choice("loss", LossNames(), "truncated"));
  std::vector<std::pair<std::string, DriftBody>> bodies;
  for (const DriftSide side : {DriftSide::kHand, DriftSide::kWorld}) {
    bodies.emplace_back(kDriftSideNames[static_cast<size_t>(side)], BodyOn(SetupOf(data), side));
  }
  config->options.drift = ReadDrift(reader, bodies);
  ReadTimeOffset(reader, config);
  if (!config->options.drift.wanted.empty() && !data.target_poses.empty()) {
    reader.Get("drift").Fail("a drift is estimated from images or points, not from captures.target_poses");
  }
  reader.Finish();
  root.Record("refine", reader.used());
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

void ReadShortForm(MapReader& root, RunConfig* config) {
  Dataset& data = config->data;
  data = DatasetOf(Setup::kEyeToHand, nullptr);
  const CaptureSection captures = ReadCaptures(root.Get("captures"), config);
  ReadRobotSection(root, captures.joints_file, config);
  ReadSetup(root, config);
  ReadTargetSection(root, captures.are_points_in_order, config);
  ReadCameraSection(root, config);
  if (!IsImageSizeKnown(data)) {
    throw InputError(data.detections_source +
                     ": does not state the image size; provide a camera file that does (camera.intrinsics)");
  }
  root.Record("captures", captures.used);
  std::vector<std::string> seeds = HandEyeMethodNames();
  seeds.emplace_back(kBestSeed);
  config->options.seed = root.Choice("seed", seeds, kBestSeed);
  config->options.methods = ReadMethods(root);
  ReadRefine(root, config);
  ReadPlan(root);  // `heba plan` needs it.
}

}  // namespace heba
