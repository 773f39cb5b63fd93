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
#include "tools/run/time_offset.h"

namespace heba {
namespace {

// Reads the setup. An imported data set provides the default.
Setup ReadSetup(MapReader& root, const std::optional<ImportedSet>& imported) {
  std::optional<std::string> fallback;
  if (imported && imported->setup) fallback = SetupName(*imported->setup);
  return *FindSetup(root.Choice("setup", SetupNames(), fallback));
}

// Returns the detections of points that are listed in the order of the target's points, with the ids of these.
std::vector<TargetDetection> DetectionsWithIds(const Dataset& data) {
  const std::vector<TargetPoint>& points = data.targets.front()->points();
  std::vector<TargetDetection> detections = data.given_detections;
  for (TargetDetection& given : detections) {
    std::vector<int>& ids = given.detection.detection.ids;
    if (!ids.empty() && ids.size() != points.size()) {
      throw InputError(data.detections_source + ": " + data.captures[given.capture].name + ": " +
                       std::to_string(ids.size()) + " points, but the target has " + std::to_string(points.size()));
    }
    for (size_t k = 0; k < ids.size(); ++k) ids[k] = points[k].id;
  }
  return detections;
}

struct TargetSection {
  std::shared_ptr<const Target> target;  // Null if there is none.
  std::string used;                      // RunConfig::targets_used.
  bool has_keys = false;                 // RunConfig::has_target_keys.
};

// Reads the target, or that of an imported data set; none is needed with poses of the target.
TargetSection ReadTargetSection(MapReader& root, const CaptureSection& captures) {
  TargetSection section;
  const std::optional<ImportedSet>& imported = captures.imported;
  const bool has_target = root.Has("target");
  if (!has_target && imported && !imported->target.empty()) {
    MapReader reader(ParseYaml(imported->target, imported->files.front()));
    section.target = CreateTarget(reader);
    root.Record("target", reader.used());
  } else if (has_target || captures.target_poses.empty()) {
    section.target = ReadTarget(root, "target");
    section.has_keys = HoldsTargetKeys(root, "target");
  } else {
    return section;
  }
  section.used = YAML::Dump(root.used()["target"]);
  return section;
}

// Reads the camera, or that of an imported data set.
CameraKeys ReadCameraSection(MapReader& root, const std::optional<ImportedSet>& imported) {
  MapReader reader = root.Section("camera");
  CameraKeys keys = ReadCameraKeys(reader);
  if (!keys.camera && imported && imported->camera) {
    keys.source = imported->files.front().string();
    keys.camera = AsModel(*imported->camera, keys.model, root.Get("captures"));
  }
  const std::string& model = keys.camera ? keys.camera->model : keys.model;
  reader.Record("model", YAML::Node(model.empty() ? "auto" : model));
  reader.Finish();
  root.Record("camera", reader.used());
  return keys;
}

// Returns the config with the section `refine`.
RunConfig WithRefine(RunConfig config, MapReader& root) {
  MapReader reader = root.Section("refine");
  config.data.rig.cameras.front().free_intrinsics =
      ReadFreeIntrinsics(reader, config.data.rig.cameras.front().free_intrinsics);
  config = WithTargetShape(std::move(config), reader);
  Dataset& data = config.data;
  config.options = WithRobotErrors(std::move(config.options), reader, data);
  std::vector<Arm> arms;
  if (data.arms.front()) arms.push_back(data.arms.front()->arm);
  config.options.kinematics = ReadKinematics(reader, arms, "robot.model");
  AdjustmentOptions& adjustment = config.options.calibration.adjustment;
  adjustment.pixel_noise_px = ReadPixelNoise(reader);
  // The camera of an imported data set is in no camera file.
  const std::string& source = data.camera_sources.front();
  const bool is_imported = config.imported && source == config.imported->files.front().string();
  const bool has_file = data.has_camera.front() && !is_imported;
  ProblemCamera& camera = data.rig.cameras.front();
  camera.prior = ReadIntrinsicsPrior(reader, {has_file ? std::optional(camera.camera) : std::nullopt, source, ""},
                                     camera.free_intrinsics, "camera.intrinsics");
  adjustment.loss = *FindLossKind(reader.Choice("loss", LossNames(), "truncated"));
  std::vector<std::pair<std::string, DriftBody>> bodies;
  for (const DriftSide side : {DriftSide::kHand, DriftSide::kWorld}) {
    bodies.emplace_back(kDriftSideNames[static_cast<size_t>(side)], BodyOn(SetupOf(data), side));
  }
  config.options.drift = ReadDrift(reader, bodies);
  const std::optional<double> time_offset_s = ReadTimeOffset(reader, data.stream.has_value());
  config.options.estimates_time_offset = !time_offset_s;
  if (time_offset_s) data = WithPosesAt(std::move(data), *time_offset_s);
  if (!config.options.drift.wanted.empty() && !data.target_poses.empty()) {
    reader.Get("drift").Fail("a drift is estimated from images or points, not from captures.target_poses");
  }
  reader.Finish();
  root.Record("refine", reader.used());
  return config;
}

// Returns a config with the captures and the arm of its data set.
RunConfig ConfigOf(const CaptureSection& captures, const RobotSection& robot, Setup setup) {
  RunConfig config;
  Dataset& data = config.data;
  data = DatasetOf(setup, nullptr);
  data.captures = captures.captures;
  for (size_t i = 0; i < robot.joints.size(); ++i) data.captures[i].joints = {robot.joints[i]};
  data.given_detections = captures.given_detections;
  data.detections_source = captures.detections_source;
  data.target_poses = captures.target_poses;
  data.stream = captures.stream;
  data.left_out = captures.left_out;
  data.arms = {robot.robot};
  data.robot_scale_sigmas = {robot.scale_sigma};
  config.arms = {captures.arm};
  config.data_files = captures.data_files;
  config.data_files.insert(config.data_files.end(), robot.files.begin(), robot.files.end());
  config.num_images = captures.num_images;
  config.images_without_pose = captures.images_without_pose;
  config.poses_without_image = captures.poses_without_image;
  config.imported = captures.imported;
  return config;
}

// Returns the data set with its target, which the given detections must be of.
Dataset WithTarget(Dataset data, const std::shared_ptr<const Target>& target, bool are_points_in_order) {
  data.targets = {target};
  if (target == nullptr) return data;
  if (are_points_in_order) data.given_detections = DetectionsWithIds(data);
  for (const TargetDetection& given : data.given_detections) {
    CheckGivenDetection(*target, given.detection.detection,
                        data.detections_source + ": " + data.captures[given.capture].name + ": ");
  }
  return data;
}

Dataset WithCamera(Dataset data, const CameraKeys& keys) {
  if (keys.camera) data.camera_sources = {keys.source};
  data.has_camera = {keys.camera.has_value()};
  data.rig.cameras.front().camera = keys.camera.value_or(Camera{keys.model, 0, 0, {}});
  return data;
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

RunConfig ReadShortForm(MapReader& root, const std::filesystem::path& file) {
  const CaptureSection captures = ReadCaptures(root.Get("captures"));
  const RobotSection robot = ReadRobotSection(root, captures, file);
  RunConfig config = ConfigOf(captures, robot, ReadSetup(root, captures.imported));
  const TargetSection target = ReadTargetSection(root, captures);
  config.targets_used = {target.used};
  config.has_target_keys = {target.has_keys};
  config.data = WithTarget(std::move(config.data), target.target, captures.are_points_in_order);
  config.data = WithCamera(std::move(config.data), ReadCameraSection(root, captures.imported));
  if (!IsImageSizeKnown(config.data)) {
    throw InputError(config.data.detections_source +
                     ": does not state the image size; provide a camera file that does (camera.intrinsics)");
  }
  root.Record("captures", captures.used);
  std::vector<std::string> seeds = HandEyeMethodNames();
  seeds.emplace_back(kBestSeed);
  config.options.seed = root.Choice("seed", seeds, kBestSeed);
  config.options.methods = ReadMethods(root);
  config = WithRefine(std::move(config), root);
  ReadPlan(root);  // `heba plan` needs it.
  return config;
}

}  // namespace heba
