#include "heba/simulation/rig_scene.h"

#include <algorithm>
#include <optional>
#include <string>
#include <utility>

namespace heba {
namespace {

// A camera and a target that `robot` moves against each other, while all other arms that move them have a pose.
struct Meeting {
  size_t camera = 0;
  size_t target = 0;
};

std::vector<Meeting> MeetingsOf(const RigProblem& rig, size_t robot) {
  std::vector<Meeting> meetings;
  const auto is_placed = [&](const Mount& mount) { return mount.part == Mount::Part::kBase || mount.robot <= robot; };
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    for (size_t t = 0; t < rig.targets.size(); ++t) {
      const Mount& camera = rig.cameras[c].mount;
      const Mount& target = rig.targets[t].mount;
      if (IsMovedBy(camera, target, robot) && is_placed(camera) && is_placed(target)) meetings.push_back({c, t});
    }
  }
  return meetings;
}

}  // namespace

Outcome<std::vector<ArmPoses>> SimulateArmPoses(const RigProblem& rig, const RigPoses& poses,
                                                const std::vector<SimulatedTarget>& targets,
                                                const RigSceneOptions& options, Rng* rng) {
  std::vector<std::vector<Meeting>> meetings;
  for (size_t r = 0; r < rig.robots.size(); ++r) meetings.push_back(MeetingsOf(rig, r));
  MotionOptions one = options.motion;
  one.num_captures = 1;
  std::vector<ArmPoses> all;
  for (int i = 0; i < options.motion.num_captures; ++i) {
    ArmPoses& arms = all.emplace_back(options.homes);
    arms.resize(rig.robots.size());
    for (size_t r = 0; r < rig.robots.size(); ++r) {
      if (meetings[r].empty()) {
        constexpr double kHomeM = 0.1;
        Tangent6 step;
        step << kHomeM * rng->NormalVector3(), options.motion.max_tilt_rad * rng->NormalVector3();
        arms[r] = Retract(arms[r], step);
        continue;
      }
      const auto drawn = static_cast<size_t>(rng->Uniform(0, static_cast<double>(meetings[r].size())));
      const Meeting& meeting = meetings[r][std::min(drawn, meetings[r].size() - 1)];
      const SimulatedTarget& target = targets[meeting.target];
      const Outcome<std::vector<Rigid3d>> seen =
          SimulatePoses(rig.cameras[meeting.camera].camera, target.points_in_target, target.z_out, one, rng);
      if (!seen) return Failure{seen.reason()};
      arms[r] = PoseOfArm(rig, poses, meeting.camera, meeting.target, r, arms, seen->front());
    }
  }
  return all;
}

Rigid3d ReportedPose(const Rigid3d& exact, const RobotNoise& noise, Rng* rng) {
  return exact * Inverse(WithRobotNoise(Rigid3d(), noise.rotation_rad, noise.translation_m, rng));
}

bool IsVisible(const Camera& camera, const Rigid3d& camera_from_target, const SimulatedTarget& target,
               double margin_px) {
  const Eigen::Vector3d middle = camera_from_target * Eigen::Vector3d(target.points_in_target.rowwise().mean());
  const Eigen::Vector3d front = camera_from_target.rotation * Eigen::Vector3d(0, 0, target.z_out ? 1 : -1);
  // A target that is seen from its edge is not detected.
  constexpr double kLeastCosine = 0.2;
  if (-front.dot(middle.normalized()) < kLeastCosine) return false;
  return AreInImage(camera, camera_from_target, target.points_in_target, margin_px);
}

std::vector<RigCapture> SimulateRigCaptures(const RigProblem& rig, const RigPoses& poses,
                                            const std::vector<SimulatedTarget>& targets,
                                            const std::vector<ArmPoses>& arm_poses, const RigSceneOptions& options,
                                            Rng* rng) {
  std::vector<RigCapture> captures;
  for (size_t i = 0; i < arm_poses.size(); ++i) {
    RigCapture& capture = captures.emplace_back();
    capture.name = "capture_" + std::to_string(i);
    for (const Rigid3d& exact : arm_poses[i]) {
      capture.base_from_gripper.push_back(ReportedPose(exact, options.robot_noise, rng));
    }
    for (size_t c = 0; c < rig.cameras.size(); ++c) {
      for (size_t t = 0; t < rig.targets.size(); ++t) {
        const Camera& camera = rig.cameras[c].camera;
        const Rigid3d camera_from_target = CameraFromTarget(rig, poses, c, t, arm_poses[i]);
        if (!IsVisible(camera, camera_from_target, targets[t], options.motion.margin_px)) continue;
        const std::optional<View> view = SimulateView(capture.name, camera, {Rigid3d(), Rigid3d()}, camera_from_target,
                                                      targets[t].points_in_target, options.noise_px, rng);
        if (view) capture.images.push_back({c, t, view->observations});
      }
    }
  }
  return captures;
}

}  // namespace heba
