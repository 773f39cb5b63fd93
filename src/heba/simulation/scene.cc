#include "heba/simulation/scene.h"

#include <algorithm>
#include <cmath>

#include "heba/base/text.h"
#include "heba/base/units.h"

namespace heba {
namespace {

// A camera and a target that `robot` moves against each other, while all other arms that move them have a pose.
struct Meeting {
  size_t camera = 0;
  size_t target = 0;
};

std::vector<Meeting> MeetingsOf(const Problem& rig, size_t robot) {
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

std::string MotionOptions::Check() const {
  std::vector<std::string> faults;
  if (num_captures < 0) faults.emplace_back("the number of captures must not be negative");
  if (!(distance_m > 0)) faults.emplace_back("the distance must be greater than zero");
  if (!(depth_ratio >= 0 && depth_ratio < 1)) faults.emplace_back("the depth ratio must be in [0, 1)");
  if (!(max_tilt_rad >= 0 && max_tilt_rad < DegToRad(85))) faults.emplace_back("the tilt must be in [0, 85) deg");
  if (!(spread >= 0 && spread <= 1)) faults.emplace_back("the spread must be in [0, 1]");
  return Join(faults, "; ");
}

bool AreInImage(const Camera& camera, const Rigid3d& camera_from_target, const Points3& points_in_target,
                double margin_px) {
  const Points3 points =
      (camera_from_target.RotationMatrix() * points_in_target).colwise() + camera_from_target.translation;
  Points2 pixels;
  if (!camera.Model().Project(camera.params.data(), points, &pixels, nullptr)) return false;
  if (!(pixels.row(0).minCoeff() >= margin_px && pixels.row(0).maxCoeff() <= camera.width_px - 1 - margin_px &&
        pixels.row(1).minCoeff() >= margin_px && pixels.row(1).maxCoeff() <= camera.height_px - 1 - margin_px)) {
    return false;
  }
  // Strong distortion can fold distant rays back into the image. A point is visible only if its pixel unprojects to the
  // same ray.
  for (Eigen::Index i = 0; i < pixels.cols(); ++i) {
    const std::optional<Eigen::Vector3d> ray = UnprojectPixel(camera, pixels.col(i));
    if (!ray || ray->cross(points.col(i).normalized()).norm() > 1e-6) return false;
  }
  return true;
}

Outcome<std::vector<Rigid3d>> SimulatePoses(const Camera& camera, const Points3& points_in_target, bool z_out,
                                            const MotionOptions& options, Rng& rng) {
  const std::string faults = options.Check();
  CHECK(faults.empty()) << faults;
  const Eigen::Vector3d middle = points_in_target.rowwise().mean();
  // The target appears upright from straight ahead.
  const Eigen::Quaterniond upright = ExpRotation(z_out ? Eigen::Vector3d(kPi, 0, 0) : Eigen::Vector3d::Zero());
  std::vector<Rigid3d> poses;
  constexpr int kMaxTrials = 2000;
  for (int trial = 0; static_cast<int>(poses.size()) < options.num_captures; ++trial) {
    if (trial == kMaxTrials * options.num_captures) {
      return Failure{
          "the target does not fit into the image from such poses; a larger distance or a smaller spread or "
          "tilt is needed"};
    }
    const double depth_m = options.distance_m * (1 + options.depth_ratio * rng.Uniform(-1, 1));
    const double u = 0.5 * (camera.width_px - 1) + 0.5 * options.spread * camera.width_px * rng.Uniform(-1, 1);
    const double v = 0.5 * (camera.height_px - 1) + 0.5 * options.spread * camera.height_px * rng.Uniform(-1, 1);
    const double azimuth = rng.Uniform(-kPi, kPi);
    const double tilt = options.max_tilt_rad * rng.Uniform(0.3, 1);
    const double spin = options.max_spin_rad * rng.Uniform(-1, 1);
    const std::optional<Eigen::Vector3d> ray = UnprojectPixel(camera, {u, v});
    if (!ray || ray->z() < 0.05) continue;
    const Eigen::Vector3d middle_in_camera = *ray * (depth_m / ray->z());
    const Eigen::Quaterniond to_sight = RotationOnto(Eigen::Vector3d::UnitZ(), *ray);
    const Eigen::Quaterniond rotation = to_sight *
                                        ExpRotation(tilt * Eigen::Vector3d(std::cos(azimuth), std::sin(azimuth), 0)) *
                                        ExpRotation({0, 0, spin}) * upright;
    const Rigid3d camera_from_target(rotation, middle_in_camera - rotation * middle);
    if (AreInImage(camera, camera_from_target, points_in_target, options.margin_px))
      poses.push_back(camera_from_target);
  }
  return poses;
}

std::string TwoStepMotionOptions::Check() const {
  std::vector<std::string> faults;
  if (!(translation_m > 0)) faults.emplace_back("the translation must be greater than zero");
  if (num_turns < 2) faults.emplace_back("at least two turns are needed");
  if (!(max_turn_rad > 0 && max_turn_rad < DegToRad(85))) faults.emplace_back("turns must be in (0, 85) deg");
  return Join(faults, "; ");
}

Outcome<std::vector<SimulatedPose>> SimulateTwoStepPoses(Setup setup, const Camera& camera,
                                                         const Points3& points_in_target, bool z_out,
                                                         const HandEye& hand_eye, const MotionOptions& home,
                                                         const TwoStepMotionOptions& options, Rng& rng) {
  const std::string faults = options.Check();
  CHECK(faults.empty()) << faults;
  MotionOptions near_axis = home;
  near_axis.num_captures = 1;
  near_axis.spread = std::min(home.spread, 0.2);
  near_axis.max_tilt_rad = std::min(home.max_tilt_rad, DegToRad(10));
  near_axis.depth_ratio = 0;
  constexpr int kMaxTrials = 2000;
  for (int trial = 0; trial < kMaxTrials; ++trial) {
    const Outcome<std::vector<Rigid3d>> start = SimulatePoses(camera, points_in_target, z_out, near_axis, rng);
    if (!start) return Failure{start.reason()};
    const Rigid3d base_from_home = BaseFromGripper(setup, CameraMountFromTargetMount(hand_eye, start->front()));
    // Returns camera_from_target after a motion in the tool's frame; nothing if the target leaves the image.
    const auto moved = [&](const Rigid3d& home_from_gripper) -> std::optional<Rigid3d> {
      const Rigid3d camera_from_target =
          CameraFromTarget(hand_eye, CameraMountFromTargetMount(setup, base_from_home * home_from_gripper));
      if (!AreInImage(camera, camera_from_target, points_in_target, home.margin_px)) return std::nullopt;
      return camera_from_target;
    };
    std::vector<SimulatedPose> poses = {{CaptureRole::kHome, start->front()}};
    for (const int axis : {0, 1}) {
      for (const double sign : {1.0, -1.0}) {
        const std::optional<Rigid3d> pose =
            moved({Eigen::Quaterniond::Identity(), sign * options.translation_m * Eigen::Vector3d::Unit(axis)});
        if (!pose) continue;
        poses.push_back({axis == 0 ? CaptureRole::kTranslateX : CaptureRole::kTranslateY, *pose});
        break;
      }
    }
    if (poses.size() < 3) continue;
    for (int attempt = 0; attempt < kMaxTrials && static_cast<int>(poses.size()) < 3 + options.num_turns; ++attempt) {
      const double angle = options.max_turn_rad * rng.Uniform(0.4, 1);
      const std::optional<Rigid3d> pose = moved({ExpRotation(angle * rng.Direction3()), Eigen::Vector3d::Zero()});
      if (pose) poses.push_back({CaptureRole::kRotate, *pose});
    }
    if (static_cast<int>(poses.size()) == 3 + options.num_turns) return poses;
  }
  return Failure{
      "the target does not stay in the image during the two translations and the rotations about the tool point; "
      "shorter "
      "or smaller ones, or a larger distance, are needed"};
}

Rigid3d CameraMountFromTargetMount(const HandEye& hand_eye, const Rigid3d& camera_from_target) {
  return hand_eye.camera_mount_from_camera * camera_from_target * Inverse(hand_eye.target_mount_from_target);
}

Rigid3d WithRobotNoise(const Rigid3d& base_from_gripper, double rotation_sigma_rad, double translation_sigma_m,
                       Rng& rng) {
  Tangent6 tangent;
  tangent.head<3>() = translation_sigma_m * rng.NormalVector3();
  tangent.tail<3>() = rotation_sigma_rad * rng.NormalVector3();
  return Retract(base_from_gripper, tangent);
}

std::optional<View> SimulateView(const std::string& name, const Camera& camera, const HandEye& hand_eye,
                                 const Rigid3d& camera_mount_from_target_mount, const Points3& points_in_target,
                                 double noise_sigma_px, Rng& rng) {
  const Rigid3d camera_from_target = CameraFromTarget(hand_eye, camera_mount_from_target_mount);
  View view;
  view.name = name;
  view.camera_mount_from_target_mount = camera_mount_from_target_mount;
  view.observations.points_in_target = points_in_target;
  const Points3 points =
      (camera_from_target.RotationMatrix() * points_in_target).colwise() + camera_from_target.translation;
  if (!camera.Model().Project(camera.params.data(), points, &view.observations.pixels, nullptr)) return std::nullopt;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    view.observations.ids.push_back(static_cast<int>(i));
    view.observations.pixels(0, i) += noise_sigma_px * rng.Normal();
    view.observations.pixels(1, i) += noise_sigma_px * rng.Normal();
  }
  return view;
}

Outcome<std::vector<ArmPoses>> SimulateArmPoses(const Problem& rig, const CellPoses& poses,
                                                const std::vector<SimulatedTarget>& targets,
                                                const SceneOptions& options, Rng& rng) {
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
        step << kHomeM * rng.NormalVector3(), options.motion.max_tilt_rad * rng.NormalVector3();
        arms[r] = Retract(arms[r], step);
        continue;
      }
      const auto drawn = static_cast<size_t>(rng.Uniform(0, static_cast<double>(meetings[r].size())));
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

Rigid3d ReportedPose(const Rigid3d& exact, const RobotNoise& noise, Rng& rng) {
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

std::vector<ProblemCapture> SimulateCaptures(const Problem& rig, const CellPoses& poses,
                                             const std::vector<SimulatedTarget>& targets,
                                             const std::vector<ArmPoses>& arm_poses, const SceneOptions& options,
                                             Rng& rng) {
  std::vector<ProblemCapture> captures;
  for (size_t i = 0; i < arm_poses.size(); ++i) {
    ProblemCapture& capture = captures.emplace_back();
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
