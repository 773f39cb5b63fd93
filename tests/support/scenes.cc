#include "tests/support/scenes.h"

#include <map>

#include "tests/support/scene_rng.h"

namespace heba {

Points3 GridPoints(int columns, int rows, double spacing_m) {
  Points3 points(3, columns * rows);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      points.col(row * columns + column) << (column - 0.5 * (columns - 1)) * spacing_m,
          (row - 0.5 * (rows - 1)) * spacing_m, 0.0;
    }
  }
  return points;
}

Camera TestCamera(const std::string& model) {
  static const std::map<std::string, std::vector<double>> kDistortion = {
      {"pinhole", {}},
      {"brown4", {-0.08, 0.05, 0.0005, -0.0003}},
      {"brown5", {-0.08, 0.05, 0.0005, -0.0003, 0.0}},
      {"rational8", {-0.08, 0.05, 0.0005, -0.0003, 0.0, 0.01, 0.0, 0.0}},
      {"kannala_brandt4", {0.02, -0.01, 0.003, -0.001}}};
  Camera camera{model, 1600, 1200, {1500, 1502, 805, 595}};
  const auto known = kDistortion.find(model);
  // Other models take the distortion of their last example, with a focal length for which the field of view is about as
  // large.
  const std::vector<double>& example = camera.Model().facts().examples.back().params;
  const std::vector<double> distortion =
      known == kDistortion.end() ? std::vector<double>(example.begin() + 4, example.end()) : known->second;
  camera.params.insert(camera.params.end(), distortion.begin(), distortion.end());
  if (known != kDistortion.end()) return camera;
  const double magnification = AxialFocalLength(camera, 0) / camera.params[0];
  camera.params[0] /= magnification;
  camera.params[1] /= magnification;
  return camera;
}

TestScene MakeTestScene(uint64_t seed, const TestSceneOptions& options) {
  Rng rng = SceneRng(seed);
  TestScene scene;
  scene.camera = options.camera;
  // The camera is 0.7 m from the base or 0.1 m from the flange; the target is on the other mount.
  const Rigid3d far_pose{ExpRotation(rng.Uniform(0.5, 3.1) * rng.Direction3()), 0.7 * rng.Direction3()};
  const Rigid3d near_pose{ExpRotation(rng.Uniform(0, 3.1) * rng.Direction3()), 0.1 * rng.Direction3()};
  const bool to_hand = options.setup == Setup::kEyeToHand;
  scene.hand_eye = {to_hand ? far_pose : near_pose, to_hand ? near_pose : far_pose};
  MotionOptions motion;
  motion.num_captures = options.num_captures;
  motion.distance_m = options.distance_m;
  motion.max_tilt_rad = options.max_tilt_rad;
  std::vector<SimulatedPose> poses;
  if (options.motion == TestSceneOptions::Motion::kTwoStep) {
    TwoStepMotionOptions two_step;
    two_step.num_turns = options.num_captures - 3;
    poses = *SimulateTwoStepPoses(options.setup, scene.camera, options.points, false, scene.hand_eye, motion, two_step,
                                  rng);
  } else {
    const Outcome<std::vector<Rigid3d>> free = SimulatePoses(scene.camera, options.points, false, motion, rng);
    for (const Rigid3d& camera_from_target : *free) poses.push_back({CaptureRole::kNone, camera_from_target});
  }
  TargetShape made = DesignedShape(options.points);
  made.params = options.shape;
  Points3 made_points = options.points;
  for (Eigen::Index i = 0; i < made_points.cols(); ++i) {
    const Eigen::Vector3d designed = options.points.col(i);
    made_points.col(i) = ApplyShape(designed, made);
  }
  for (const auto& [role, camera_from_target] : poses) {
    const Rigid3d mount = CameraMountFromTargetMount(scene.hand_eye, camera_from_target);
    scene.views.push_back(*SimulateView("view_" + std::to_string(scene.views.size()), scene.camera, scene.hand_eye,
                                        mount, made_points, options.noise_px, rng));
    scene.views.back().observations.points_in_target = options.points;
    scene.views.back().role = role;
    scene.pairs.push_back({mount, camera_from_target, role, std::nullopt});
    Tangent6 error;
    error << options.robot_translation_m * rng.NormalVector3(), options.robot_rotation_rad * rng.NormalVector3();
    const Rigid3d gripper_from_stated = Inverse(Retract(Rigid3d(), error));
    scene.views.back().camera_mount_from_target_mount =
        to_hand ? mount * gripper_from_stated : Inverse(gripper_from_stated) * mount;
  }
  return scene;
}

}  // namespace heba
