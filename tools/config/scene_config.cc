#include "tools/config/scene_config.h"
#include "tools/config/common_keys.h"

#include <limits>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/detection.h"
#include "heba/io/camera_file.h"
#include "heba/robot/arm_table.h"
#include "tools/config/file_kind.h"
#include "tools/config/robot_noise_config.h"
#include "tools/config/run_config.h"

namespace heba {
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
  if (const std::optional<ConfigValue> tool = reader.Find("tool")) {
    arm.tip_from_gripper = ReadPose(*tool);
    reader.Record("tool", PoseNode(arm.tip_from_gripper));
  }
  // Poses do not tell the joints of captures in several configurations.
  arm.records_joints = reader.Bool("record_joints", arm.has_several_configurations);
  return arm;
}

void ReadMotion(MapReader& motion, MotionOptions* options) {
  options->num_captures = motion.Int("captures", {0, 10000}, options->num_captures);
  options->distance_m = motion.PositiveLength("distance", options->distance_m);
  options->depth_ratio = motion.Number("depth", options->depth_ratio);
  options->max_tilt_rad = motion.Angle("tilt", options->max_tilt_rad);
  options->max_spin_rad = motion.Angle("spin", options->max_spin_rad);
  options->spread = motion.Number("spread", options->spread);
}

void ReadRendering(MapReader& root, RenderOptions* options) {
  MapReader image = root.Section("image");
  options->blur_sigma_px = image.Pixels("blur", options->blur_sigma_px);
  options->noise_sigma_grey = image.QuantityOf("noise", Quantity::kGreyLevels, options->noise_sigma_grey);
  options->black_grey = image.QuantityOf("black", Quantity::kGreyLevels, options->black_grey);
  options->white_grey = image.QuantityOf("white", Quantity::kGreyLevels, options->white_grey);
  options->light_gradient = image.Number("uneven_light", options->light_gradient);
  options->clutter = image.Bool("clutter", options->clutter);
  options->depth = image.Choice("bits", {"8", "16"}, "8") == "16" ? GreyDepth::k16Bit : GreyDepth::k8Bit;
  image.Finish();
  root.Record("image", image.used());
  const std::string faults = options->Check();
  if (!faults.empty()) image.value().Fail(faults);
}

Camera ReadSceneCamera(MapReader& reader) {
  // A camera that states its model replaces the one of the base file, because another model has other coefficients.
  const ConfigValue value = reader.Get("camera").DownTo({"model"});
  const Camera camera = value.IsMap() ? ReadCamera(value) : ReadCameraFile(value.AsInputPath());
  if (camera.width_px == 0) value.Fail("the camera file has no image size; a simulated camera needs one");
  reader.Record("camera", YAML::Load(CameraToYaml(camera)));
  return camera;
}

SceneConfig ReadSceneConfig(const std::filesystem::path& path, const std::vector<std::string>& settings) {
  RefuseFolder(path, FileKind::kScene);
  const ConfigValue file = ReadYamlFileOverBases(path, {});
  const ConfigValue value = settings.empty() ? file : ConfigValue::Stack({ParseSettings(settings), file});
  RefuseOtherKind(value, path, FileKind::kScene);
  return ReadScene(value);
}

SceneConfig ReadScene(const ConfigValue& value) {
  SceneConfig scene;
  MapReader reader(value);
  scene.setup = *FindSetup(reader.Choice("setup", SetupNames()));
  scene.target = ReadTarget(reader, "target");
  scene.target_used = reader.used()["target"];
  scene.camera = ReadSceneCamera(reader);
  scene.hand_eye.camera_mount_from_camera = ReadPose(reader.Get("hand_eye"));
  reader.Record("hand_eye", PoseNode(scene.hand_eye.camera_mount_from_camera));
  scene.hand_eye.target_mount_from_target = ReadPose(reader.Get("board"));
  reader.Record("board", PoseNode(scene.hand_eye.target_mount_from_target));

  MapReader motion = reader.Section("motion");
  ReadMotion(motion, &scene.motion);
  if (const std::optional<ConfigValue> two_step_value = motion.Find("two_step")) {
    MapReader two_step(*two_step_value);
    scene.two_step.emplace();
    scene.two_step->translation_m = two_step.PositiveLength("translation", scene.two_step->translation_m);
    scene.two_step->num_turns = two_step.Int("turns", {2, 10000}, scene.two_step->num_turns);
    scene.two_step->max_turn_rad = two_step.Angle("angle", scene.two_step->max_turn_rad);
    two_step.Finish();
    motion.Record("two_step", two_step.used());
    const std::string faults = scene.two_step->Check();
    if (!faults.empty()) two_step_value->Fail(faults);
  }
  scene.num_repeats = motion.Int("repeats", {1, 1000}, 1);
  if (scene.motion.num_captures == 0 && !scene.two_step) {
    motion.Get("captures").Fail("must be at least 1 without two_step");
  }
  if (scene.num_repeats > 1 && scene.two_step) motion.Get("repeats").Fail("cannot be combined with two_step");
  motion.Finish();
  reader.Record("motion", motion.used());
  const std::string motion_faults = scene.motion.Check();
  if (!motion_faults.empty()) motion.value().Fail(motion_faults);

  ReadRendering(reader, &scene.image);
  MapReader print = reader.Section("print");
  scene.image.shape = DesignedShape(AllPoints(*scene.target).points_in_target);
  scene.image.shape.params = {print.Number("scale_x", 1.0), print.Number("scale_y", 1.0), print.Length("bend_x", 0.0),
                              print.Length("bend_y", 0.0)};
  for (const char* key : {"scale_x", "scale_y"}) {
    constexpr double kMostTimes = 2;
    const double scale = print.Number(key, 1.0);
    if (!(scale >= 1 / kMostTimes && scale <= kMostTimes)) print.Get(key).Fail("must be from 0.5 to 2");
  }
  for (const char* key : {"bend_x", "bend_y"}) {
    // A larger bend would be a roll.
    constexpr double kMostOfSheet = 0.25;
    const Drawing& drawing = scene.target->Draw();
    const double most_m = kMostOfSheet * (drawing.max_m - drawing.min_m).minCoeff();
    if (std::abs(print.Length(key, 0.0)) > most_m) {
      print.Get(key).Fail("must be at most " + Significant(1e3 * most_m, 3) +
                          " mm, a quarter of the sheet's shorter side");
    }
  }
  print.Finish();
  reader.Record("print", print.used());
  if (scene.num_repeats > 1 && scene.image.noise_sigma_grey == 0) {
    motion.Get("repeats").Fail("needs image.noise; without it, the images of a pose would be the same");
  }

  if (reader.Has("robot")) {
    MapReader robot(reader.Get("robot"));
    scene.arm = ReadSceneArm(robot);
    robot.Finish();
    reader.Record("robot", robot.used());
  }
  MapReader robot = reader.Section("robot_noise");
  const RobotNoise noise = ReadRobotNoise(robot, 0.0);
  reader.Record("robot_noise", robot.used());
  scene.robot_rotation_sigma_rad = noise.rotation_rad;
  scene.robot_translation_sigma_m = noise.translation_m;
  scene.pose_format = *FindPoseFormat("ros");
  if (const std::optional<ConfigValue> format = reader.Find("pose_format")) scene.pose_format = ReadPoseFormat(*format);
  reader.Record("pose_format", PoseFormatNode(scene.pose_format));
  scene.give_camera = reader.Bool("give_camera", true);
  scene.seed = static_cast<uint64_t>(reader.Int("seed", {0, std::numeric_limits<int>::max()}, 1));
  reader.Finish();
  scene.used = reader.used();
  return scene;
}

Outcome<std::vector<SimulatedPose>> SimulateScenePoses(const SceneConfig& scene, Rng* rng) {
  const Points3 points = AllPoints(*scene.target).points_in_target;
  const bool z_out = scene.target->Draw().y_up;
  std::vector<SimulatedPose> poses;
  if (scene.two_step) {
    Outcome<std::vector<SimulatedPose>> two_step = SimulateTwoStepPoses(
        scene.setup, scene.camera, points, z_out, scene.hand_eye, scene.motion, *scene.two_step, rng);
    if (!two_step) return two_step;
    poses = *two_step;
  }
  if (scene.motion.num_captures == 0) return poses;
  const Outcome<std::vector<Rigid3d>> free = SimulatePoses(scene.camera, points, z_out, scene.motion, rng);
  if (!free) return Failure{free.reason()};
  for (const Rigid3d& pose : *free) poses.push_back({scene.two_step ? CaptureRole::kFree : CaptureRole::kNone, pose});
  return poses;
}

}  // namespace heba
