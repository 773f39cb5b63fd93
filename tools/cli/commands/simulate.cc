#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <mutex>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/parallel.h"
#include "heba/base/text.h"
#include "heba/io/camera_file.h"
#include "heba/io/pose_file.h"
#include "heba/io/result_file.h"
#include "targets/images/image.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/config/rig_scene_config.h"
#include "tools/config/robot_section.h"
#include "tools/config/scene_config.h"
#include "tools/files/result_folder.h"
#include "tools/pipeline/rig_data_set.h"
#include "tools/text/console.h"

namespace heba {
namespace {

std::string ImageName(int index) {
  char name[32];
  std::snprintf(name, sizeof(name), "%03d.png", index);
  return name;
}

// Returns a run config for the data set, ready for `heba run`.
std::string RunConfigText(const SceneConfig& scene) {
  YAML::Node config;
  config["setup"] = std::string(SetupName(scene.setup));
  config["target"] = "target.yaml";
  config["camera"]["model"] = scene.camera.model;
  if (scene.give_camera) config["camera"]["intrinsics"] = "camera.yaml";
  config["captures"]["images"] = "images";
  config["captures"]["poses"] = "poses.csv";
  config["captures"]["pose_format"] = PoseFormatNode(scene.pose_format);
  config["evaluate"]["truth"] = "truth.json";
  if (scene.arm) {
    config["robot"]["model"] = scene.arm->nominal.name;
    config["robot"]["tool"] = PoseNode(scene.arm->tip_from_gripper);
    if (scene.arm->records_joints) config["captures"]["joints"] = "joints.csv";
  }
  YAML::Emitter emitter;
  emitter << config;
  return std::string(emitter.c_str()) + "\n";
}

// The captures of a scene, before any image is rendered.
struct SimulatedCaptures {
  std::vector<Rigid3d> camera_from_target;
  std::vector<PoseRow> rows;
  std::vector<Eigen::VectorXd> joints;  // Commanded; empty without an arm.
  Eigen::VectorXd arm_errors;           // One per parameter of the arm; empty without one.
};

// Returns the captures, each taken `num_repeats` times in a row.
SimulatedCaptures Repeated(const SimulatedCaptures& once, int num_repeats) {
  SimulatedCaptures repeated;
  repeated.arm_errors = once.arm_errors;
  for (size_t i = 0; i < once.rows.size(); ++i) {
    for (int repeat = 0; repeat < num_repeats; ++repeat) {
      repeated.rows.push_back(once.rows[i]);
      repeated.rows.back().image = ImageName(static_cast<int>(repeated.rows.size()) - 1);
      repeated.camera_from_target.push_back(once.camera_from_target[i]);
      if (!once.joints.empty()) repeated.joints.push_back(once.joints[i]);
    }
  }
  return repeated;
}

// The poses that are drawn for one that an arm must reach.
constexpr int kPosesPerReached = 4;

// Returns the first `num_captures` of these captures that an arm with errors reaches, with the poses that it reports
// and the views that it has there. Returns a Failure if it does not reach as many.
Outcome<SimulatedCaptures> WithArm(const SceneConfig& scene, const SimulatedCaptures& wanted_captures,
                                   size_t num_captures, Rng* rng) {
  const SceneArm& arm = *scene.arm;
  SimulatedCaptures captures;
  captures.arm_errors = DrawArmErrors(arm.nominal, arm.sigmas, rng);
  const Arm actual = WithChanges(arm.nominal, captures.arm_errors);
  std::optional<Eigen::VectorXd> first;
  for (size_t i = 0; i < wanted_captures.rows.size() && captures.rows.size() < num_captures; ++i) {
    const Rigid3d wanted =
        BaseFromGripper(scene.setup, CameraMountFromTargetMount(scene.hand_eye, wanted_captures.camera_from_target[i]));
    const std::optional<Eigen::VectorXd> joints =
        DrawPosture(actual, wanted * Inverse(arm.tip_from_gripper), first, arm.has_several_configurations, rng);
    if (!joints) continue;
    if (!first) first = joints;
    Eigen::VectorXd reached = *joints;
    for (double& joint : reached) joint += arm.joint_noise_rad * rng->Normal();
    const Rigid3d mount =
        CameraMountFromTargetMount(scene.setup, BaseFromGripper(actual, reached, arm.tip_from_gripper));
    captures.camera_from_target.push_back(CameraFromTarget(scene.hand_eye, mount));
    PoseRow row = wanted_captures.rows[i];
    row.image = ImageName(static_cast<int>(captures.rows.size()));
    row.pose = WithRobotNoise(BaseFromGripper(arm.nominal, *joints, arm.tip_from_gripper),
                              scene.robot_rotation_sigma_rad, scene.robot_translation_sigma_m, rng);
    captures.rows.push_back(std::move(row));
    captures.joints.push_back(*joints);
  }
  if (captures.rows.size() < num_captures) {
    return Failure{"the arm " + arm.nominal.name + " reaches only " + std::to_string(captures.rows.size()) + " of " +
                   std::to_string(wanted_captures.rows.size()) + " poses from which the camera sees the target; " +
                   std::to_string(num_captures) + " are needed: change hand_eye, board or motion"};
  }
  return captures;
}

int SimulateRig(const std::string& path) {
  const Outcome<int> num_images = WriteRigDataSet(ReadRigScene(path, Settings()), FLAGS_out, NumThreads(),
                                                  FLAGS_quiet ? Verbosity::kQuiet : Verbosity::kNormal);
  if (!num_images) {
    PrintError(path + ": " + num_images.reason());
    return kWorkFailed;
  }
  if (!FLAGS_quiet) {
    std::cout << *num_images << " images with ground truth in " << FLAGS_out << "; next: heba run "
              << (std::filesystem::path(FLAGS_out) / "config.yaml").string() << std::endl;
  }
  return kDone;
}

}  // namespace

int RunCommand_simulate(const std::vector<std::string>& arguments) {
  namespace fs = std::filesystem;
  if (FLAGS_out.empty()) throw InputError("'heba simulate' needs --out DIR");
  if (IsRigScene(arguments[0], Settings())) return SimulateRig(arguments[0]);
  SceneConfig scene = ReadSceneConfig(arguments[0], Settings());
  const int num_captures = scene.motion.num_captures;
  if (scene.arm) {
    if (scene.two_step) throw InputError(arguments[0] + ": motion.two_step cannot be combined with robot");
    constexpr int kMostJoints = 6;
    if (scene.arm->nominal.num_joints() > kMostJoints) {
      throw InputError(arguments[0] +
                       ": robot.model: a redundant arm reaches a pose in infinitely many ways; choose one " +
                       "with six joints");
    }
    scene.motion.num_captures *= kPosesPerReached;
  }
  StagedFolder folder(FLAGS_out, "a data set");
  const Drawing& drawing = scene.target->Draw();
  Rng rng(scene.seed);
  const Outcome<std::vector<SimulatedPose>> poses = SimulateScenePoses(scene, &rng);
  if (!poses) {
    PrintError(arguments[0] + ": " + poses.reason());
    return kWorkFailed;
  }
  fs::create_directory(folder.staging() / "images");
  SimulatedCaptures captures;
  std::vector<PoseRow>& rows = captures.rows;
  for (size_t i = 0; i < poses->size(); ++i) {
    const Rigid3d true_pose =
        BaseFromGripper(scene.setup, CameraMountFromTargetMount(scene.hand_eye, (*poses)[i].camera_from_target));
    PoseRow row;
    row.image = ImageName(static_cast<int>(i));
    row.role = (*poses)[i].role;
    row.pose = WithRobotNoise(true_pose, scene.robot_rotation_sigma_rad, scene.robot_translation_sigma_m, &rng);
    rows.push_back(row);
    captures.camera_from_target.push_back((*poses)[i].camera_from_target);
  }
  if (scene.arm) {
    Outcome<SimulatedCaptures> with_arm = WithArm(scene, captures, static_cast<size_t>(num_captures), &rng);
    if (!with_arm) {
      PrintError(arguments[0] + ": " + with_arm.reason());
      return kWorkFailed;
    }
    captures = std::move(*with_arm);
  }
  captures = Repeated(captures, scene.num_repeats);
  {
    Progress progress("render", static_cast<int>(rows.size()), FLAGS_quiet ? Verbosity::kQuiet : Verbosity::kNormal);
    std::mutex mutex;
    ParallelFor(static_cast<int>(rows.size()), NumThreads(), [&](int index) {
      const size_t i = static_cast<size_t>(index);
      RenderOptions options = scene.image;
      options.seed = scene.seed * 1000003 + i;
      WriteImage(folder.staging() / "images" / rows[i].image,
                 RenderView(drawing, scene.camera, captures.camera_from_target[i], options));
      const std::lock_guard<std::mutex> lock(mutex);
      progress.Step();
    });
  }
  YAML::Emitter target;
  target << scene.target_used;
  WriteFileAtomically(folder.staging() / "target.yaml", std::string(target.c_str()) + "\n");
  WriteFileAtomically(folder.staging() / "camera.yaml", CameraToYaml(scene.camera));
  WriteFileAtomically(folder.staging() / "poses.csv", PoseFileText(rows, scene.pose_format));
  if (scene.arm && scene.arm->records_joints) {
    std::vector<std::string> images;
    for (const PoseRow& row : captures.rows) images.push_back(row.image);
    WriteFileAtomically(folder.staging() / "joints.csv", JointsFileText(scene.arm->nominal, images, captures.joints));
  }
  WriteFileAtomically(folder.staging() / "config.yaml", RunConfigText(scene));
  WriteFileAtomically(folder.staging() / "truth.json",
                      TruthToJson({scene.hand_eye.camera_mount_from_camera, scene.hand_eye.target_mount_from_target,
                                   scene.camera, captures.arm_errors},
                                  scene.setup));
  folder.Commit();
  if (!FLAGS_quiet) {
    std::cout << rows.size() << " images with ground truth in " << FLAGS_out << "; next: heba run "
              << (fs::path(FLAGS_out) / "config.yaml").string() << std::endl;
  }
  return kDone;
}

}  // namespace heba
