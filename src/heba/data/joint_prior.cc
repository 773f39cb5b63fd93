#include "heba/data/joint_prior.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "heba/base/factorisation.h"
#include "heba/data/same_object.h"

namespace heba {
namespace {

// The names of blocks in the problem, by those of the earlier one.
std::map<std::string, std::string> RenamedBlocks(const Problem& earlier, const Problem& problem, bool is_target_moved) {
  std::map<std::string, std::string> renamed;
  const auto is_same_arm = [&](size_t of_earlier, size_t other) {
    return (earlier.robots.size() == 1 && problem.robots.size() == 1) ||
           earlier.robots[of_earlier] == problem.robots[other];
  };
  const auto is_same_mount = [&](const Mount& of_earlier, const Mount& other) {
    return of_earlier.part == other.part && is_same_arm(of_earlier.robot, other.robot);
  };
  for (const ProblemCamera& camera : earlier.cameras) {
    const std::optional<size_t> c = PlaceOfSame(camera.name, earlier.cameras.size(), problem.cameras);
    if (!c || !is_same_mount(camera.mount, problem.cameras[*c].mount)) continue;
    renamed[CameraPoseBlock(camera)] = CameraPoseBlock(problem.cameras[*c]);
    renamed[CameraBlock(camera)] = CameraBlock(problem.cameras[*c]);
  }
  for (const ProblemTarget& target : earlier.targets) {
    const std::optional<size_t> t = PlaceOfSame(target.name, earlier.targets.size(), problem.targets);
    if (!t || !is_same_mount(target.mount, problem.targets[*t].mount)) continue;
    if (!is_target_moved) renamed[TargetPoseBlock(target)] = TargetPoseBlock(problem.targets[*t]);
    renamed[TargetShapeBlock(target)] = TargetShapeBlock(problem.targets[*t]);
  }
  // The world is the base of the first arm.
  for (const std::string& robot : is_same_arm(0, 0) ? earlier.robots : std::vector<std::string>()) {
    const bool is_known = std::find(problem.robots.begin(), problem.robots.end(), robot) != problem.robots.end();
    if (is_known) renamed[BaseBlock(robot)] = BaseBlock(robot);
  }
  return renamed;
}

// Returns the flags of the parameters of a block that are unknown.
std::vector<bool> FlagsOf(const UnknownLayout& layout, const UnknownBlock& block, size_t num_params) {
  std::vector<bool> flags(num_params, false);
  for (Eigen::Index i = block.first; i < block.end(); ++i) flags[static_cast<size_t>(layout[i].index)] = true;
  return flags;
}

// Returns the columns of a positive semidefinite matrix's square root that matter, for unknowns of these sigmas.
std::vector<Eigen::VectorXd> ColumnsOf(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& sigmas) {
  const Eigen::VectorXd inverse = sigmas.cwiseInverse();
  const auto eigen = EigenOfSymmetric(Eigen::MatrixXd(inverse.asDiagonal() * matrix * inverse.asDiagonal()));
  constexpr double kLeast = 1e-6;  // This is a share of a variance.
  std::vector<Eigen::VectorXd> columns;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    const double variance = eigen.values[i];
    if (variance > kLeast) columns.emplace_back(std::sqrt(variance) * sigmas.cwiseProduct(eigen.vectors.col(i)));
  }
  return columns;
}

}  // namespace

JointPrior JointPriorOf(const Problem& earlier, const Solution& solution, const Problem& problem,
                        const ChangeOfCell& change) {
  const UnknownLayout& layout = solution.covariance.layout;
  const std::map<std::string, std::string> renamed = RenamedBlocks(earlier, problem, change.is_target_moved);
  JointPrior prior;
  std::vector<Eigen::Index> places;
  const auto name_of = [&](const std::string& block) {
    const auto found = renamed.find(block);
    return found == renamed.end() ? std::string() : found->second;
  };
  const auto take = [&](const UnknownBlock& block) {
    for (Eigen::Index i = block.first; i < block.end(); ++i) places.push_back(i);
  };
  const auto add_pose = [&](const std::string& block, const Rigid3d& pose) {
    const std::string name = name_of(block);
    if (name.empty() || layout.Block(block).size == 0) return;
    prior.poses[name] = pose;
    prior.covariance.layout.AddPose(name);
    take(layout.Block(block));
  };
  for (size_t c = 0; c < earlier.cameras.size(); ++c) {
    add_pose(CameraPoseBlock(earlier.cameras[c]), solution.poses.mount_from_camera[c]);
  }
  for (size_t t = 0; t < earlier.targets.size(); ++t) {
    add_pose(TargetPoseBlock(earlier.targets[t]), solution.poses.mount_from_target[t]);
  }
  for (size_t r = 1; r < earlier.robots.size(); ++r) {
    add_pose(BaseBlock(earlier.robots[r]), solution.poses.world_from_base[r]);
  }
  for (size_t c = 0; c < earlier.cameras.size(); ++c) {
    const std::string name = name_of(CameraBlock(earlier.cameras[c]));
    const UnknownBlock block = layout.Block(CameraBlock(earlier.cameras[c]));
    if (name.empty() || block.size == 0) continue;
    const Camera& camera = solution.cameras[c];
    prior.params[name] = camera.params;
    prior.covariance.layout.AddCamera(name, camera.Model(), FlagsOf(layout, block, camera.params.size()));
    take(block);
  }
  for (size_t t = 0; t < earlier.targets.size(); ++t) {
    const std::string name = name_of(TargetShapeBlock(earlier.targets[t]));
    const UnknownBlock block = layout.Block(TargetShapeBlock(earlier.targets[t]));
    if (name.empty() || block.size == 0) continue;
    const auto& params = solution.shapes[t].params;
    prior.params[name] = {params.begin(), params.end()};
    prior.covariance.layout.AddTarget(name, FlagsOf(layout, block, params.size()));
    take(block);
  }
  const Eigen::MatrixXd total = solution.covariance.matrix(places, places);
  const bool has_repeatable = solution.covariance_repeatable.matrix.size() > 0;
  Eigen::MatrixXd& matrix = prior.covariance.matrix;
  matrix = has_repeatable ? Eigen::MatrixXd(solution.covariance_repeatable.matrix(places, places)) : total;
  if (places.empty()) return prior;
  if (has_repeatable) prior.of_cell = ColumnsOf(total - matrix, total.diagonal().cwiseSqrt());
  // A direction may be unknown by nothing but what all sessions have in common.
  constexpr double kLeast = 1e-6;  // This is a share of the variance.
  matrix.diagonal() += kLeast * total.diagonal();
  for (const ProblemCamera& camera : problem.cameras) {
    const UnknownBlock pose = prior.covariance.layout.Block(CameraPoseBlock(camera));
    for (Eigen::Index i = 0; i < pose.size; ++i) {
      const double sigma = i < 3 ? change.translation_m : change.rotation_rad;
      matrix(pose.first + i, pose.first + i) += sigma * sigma;
    }
  }
  return prior;
}

}  // namespace heba
