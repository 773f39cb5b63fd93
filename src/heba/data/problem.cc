#include "heba/data/problem.h"

#include <utility>

#include "heba/base/error.h"

namespace heba {

std::optional<Mount> FindMount(const std::vector<std::string>& robots, const std::string& text) {
  if (text == "world") return Mount{0, Mount::Part::kBase};
  for (size_t r = 0; r < robots.size(); ++r) {
    for (const auto& [name, part] :
         {std::pair{"base", Mount::Part::kBase}, std::pair{"gripper", Mount::Part::kGripper}}) {
      if (text == robots[r] + "." + name || (robots.size() == 1 && text == name)) return Mount{r, part};
    }
  }
  return std::nullopt;
}

std::vector<std::string> MountTexts(const std::vector<std::string>& robots) {
  std::vector<std::string> texts = {"world"};
  if (robots.size() == 1) {
    texts.insert(texts.end(), {"base", "gripper"});
    return texts;
  }
  for (const std::string& robot : robots) texts.insert(texts.end(), {robot + ".base", robot + ".gripper"});
  return texts;
}

std::string MountText(const std::vector<std::string>& robots, const Mount& mount) {
  const bool is_gripper = mount.part == Mount::Part::kGripper;
  const std::string part = is_gripper ? "gripper" : "base";
  if (robots.size() == 1) return part;
  return !is_gripper && mount.robot == 0 ? "world" : robots[mount.robot] + "." + part;
}

std::string MountText(const Problem& problem, const ProblemCamera& camera) {
  return camera.mount_name.empty() ? MountText(problem.robots, camera.mount) : camera.mount_name;
}

std::string MountText(const Problem& problem, const ProblemTarget& target) {
  return target.mount_name.empty() ? MountText(problem.robots, target.mount) : target.mount_name;
}

bool MovesAgainst(const Mount& a, const Mount& b) {
  const bool has_gripper = a.part == Mount::Part::kGripper || b.part == Mount::Part::kGripper;
  return has_gripper && !(a == b);
}

bool IsMovedBy(const Mount& a, const Mount& b, size_t robot) {
  const Mount gripper{robot, Mount::Part::kGripper};
  return (a == gripper) != (b == gripper);
}

Rigid3d WorldFromMount(const Mount& mount, const std::vector<Rigid3d>& world_from_base,
                       const std::vector<Rigid3d>& base_from_gripper) {
  const Rigid3d& base = world_from_base[mount.robot];
  return mount.part == Mount::Part::kBase ? base : base * base_from_gripper[mount.robot];
}

Rigid3d CameraFromTarget(const Problem& problem, const CellPoses& poses, size_t camera, size_t target,
                         const std::vector<Rigid3d>& base_from_gripper) {
  const Rigid3d world_from_camera =
      WorldFromMount(problem.cameras[camera].mount, poses.world_from_base, base_from_gripper) *
      poses.mount_from_camera[camera];
  const Rigid3d world_from_target =
      WorldFromMount(problem.targets[target].mount, poses.world_from_base, base_from_gripper) *
      poses.mount_from_target[target];
  return Inverse(world_from_camera) * world_from_target;
}

const SharedEffects* EffectsOf(const Problem& problem, size_t robot) {
  return problem.effects.empty() ? nullptr : problem.effects[robot].get();
}

Rigid3d PoseOfArm(const Problem& problem, const CellPoses& poses, size_t camera, size_t target, size_t robot,
                  const std::vector<Rigid3d>& base_from_gripper, const Rigid3d& camera_from_target) {
  const Mount& camera_mount = problem.cameras[camera].mount;
  const Mount& target_mount = problem.targets[target].mount;
  const auto world_from = [&](const Mount& mount) {
    return WorldFromMount(mount, poses.world_from_base, base_from_gripper);
  };
  const Rigid3d base_from_world = Inverse(poses.world_from_base[robot]);
  if (target_mount == Mount{robot, Mount::Part::kGripper}) {
    const Rigid3d world_from_camera = world_from(camera_mount) * poses.mount_from_camera[camera];
    return base_from_world * world_from_camera * camera_from_target * Inverse(poses.mount_from_target[target]);
  }
  const Rigid3d world_from_target = world_from(target_mount) * poses.mount_from_target[target];
  return base_from_world * world_from_target * Inverse(poses.mount_from_camera[camera] * camera_from_target);
}

std::vector<Rigid3d> WithErrors(const ProblemCapture& capture, const std::vector<Eigen::VectorXd>& effects) {
  std::vector<Rigid3d> poses = capture.base_from_gripper;
  for (size_t r = 0; r < poses.size() && !effects.empty() && !capture.effects.empty(); ++r) {
    if (capture.effects[r] != nullptr) poses[r] = poses[r] * capture.effects[r]->Evaluate(effects[r], nullptr);
  }
  return poses;
}

std::vector<Rigid3d> TargetPosesOf(const Problem& problem, const CellPoses& poses,
                                   const std::vector<Eigen::VectorXd>& effects, size_t camera) {
  std::vector<Rigid3d> camera_from_target;
  for (const ProblemCapture& capture : problem.captures) {
    for (const ProblemImage& image : capture.images) {
      if (image.camera != camera || image.observations.size() == 0) continue;
      camera_from_target.push_back(
          CameraFromTarget(problem, poses, image.camera, image.target, WithErrors(capture, effects)));
    }
  }
  return camera_from_target;
}

std::vector<Rigid3d> Corrected(const std::vector<Rigid3d>& base_from_gripper, const std::vector<Rigid3d>& corrections) {
  if (corrections.empty()) return base_from_gripper;
  CHECK_EQ(corrections.size(), base_from_gripper.size());
  std::vector<Rigid3d> corrected;
  for (size_t r = 0; r < corrections.size(); ++r) corrected.push_back(base_from_gripper[r] * corrections[r]);
  return corrected;
}

}  // namespace heba
