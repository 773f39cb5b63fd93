#include "heba/data/rig_solution.h"

#include <algorithm>

#include "heba/data/free_parameters.h"

namespace heba {
namespace {

// A camera, target or base: its name, its mount, and its pose in the mount.
struct Placed {
  std::string name;
  Mount mount;
  PoseByUnknowns mount_from_placed;
};

std::vector<RelativePose> RelativePoses(const std::vector<Placed>& placed, const RigProblem& problem,
                                        const RigSolution& solution) {
  const UnknownLayout& layout = solution.covariance.layout;
  // The bases cancel for two that are on one gripper.
  const auto root_from = [&](const Placed& one) {
    if (one.mount.part == Mount::Part::kGripper) return one.mount_from_placed;
    return UnknownPose(solution.poses.world_from_base[one.mount.robot], layout,
                       BaseBlock(problem.robots[one.mount.robot])) *
           one.mount_from_placed;
  };
  std::vector<RelativePose> relative;
  for (size_t a = 0; a < placed.size(); ++a) {
    for (size_t b = a + 1; b < placed.size(); ++b) {
      if (MovesAgainst(placed[a].mount, placed[b].mount)) continue;
      const PoseByUnknowns a_from_b = Inverse(root_from(placed[a])) * root_from(placed[b]);
      relative.push_back({placed[a].name, placed[b].name, a_from_b.pose,
                          a_from_b.by_unknowns * solution.covariance.matrix * a_from_b.by_unknowns.transpose()});
    }
  }
  return relative;
}

}  // namespace

std::string CameraPoseBlock(const RigCamera& camera) { return "cameras." + camera.name + ".pose"; }
std::string CameraBlock(const RigCamera& camera) { return "cameras." + camera.name + ".camera"; }
std::string TargetPoseBlock(const RigTarget& target) { return "targets." + target.name + ".pose"; }
std::string TargetShapeBlock(const RigTarget& target) { return "targets." + target.name + ".shape"; }
std::string BaseBlock(const std::string& robot) { return "robots." + robot + ".world_from_base"; }

UnknownLayout RigUnknowns(const RigProblem& problem) {
  UnknownLayout layout;
  for (const RigCamera& camera : problem.cameras) {
    layout.AddPose(CameraPoseBlock(camera), "camera " + camera.name + "'s", "the camera's");
  }
  for (const RigTarget& target : problem.targets) {
    layout.AddPose(TargetPoseBlock(target), "target " + target.name + "'s", "the target's");
  }
  for (size_t r = 1; r < problem.robots.size(); ++r) {
    layout.AddPose(BaseBlock(problem.robots[r]), "arm " + problem.robots[r] + "'s", "its base's");
  }
  for (const RigCamera& camera : problem.cameras) {
    const CameraModel& model = camera.camera.Model();
    layout.AddCamera(CameraBlock(camera), "camera " + camera.name + "'s", model, FreeOf(model, camera.free_intrinsics));
  }
  for (const RigTarget& target : problem.targets) {
    std::vector<bool> free;
    for (int i = 0; i < TargetShape::kNumParams && !target.free_shape.empty(); ++i) {
      free.push_back(std::count(target.free_shape.begin(), target.free_shape.end(), ShapeGroupOf(i)) > 0);
    }
    layout.AddTarget(TargetShapeBlock(target), "target " + target.name + "'s", free);
  }
  return layout;
}

PoseByUnknowns UnknownPose(const Rigid3d& pose, const UnknownLayout& layout, const std::string& block) {
  const UnknownBlock unknowns = layout.Block(block);
  PoseByUnknowns result{pose, Matrix6X::Zero(6, layout.size())};
  if (unknowns.size == 6) result.by_unknowns.middleCols<6>(unknowns.first).setIdentity();
  return result;
}

PoseByUnknowns Inverse(const PoseByUnknowns& a_from_b) {
  // (T Exp(xi))^-1 = Exp(-xi) T^-1 = T^-1 Exp(-Ad(T) xi).
  return {Inverse(a_from_b.pose), -Adjoint(a_from_b.pose) * a_from_b.by_unknowns};
}

PoseByUnknowns operator*(const PoseByUnknowns& a_from_b, const PoseByUnknowns& b_from_c) {
  return {a_from_b.pose * b_from_c.pose, Adjoint(Inverse(b_from_c.pose)) * a_from_b.by_unknowns + b_from_c.by_unknowns};
}

std::vector<RelativePose> RelativeCameraPoses(const RigProblem& problem, const RigSolution& solution) {
  std::vector<Placed> placed;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const RigCamera& camera = problem.cameras[c];
    placed.push_back(
        {camera.name, camera.mount,
         UnknownPose(solution.poses.mount_from_camera[c], solution.covariance.layout, CameraPoseBlock(camera))});
  }
  return RelativePoses(placed, problem, solution);
}

std::vector<RelativePose> RelativeTargetPoses(const RigProblem& problem, const RigSolution& solution) {
  std::vector<Placed> placed;
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    const RigTarget& target = problem.targets[t];
    placed.push_back(
        {target.name, target.mount,
         UnknownPose(solution.poses.mount_from_target[t], solution.covariance.layout, TargetPoseBlock(target))});
  }
  return RelativePoses(placed, problem, solution);
}

std::vector<RelativePose> RelativeBasePoses(const RigProblem& problem, const RigSolution& solution) {
  std::vector<Placed> placed;
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    placed.push_back(
        {problem.robots[r], {r, Mount::Part::kBase}, UnknownPose(Rigid3d(), solution.covariance.layout, "")});
  }
  return RelativePoses(placed, problem, solution);
}

}  // namespace heba
