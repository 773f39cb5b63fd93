#include "tools/pipeline/scene_captures.h"

#include <optional>
#include <string>
#include <utility>

#include "heba/base/rng.h"
#include "heba/data/setup.h"
#include "heba/simulation/arm_motion.h"

namespace heba {
namespace {

// Returns an arm with errors drawn at random.
SimulatedArm DrawArm(const SceneArm& arm, Rng& rng) {
  return {arm.nominal, DrawArmErrors(arm.nominal, arm.sigmas, rng), arm.tip_from_gripper,
          arm.has_several_configurations, arm.joint_noise_rad};
}

// Returns the first `num_captures` of these captures of the short form that its arm reaches, with the poses that it
// reports and the views that it has there. Returns a Failure if it does not reach as many.
Outcome<SceneCaptures> WithArm(const SceneConfig& scene, const std::vector<SceneCapture>& wanted_captures,
                               size_t num_captures, Rng& rng) {
  const SimulatedArm arm = DrawArm(*scene.arms[0], rng);
  const Arm actual = WithChanges(arm.nominal, arm.errors);
  const HandEye hand_eye = HandEyeOf(scene);
  const RobotNoise& noise = scene.options.robot_noise;
  SceneCaptures drawn{{}, {arm.errors}};
  std::optional<Eigen::VectorXd> first;
  for (size_t i = 0; i < wanted_captures.size() && drawn.captures.size() < num_captures; ++i) {
    const Rigid3d wanted = BaseFromGripper(
        *scene.setup, CameraMountFromTargetMount(hand_eye, wanted_captures[i].camera_from_target[0][0]));
    const std::optional<Reached> reached = Reach(arm, actual, wanted, first, rng);
    if (!reached) continue;
    if (!first) first = reached->joints;
    const Rigid3d mount = CameraMountFromTargetMount(*scene.setup, reached->exact);
    drawn.captures.push_back({wanted_captures[i].role,
                              {{CameraFromTarget(hand_eye, mount)}},
                              {WithRobotNoise(reached->stated, noise.rotation_rad, noise.translation_m, rng)},
                              {reached->joints}});
  }
  if (drawn.captures.size() < num_captures) {
    return Failure{"the arm " + arm.nominal.name + " reaches only " + std::to_string(drawn.captures.size()) + " of " +
                   std::to_string(wanted_captures.size()) + " poses from which the camera sees the target; " +
                   std::to_string(num_captures) + " are needed: change hand_eye, board or motion"};
  }
  return drawn;
}

// Draws the captures of the short form: the views first, then the noise of the poses, then the arm.
Outcome<SceneCaptures> DrawShortForm(const SceneConfig& scene, Rng& rng) {
  // The poses that are drawn for one that an arm must reach.
  constexpr int kPosesPerReached = 4;
  SceneConfig larger = scene;
  if (scene.arms[0]) larger.options.motion.num_captures *= kPosesPerReached;
  const Outcome<std::vector<SimulatedPose>> poses = SimulateScenePoses(larger, rng);
  if (!poses) return poses.failure();
  const RobotNoise& noise = scene.options.robot_noise;
  SceneCaptures drawn{{}, {Eigen::VectorXd()}};
  for (const SimulatedPose& pose : *poses) {
    const Rigid3d exact =
        BaseFromGripper(*scene.setup, CameraMountFromTargetMount(HandEyeOf(scene), pose.camera_from_target));
    drawn.captures.push_back({pose.role,
                              {{pose.camera_from_target}},
                              {WithRobotNoise(exact, noise.rotation_rad, noise.translation_m, rng)},
                              {Eigen::VectorXd()}});
  }
  if (!scene.arms[0]) return drawn;
  return WithArm(scene, drawn.captures, static_cast<size_t>(scene.options.motion.num_captures), rng);
}

// Draws the captures of named cameras: the errors of the arms first, then their motion, then the noise of the poses.
Outcome<SceneCaptures> DrawNamed(const SceneConfig& scene, Rng& rng) {
  const Problem& problem = scene.problem;
  SceneCaptures drawn;
  std::vector<std::optional<SimulatedArm>> arms(scene.arms.size());
  for (size_t r = 0; r < arms.size(); ++r) {
    if (scene.arms[r]) arms[r] = DrawArm(*scene.arms[r], rng);
    drawn.arm_errors.push_back(arms[r] ? arms[r]->errors : Eigen::VectorXd());
  }
  const Outcome<ArmMotion> motion =
      SimulateArmMotion(problem, scene.poses, SimulatedTargets(scene), scene.options, arms, rng);
  if (!motion) return motion.failure();
  for (size_t i = 0; i < motion->exact.size(); ++i) {
    SceneCapture& capture = drawn.captures.emplace_back();
    capture.joints = motion->joints[i];
    for (size_t c = 0; c < problem.cameras.size(); ++c) {
      std::vector<Rigid3d>& camera_from_target = capture.camera_from_target.emplace_back();
      for (size_t t = 0; t < problem.targets.size(); ++t) {
        camera_from_target.push_back(CameraFromTarget(problem, scene.poses, c, t, motion->exact[i]));
      }
    }
  }
  for (size_t r = 0; r < arms.size(); ++r) {
    for (size_t i = 0; i < motion->stated.size(); ++i) {
      drawn.captures[i].reported.push_back(ReportedPose(motion->stated[i][r], scene.options.robot_noise, rng));
    }
  }
  return drawn;
}

}  // namespace

Outcome<SceneCaptures> DrawSceneCaptures(const SceneConfig& scene) {
  Rng rng(scene.seed);
  const Outcome<SceneCaptures> once = scene.setup ? DrawShortForm(scene, rng) : DrawNamed(scene, rng);
  if (!once) return once;
  SceneCaptures drawn{{}, once->arm_errors};
  for (const SceneCapture& capture : once->captures) {
    drawn.captures.insert(drawn.captures.end(), static_cast<size_t>(scene.num_repeats), capture);
  }
  for (const CameraMotion& motion : scene.camera_motions) {
    for (size_t i = motion.first_capture; i < drawn.captures.size(); ++i) {
      for (Rigid3d& camera_from_target : drawn.captures[i].camera_from_target[motion.camera]) {
        camera_from_target = Inverse(motion.before_from_after) * camera_from_target;
      }
    }
  }
  const size_t num_captures = drawn.captures.size();
  for (const CameraCreep& creep : scene.camera_creeps) {
    for (size_t i = 0; i + 1 < num_captures; ++i) {
      const double left = static_cast<double>(num_captures - 1 - i) / static_cast<double>(num_captures - 1);
      const Rigid3d last_from_then = Retract(Rigid3d(), -left * creep.change);
      for (Rigid3d& camera_from_target : drawn.captures[i].camera_from_target[creep.camera]) {
        camera_from_target = Inverse(last_from_then) * camera_from_target;
      }
    }
  }
  return drawn;
}

}  // namespace heba
