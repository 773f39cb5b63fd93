#include "tools/bench/workloads.h"

#include "heba/base/error.h"
#include "heba/base/rng.h"
#include "heba/base/units.h"
#include "heba/robot/arm_errors.h"
#include "heba/robot/arm_table.h"
#include "heba/simulation/scene.h"
#include "solvers/closed_form/hand_eye_method.h"

namespace heba {

BenchScene MakeBenchScene(int num_captures, int points_a_side, bool has_robot_noise) {
  Rng rng(1);
  BenchScene scene;
  scene.problem.camera = {"brown5", 1600, 1200, {1500, 1502, 805, 595, -0.08, 0.05, 0.0005, -0.0003, 0.0}};
  scene.truth = {Rigid3d(ExpRotation({0.4, -1.2, 0.7}), {0.5, -0.3, 0.6}),
                 Rigid3d(ExpRotation({1.0, 0.3, -0.5}), {0.04, -0.02, 0.09})};
  const int side = points_a_side;
  constexpr double kBoardM = 0.2;
  Points3 points(3, side * side);
  for (int i = 0; i < side * side; ++i) {
    const int row = i / side;
    const int column = i % side;
    points.col(i) << kBoardM * (static_cast<double>(column) / (side - 1) - 0.5),
        kBoardM * (static_cast<double>(row) / (side - 1) - 0.5), 0;
  }
  MotionOptions motion;
  motion.num_captures = num_captures;
  const Outcome<std::vector<Rigid3d>> poses = SimulatePoses(scene.problem.camera, points, false, motion, rng);
  CHECK(poses.ok()) << poses.reason();
  for (const Rigid3d& camera_from_target : *poses) {
    const Rigid3d mount = CameraMountFromTargetMount(scene.truth, camera_from_target);
    scene.problem.views.push_back(
        *SimulateView("view", scene.problem.camera, scene.truth, mount, points, kBenchNoisePx, rng));
    if (has_robot_noise) {
      scene.problem.views.back().camera_mount_from_target_mount =
          WithRobotNoise(mount, kBenchRobot.rotation_rad, kBenchRobot.translation_m, rng);
    }
  }
  const auto off = [](const Rigid3d& pose, double by) {
    return Retract(pose, by * (Tangent6() << 2, -1, 1, 3, 2, -2).finished());
  };
  scene.start = {off(scene.truth.camera_mount_from_camera, 1e-3), off(scene.truth.target_mount_from_target, -1e-3)};
  return scene;
}

BenchCell MakeBenchCell(int num_cameras, int num_captures, int points_a_side) {
  const BenchScene scene = MakeBenchScene(num_captures, points_a_side);
  BenchCell rig;
  Problem& problem = rig.problem;
  problem.robots = {"arm"};
  CellPoses truth;
  truth.world_from_base = {Rigid3d()};
  // The cameras look at one point, 0.6 m in front of the first one.
  const Rigid3d camera_from_middle(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, 0.6));
  for (int c = 0; c < num_cameras; ++c) {
    const Rigid3d around(ExpRotation({0, 0.2 * c, 0}), Eigen::Vector3d::Zero());
    truth.mount_from_camera.push_back(scene.truth.camera_mount_from_camera * camera_from_middle * around *
                                      Inverse(camera_from_middle));
    problem.cameras.push_back(
        {"camera" + std::to_string(c), {0, Mount::Part::kBase}, scene.problem.camera, BundleOptions().free_intrinsics});
  }
  truth.mount_from_target = {scene.truth.target_mount_from_target};
  const Points3& points = scene.problem.views.front().observations.points_in_target;
  problem.targets.push_back({"plate", {0, Mount::Part::kGripper}, DesignedShape(points)});
  SceneOptions options;
  options.noise_px = kBenchNoisePx;
  options.robot_noise = kBenchRobot;
  std::vector<ArmPoses> arms;
  for (const View& view : scene.problem.views) arms.push_back({view.camera_mount_from_target_mount});
  Rng rng(4);
  problem.captures = SimulateCaptures(problem, truth, {{points, false}}, arms, options, rng);
  for (const ProblemCapture& capture : problem.captures) {
    for (const ProblemImage& image : capture.images) rig.num_observations += image.observations.size();
  }
  const auto off = [](const Rigid3d& pose) {
    return Retract(pose, 1e-3 * (Tangent6() << 2, -1, 1, 3, 2, -2).finished());
  };
  rig.start = truth;
  for (Rigid3d& pose : rig.start.mount_from_camera) pose = off(pose);
  for (Rigid3d& pose : rig.start.mount_from_target) pose = off(pose);
  return rig;
}

BenchScene WithArmEffects(BenchScene scene) {
  const Arm& arm = *FindArm("ur5e");
  Rng rng(3);
  for (View& view : scene.problem.views) {
    Eigen::VectorXd joints(arm.num_joints());
    for (double& joint : joints) joint = rng.Uniform(-kPi, kPi);
    view.effect = MakeArmEffect(arm, joints, {});
    view.gripper_by_joints = GripperByJoints(arm, joints, {});
  }
  return scene;
}

std::vector<PosePair> NoisyPairsOf(const BenchScene& scene) {
  std::vector<PosePair> pairs;
  Rng rng(2);
  for (const View& view : scene.problem.views) {
    PosePair pair;
    pair.camera_mount_from_target_mount = view.camera_mount_from_target_mount;
    pair.camera_from_target =
        WithRobotNoise(CameraFromTarget(scene.truth, view.camera_mount_from_target_mount), 3e-4, 2e-4, rng);
    pair.covariance_at_1px = Eigen::Matrix<double, 6, 6>::Identity();
    pairs.push_back(pair);
  }
  return pairs;
}

PairCalibrationOptions BenchCalibrationOptions(const BenchScene& scene) {
  PairCalibrationOptions options;
  for (const HandEyeMethod& method : HandEyeMethods()) {
    if (method.motion == MethodMotion::kAny) options.methods.emplace_back(method.name);
  }
  options.camera_model = scene.problem.camera.model;
  options.width_px = scene.problem.camera.width_px;
  options.height_px = scene.problem.camera.height_px;
  return options;
}

StudyCell MakeBenchStudyCell(bool has_robot_noise) {
  const BenchScene scene = MakeBenchScene(15, 2);
  StudyCell cell;
  cell.problem = HandEyeProblem(scene.problem.setup, scene.problem.camera, scene.problem.shape);
  cell.poses = HandEyePosesOf(scene.truth);
  cell.targets = {{scene.problem.views.front().observations}};
  for (const View& view : scene.problem.views) {
    cell.captures.push_back({{CaptureRole::kNone, CameraFromTarget(scene.truth, view.camera_mount_from_target_mount)}});
  }
  cell.pixel_sigma_px = kBenchNoisePx;
  cell.options = BenchCalibrationOptions(scene);
  if (has_robot_noise) {
    cell.robot_noise = kBenchRobot;
    cell.options.bundle.robot = BundleOptions::Robot::kEstimatedNoise;
  }
  return cell;
}

}  // namespace heba
