#include "tools/config/scene_config.h"

#include <limits>
#include <tuple>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/data/hand_eye.h"
#include "heba/detection.h"
#include "heba/io/camera_file.h"
#include "heba/robot/arm_table.h"
#include "tools/config/common_keys.h"
#include "tools/config/file_kind.h"
#include "tools/config/long_form.h"
#include "tools/config/robot_noise_config.h"
#include "tools/text/arm_keys.h"

namespace heba {
namespace {

// Reads an arm from the keys model, offsets, lengths, angles, gravity, joint_noise, configurations, tool and
// record_joints.
SceneArm ReadSceneArm(MapReader& reader) {
  SceneArm arm;
  arm.nominal = *FindArm(reader.Choice("model", ArmNames()));
  arm.sigmas = {reader.Angle("offsets", 0.0), reader.Length("lengths", 0.0), reader.Angle("angles", 0.0)};
  if (reader.Has("gravity")) {
    // The compliance of a joint: the angle by which its gear yields to each N m of the weight that it carries.
    arm.sigmas.compliance_rad_per_nm = reader.QuantityOf("gravity", Quantity::kCompliance);
    if (arm.sigmas.compliance_rad_per_nm < 0) reader.Get("gravity").Fail("must not be negative");
    if (arm.nominal.load == nullptr) {
      reader.Get("gravity").Fail("the masses of the links of the arm " + arm.nominal.name + " are not known");
    }
  }
  arm.joint_noise_rad = reader.Angle("joint_noise", 0.0);
  arm.has_several_configurations = reader.Choice("configurations", {"several", "one"}, "several") == "several";
  if (reader.Has("tool")) arm.tip_from_gripper = ReadPoseKey(reader, "tool");
  // Poses do not determine the joints of captures in several configurations.
  arm.records_joints = reader.Bool("record_joints", arm.has_several_configurations);
  return arm;
}

// Reads the only arm, if the scene has its kinematics.
std::optional<SceneArm> ReadOnlyArm(MapReader& root) {
  if (!root.Has("robot")) return std::nullopt;
  MapReader reader(root.Get("robot"));
  SceneArm arm = ReadSceneArm(reader);
  reader.Finish();
  root.Record("robot", reader.used());
  return arm;
}

Camera ReadSceneCamera(MapReader& reader) {
  // A camera that states its model replaces the one of the base file, because another model has other coefficients.
  const ConfigValue value = reader.Get("camera").DownTo({"model"});
  const Camera camera = value.IsMap() ? ReadCamera(value) : ReadCameraFile(value.AsInputPath());
  if (camera.width_px == 0) value.Fail("the camera file has no image size; a simulated camera needs one");
  constexpr double kMostPixels = 2e8;
  if (static_cast<double>(camera.width_px) * camera.height_px > kMostPixels) {
    value.Fail("a simulated image has at most 200 million pixels, not " + std::to_string(camera.width_px) + " x " +
               std::to_string(camera.height_px));
  }
  reader.Record("camera", YAML::Load(CameraToYaml(camera)));
  return camera;
}

// Returns the scene with the motions of a camera during the captures, if there are any.
SceneConfig WithMotionsOfCamera(SceneConfig scene, size_t camera, MapReader& reader) {
  if (reader.Has("creep")) {
    scene.camera_creeps.push_back({camera, LocalCoordinates(Rigid3d(), ReadPoseKey(reader, "creep"))});
  }
  if (!reader.Has("moved")) return scene;
  MapReader moved(reader.Get("moved"));
  const int from = moved.Int("from", {0, 10000});
  scene.camera_motions.push_back({camera, static_cast<size_t>(from), ReadPoseKey(moved, "by")});
  moved.Finish();
  reader.Record("moved", moved.used());
  return scene;
}

// Reads the deviation of a print from its design.
TargetShape ReadPrint(MapReader& reader, const Target& target) {
  MapReader print = reader.Section("print");
  TargetShape shape = DesignedShape(AllPoints(target).points_in_target);
  // A larger bend would be a roll.
  constexpr double kMostOfSheet = 0.25;
  const Drawing& drawing = target.Draw();
  const double most_m = kMostOfSheet * (drawing.max_m - drawing.min_m).minCoeff();
  for (size_t i = 0; i < shape.params.size(); ++i) {
    const char* const key = kTargetShapeKeys[i];
    if (ShapeGroupOf(static_cast<int>(i)) == TargetShapeGroup::kScale) {
      constexpr double kMostTimes = 2;
      shape.params[i] = print.Number(key, 1.0);
      const bool is_possible = shape.params[i] >= 1 / kMostTimes && shape.params[i] <= kMostTimes;
      if (!is_possible) print.Get(key).Fail("must be from 0.5 to 2");
      continue;
    }
    shape.params[i] = print.Length(key, 0.0);
    if (std::abs(shape.params[i]) > most_m) {
      print.Get(key).Fail("must be at most " + Significant(1e3 * most_m, 3) +
                          " mm, a quarter of the sheet's shorter side");
    }
  }
  print.Finish();
  reader.Record("print", print.used());
  return shape;
}

// Reads the keys `target` and `print`.
SceneTarget ReadSceneTarget(MapReader& reader) {
  SceneTarget target;
  target.target = ReadTarget(reader, "target");
  target.used = reader.used()["target"];
  target.printed = ReadPrint(reader, *target.target);
  return target;
}

// Reads the keys of the short form.
SceneConfig ReadOnlyParts(MapReader& root) {
  SceneConfig scene;
  scene.setup = *FindSetup(root.Choice("setup", SetupNames()));
  scene.targets = {ReadSceneTarget(root)};
  const Camera camera = ReadSceneCamera(root);
  scene.problem =
      HandEyeProblem(*scene.setup, camera, DesignedShape(AllPoints(*scene.targets[0].target).points_in_target));
  const Rigid3d hand_eye = ReadPoseKey(root, "hand_eye");
  scene.poses = HandEyePosesOf({hand_eye, ReadPoseKey(root, "board")});
  scene = WithMotionsOfCamera(std::move(scene), 0, root);
  scene.arms = {ReadOnlyArm(root)};
  return scene;
}

// Reads the arms of a scene.
SceneConfig ReadRobots(MapReader& root) {
  SceneConfig scene;
  // The pose near which the gripper of an arm stands if nothing else determines it.
  const Rigid3d default_home(ExpRotation({0, DegToRad(180.0), 0}), Eigen::Vector3d(0.4, 0, 0.4));
  if (!root.Has("robots")) {
    scene.problem.robots = {kOnlyArm};
    scene.poses.world_from_base = {Rigid3d()};
    scene.options.homes = {default_home};
    scene.arms = {ReadOnlyArm(root)};
    return scene;
  }
  MapReader section(root.Get("robots"));
  scene.problem.robots = NamesIn(section, "left");
  scene.has_named_robots = true;
  for (const std::string& name : scene.problem.robots) {
    MapReader reader(section.Get(name));
    const bool is_first = scene.poses.world_from_base.empty();
    if (is_first && reader.Has("world_from_base")) {
      reader.Get("world_from_base").Fail("the base of the first arm is the world; leave the key out");
    }
    scene.poses.world_from_base.push_back(is_first ? Rigid3d() : ReadPoseKey(reader, "world_from_base"));
    scene.arms.emplace_back();
    if (reader.Has("model")) scene.arms.back() = ReadSceneArm(reader);
    scene.options.homes.push_back(reader.Has("home") ? ReadPoseKey(reader, "home") : default_home);
    reader.Finish();
    section.Record(name, reader.used());
  }
  section.Finish();
  root.Record("robots", section.used());
  return scene;
}

// Returns the scene with its cameras, which may be mounted on its arms.
SceneConfig WithCameras(SceneConfig scene, MapReader& root) {
  MapReader section(root.Get("cameras"));
  for (const std::string& name : CameraNamesIn(section)) {
    MapReader reader(section.Get(name));
    ProblemCamera camera;
    camera.name = name;
    std::tie(camera.mount, camera.mount_name) = ReadMount(reader, scene.problem.robots);
    scene.poses.mount_from_camera.push_back(ReadPoseKey(reader, "pose"));
    camera.camera = ReadSceneCamera(reader);
    const size_t index = scene.problem.cameras.size();
    scene = WithMotionsOfCamera(std::move(scene), index, reader);
    reader.Finish();
    section.Record(name, reader.used());
    scene.problem.cameras.push_back(std::move(camera));
  }
  section.Finish();
  root.Record("cameras", section.used());
  return scene;
}

// Returns the scene with its targets, likewise.
SceneConfig WithTargets(SceneConfig scene, MapReader& root) {
  MapReader section(root.Get("targets"));
  for (const std::string& name : NamesIn(section, "plate")) {
    MapReader reader(section.Get(name));
    ProblemTarget target;
    target.name = name;
    std::tie(target.mount, target.mount_name) = ReadMount(reader, scene.problem.robots);
    scene.poses.mount_from_target.push_back(ReadPoseKey(reader, "pose"));
    scene.targets.push_back(ReadSceneTarget(reader));
    target.shape = DesignedShape(AllPoints(*scene.targets.back().target).points_in_target);
    reader.Finish();
    section.Record(name, reader.used());
    scene.problem.targets.push_back(std::move(target));
  }
  section.Finish();
  root.Record("targets", section.used());
  return scene;
}

// Reads the keys of the long form.
SceneConfig ReadNamedParts(MapReader& root) { return WithTargets(WithCameras(ReadRobots(root), root), root); }

std::optional<TwoStepMotionOptions> ReadTwoStep(MapReader& motion) {
  const std::optional<ConfigValue> value = motion.Find("two_step");
  if (!value) return std::nullopt;
  MapReader reader(*value);
  TwoStepMotionOptions options;
  options.translation_m = reader.PositiveLength("translation", options.translation_m);
  options.num_turns = reader.Int("turns", {2, 10000}, options.num_turns);
  options.max_turn_rad = reader.Angle("angle", options.max_turn_rad);
  reader.Finish();
  motion.Record("two_step", reader.used());
  const std::string faults = options.Check();
  if (!faults.empty()) value->Fail(faults);
  return options;
}

// Returns the scene with the section `motion`.
SceneConfig WithMotion(SceneConfig scene, MapReader& root) {
  MapReader motion = root.Section("motion");
  MotionOptions& options = scene.options.motion;
  options.num_captures = motion.Int("captures", {0, 10000}, options.num_captures);
  options.distance_m = motion.PositiveLength("distance", options.distance_m);
  options.depth_ratio = motion.Number("depth", options.depth_ratio);
  options.max_tilt_rad = motion.Angle("tilt", options.max_tilt_rad);
  options.max_spin_rad = motion.Angle("spin", options.max_spin_rad);
  options.spread = motion.Number("spread", options.spread);
  // The roles of the two-step method are those of a hand-eye calibration.
  if (scene.setup) scene.two_step = ReadTwoStep(motion);
  scene.num_repeats = motion.Int("repeats", {1, 1000}, 1);
  if (options.num_captures == 0 && !scene.two_step) {
    motion.Get("captures").Fail(scene.setup ? "must be at least 1 without two_step" : "must be at least 1");
  }
  if (scene.num_repeats > 1 && scene.two_step) motion.Get("repeats").Fail("cannot be combined with two_step");
  motion.Finish();
  root.Record("motion", motion.used());
  const std::string faults = options.Check();
  if (!faults.empty()) motion.value().Fail(faults);
  return scene;
}

RenderOptions ReadRendering(MapReader& root) {
  RenderOptions options;
  MapReader image = root.Section("image");
  options.blur_sigma_px = image.Pixels("blur", options.blur_sigma_px);
  options.noise_sigma_grey = image.QuantityOf("noise", Quantity::kGreyLevels, options.noise_sigma_grey);
  options.black_grey = image.QuantityOf("black", Quantity::kGreyLevels, options.black_grey);
  options.white_grey = image.QuantityOf("white", Quantity::kGreyLevels, options.white_grey);
  options.light_gradient = image.Number("uneven_light", options.light_gradient);
  options.clutter = image.Bool("clutter", options.clutter);
  options.depth = image.Choice("bits", {"8", "16"}, "8") == "16" ? GreyDepth::k16Bit : GreyDepth::k8Bit;
  image.Finish();
  root.Record("image", image.used());
  const std::string faults = options.Check();
  if (!faults.empty()) image.value().Fail(faults);
  return options;
}

}  // namespace

SceneConfig ReadSceneConfig(const std::filesystem::path& path, const std::vector<std::string>& settings) {
  RefuseFolder(path, FileKind::kScene);
  const ConfigValue file = ReadYamlFileOverBases(path, {});
  const ConfigValue value = settings.empty() ? file : ConfigValue::Stack({ParseSettings(settings), file});
  RefuseOtherKind(value, path, FileKind::kScene);
  return ReadScene(value);
}

SceneConfig ReadScene(const ConfigValue& value) {
  MapReader reader(value);
  SceneConfig scene = WithMotion(HasLongForm(value) ? ReadNamedParts(reader) : ReadOnlyParts(reader), reader);
  scene.image = ReadRendering(reader);
  if (scene.num_repeats > 1 && scene.image.noise_sigma_grey == 0) {
    MapReader motion(reader.Get("motion"));
    motion.Get("repeats").Fail("needs image.noise; without it, the images of a pose would be the same");
  }
  MapReader robot_noise = reader.Section("robot_noise");
  scene.options.robot_noise = ReadRobotNoise(robot_noise, 0.0);
  reader.Record("robot_noise", robot_noise.used());
  scene.pose_format = *FindPoseFormat("ros");
  if (const std::optional<ConfigValue> format = reader.Find("pose_format")) scene.pose_format = ReadPoseFormat(*format);
  reader.Record("pose_format", PoseFormatNode(scene.pose_format));
  scene.give_camera = reader.Bool("give_camera", true);
  scene.seed = static_cast<uint64_t>(reader.Int("seed", {0, std::numeric_limits<int>::max()}, 1));
  reader.Finish();
  scene.used = reader.used();
  return scene;
}

HandEye HandEyeOf(const SceneConfig& scene) {
  return {scene.poses.mount_from_camera.at(0), scene.poses.mount_from_target.at(0)};
}

std::vector<SimulatedTarget> SimulatedTargets(const SceneConfig& scene) {
  std::vector<SimulatedTarget> targets;
  for (const SceneTarget& target : scene.targets) {
    targets.push_back({AllPoints(*target.target).points_in_target, target.target->Draw().y_up});
  }
  return targets;
}

Outcome<std::vector<SimulatedPose>> SimulateScenePoses(const SceneConfig& scene, Rng& rng) {
  const Camera& camera = scene.problem.cameras.at(0).camera;
  const auto [points, z_out] = SimulatedTargets(scene).at(0);
  const MotionOptions& motion = scene.options.motion;
  std::vector<SimulatedPose> poses;
  if (scene.two_step) {
    Outcome<std::vector<SimulatedPose>> two_step =
        SimulateTwoStepPoses(*scene.setup, camera, points, z_out, HandEyeOf(scene), motion, *scene.two_step, rng);
    if (!two_step) return two_step;
    poses = *two_step;
  }
  if (motion.num_captures == 0) return poses;
  const Outcome<std::vector<Rigid3d>> free = SimulatePoses(camera, points, z_out, motion, rng);
  if (!free) return free.failure();
  for (const Rigid3d& pose : *free) poses.push_back({scene.two_step ? CaptureRole::kFree : CaptureRole::kNone, pose});
  return poses;
}

}  // namespace heba
