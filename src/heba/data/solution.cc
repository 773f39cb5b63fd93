#include "heba/data/solution.h"

#include <algorithm>

#include "heba/base/error.h"
#include "heba/data/free_parameters.h"

namespace heba {
namespace {

// A camera, target or base: its name, its mount, and its pose in the world or, if a gripper carries it, in the gripper.
struct Placed {
  std::string name;
  Mount mount;
  PoseByUnknowns root_from_placed;
};

// `block` is the name of the pose among the unknowns; empty if it is none.
Placed Place(const std::string& name, const Mount& mount, const Rigid3d& mount_from_placed, const std::string& block,
             const Problem& problem, const Solution& solution) {
  const UnknownLayout& layout = solution.covariance.layout;
  const PoseByUnknowns in_mount = UnknownPose(mount_from_placed, layout, block);
  if (mount.part == Mount::Part::kGripper) return {name, mount, in_mount};
  return {name, mount,
          UnknownPose(solution.poses.world_from_base[mount.robot], layout, BaseBlock(problem.robots[mount.robot])) *
              in_mount};
}

std::vector<Placed> PlacedCameras(const Problem& problem, const Solution& solution) {
  std::vector<Placed> placed;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const ProblemCamera& camera = problem.cameras[c];
    placed.push_back(Place(camera.name, camera.mount, solution.poses.mount_from_camera[c], CameraPoseBlock(camera),
                           problem, solution));
  }
  return placed;
}

std::vector<Placed> PlacedTargets(const Problem& problem, const Solution& solution) {
  std::vector<Placed> placed;
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    const ProblemTarget& target = problem.targets[t];
    placed.push_back(Place(target.name, target.mount, solution.poses.mount_from_target[t], TargetPoseBlock(target),
                           problem, solution));
  }
  return placed;
}

std::vector<Placed> PlacedBases(const Problem& problem, const Solution& solution) {
  std::vector<Placed> placed;
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    placed.push_back(Place(problem.robots[r], {r, Mount::Part::kBase}, Rigid3d(), "", problem, solution));
  }
  return placed;
}

RelativePose PoseOf(const std::string& parent, const std::string& child, const PoseByUnknowns& parent_from_child,
                    const Solution& solution) {
  return {parent, child, parent_from_child.pose,
          parent_from_child.by_unknowns * solution.covariance.matrix * parent_from_child.by_unknowns.transpose()};
}

std::vector<RelativePose> PosesInRoots(const std::vector<Placed>& placed, const Problem& problem,
                                       const Solution& solution) {
  std::vector<RelativePose> poses;
  for (const Placed& one : placed) {
    const bool is_carried = one.mount.part == Mount::Part::kGripper;
    poses.push_back(
        PoseOf(is_carried ? MountText(problem.robots, one.mount) : "world", one.name, one.root_from_placed, solution));
  }
  return poses;
}

std::vector<RelativePose> RelativePoses(const std::vector<Placed>& placed, const Solution& solution) {
  std::vector<RelativePose> relative;
  for (size_t a = 0; a < placed.size(); ++a) {
    for (size_t b = a + 1; b < placed.size(); ++b) {
      // The bases cancel for two that are on one gripper.
      if (MovesAgainst(placed[a].mount, placed[b].mount)) continue;
      relative.push_back(PoseOf(placed[a].name, placed[b].name,
                                Inverse(placed[a].root_from_placed) * placed[b].root_from_placed, solution));
    }
  }
  return relative;
}

// Returns the name of a block in files: `alone` for the only object of its kind, which has no name.
std::string BlockName(std::string_view alone, const std::string& before, const std::string& name,
                      const std::string& after) {
  return name.empty() ? std::string(alone) : before + name + after;
}

}  // namespace

std::optional<RobotNoise> SmoothNoiseOf(const Solution& solution, size_t robot) {
  return robot < solution.smooth_noise.size() ? solution.smooth_noise[robot] : std::nullopt;
}

std::string CameraPoseBlock(const ProblemCamera& camera) {
  return BlockName(kHandEyeBlock, "cameras.", camera.name, ".pose");
}
std::string CameraBlock(const ProblemCamera& camera) {
  return BlockName(kCameraBlock, "cameras.", camera.name, ".camera");
}
std::string TargetPoseBlock(const ProblemTarget& target) {
  return BlockName(kBoardBlock, "targets.", target.name, ".pose");
}
std::string TargetShapeBlock(const ProblemTarget& target) {
  return BlockName(kTargetBlock, "targets.", target.name, ".shape");
}
std::string BaseBlock(const std::string& robot) { return "robots." + robot + ".world_from_base"; }
std::string ErrorsBlock(const std::string& robot) { return BlockName(kRobotBlock, "robots.", robot, ".errors"); }

UnknownLayout UnknownsOf(const Problem& problem) {
  UnknownLayout layout;
  for (const ProblemCamera& camera : problem.cameras) layout.AddPose(CameraPoseBlock(camera));
  for (const ProblemTarget& target : problem.targets) layout.AddPose(TargetPoseBlock(target));
  for (size_t r = 1; r < problem.robots.size(); ++r) layout.AddPose(BaseBlock(problem.robots[r]));
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    const SharedEffects* const effects = EffectsOf(problem, r);
    if (effects != nullptr) layout.AddEffects(ErrorsBlock(problem.robots[r]), effects->Names());
  }
  for (const ProblemCamera& camera : problem.cameras) {
    if (camera.camera.params.empty()) continue;  // A calibration from poses alone has no camera.
    const CameraModel& model = camera.camera.Model();
    layout.AddCamera(CameraBlock(camera), model, FreeOf(model, camera.free_intrinsics));
  }
  for (const ProblemTarget& target : problem.targets) {
    std::vector<bool> free;
    if (!target.free_shape.empty()) {
      const auto of_shape = FreeShapeOf(target.free_shape);
      free.assign(of_shape.begin(), of_shape.end());
    }
    layout.AddTarget(TargetShapeBlock(target), free);
  }
  return layout;
}

Solution WithEffectsOf(const Problem& problem, Solution solution) {
  const UnknownLayout kept = UnknownsOf(problem);
  std::vector<Eigen::Index> places;
  for (Eigen::Index i = 0; i < kept.size(); ++i) {
    const std::optional<Eigen::Index> place = solution.covariance.layout.Place(kept.Name(i));
    CHECK(place.has_value()) << "the solution is that of another problem";
    places.push_back(*place);
  }
  for (Covariance* const covariance : {&solution.covariance, &solution.covariance_repeatable}) {
    if (covariance->matrix.size() == 0) continue;
    *covariance = {kept, covariance->matrix(places, places)};
  }
  for (size_t r = 0; r < solution.effects.size(); ++r) {
    if (EffectsOf(problem, r) != nullptr) continue;
    solution.effects[r].resize(0);
    solution.effect_sigmas[r].clear();
  }
  return solution;
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

std::vector<RelativePose> CameraPoses(const Problem& problem, const Solution& solution) {
  return PosesInRoots(PlacedCameras(problem, solution), problem, solution);
}

std::vector<RelativePose> TargetPoses(const Problem& problem, const Solution& solution) {
  return PosesInRoots(PlacedTargets(problem, solution), problem, solution);
}

std::vector<RelativePose> BasePoses(const Problem& problem, const Solution& solution) {
  std::vector<RelativePose> poses = PosesInRoots(PlacedBases(problem, solution), problem, solution);
  poses.erase(poses.begin());
  return poses;
}

std::vector<RelativePose> RelativeCameraPoses(const Problem& problem, const Solution& solution) {
  return RelativePoses(PlacedCameras(problem, solution), solution);
}

std::vector<RelativePose> RelativeTargetPoses(const Problem& problem, const Solution& solution) {
  return RelativePoses(PlacedTargets(problem, solution), solution);
}

std::vector<RelativePose> RelativeBasePoses(const Problem& problem, const Solution& solution) {
  return RelativePoses(PlacedBases(problem, solution), solution);
}

}  // namespace heba
