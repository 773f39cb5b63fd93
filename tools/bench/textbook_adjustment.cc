#include "tools/bench/textbook_adjustment.h"

#include <memory>

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include "heba/base/error.h"
#include "heba/geometry/pose_block.h"

namespace heba {
namespace {

template <class T>
using Vector = Eigen::Matrix<T, 3, 1>;

template <class T>
Vector<T> Transform(const T* a_from_b, const Vector<T>& point_in_b) {
  return Eigen::Map<const Eigen::Quaternion<T>>(a_from_b) * point_in_b + Eigen::Map<const Vector<T>>(a_from_b + 4);
}
template <class T>
Vector<T> InverseTransform(const T* a_from_b, const Vector<T>& point_in_a) {
  return Eigen::Map<const Eigen::Quaternion<T>>(a_from_b).conjugate() *
         Vector<T>(point_in_a - Eigen::Map<const Vector<T>>(a_from_b + 4));
}

// A point of a target on a gripper in a camera on a base. A base that is unknown has a block of its own.
struct PointResidual {
  Rigid3d base_from_gripper;
  Eigen::Vector3d point;
  Eigen::Vector2d pixel;
  double sigma_px = 0;

  template <class T>
  Vector<T> InBase(const T* gripper_from_target, const T* correction) const {
    const Vector<T> in_gripper =
        Transform<T>(correction, Transform<T>(gripper_from_target, Vector<T>(point.cast<T>())));
    return base_from_gripper.rotation.cast<T>() * in_gripper + base_from_gripper.translation.cast<T>();
  }

  template <class T>
  bool Project(const Vector<T>& in_camera, const T* camera, T* residual) const {
    const T x = in_camera.x() / in_camera.z();
    const T y = in_camera.y() / in_camera.z();
    const T r2 = x * x + y * y;
    const T radial = T(1) + r2 * (camera[4] + r2 * (camera[5] + r2 * camera[8]));
    const T& p1 = camera[6];
    const T& p2 = camera[7];
    const T u = camera[0] * (x * radial + T(2) * p1 * x * y + p2 * (r2 + T(2) * x * x)) + camera[2];
    const T v = camera[1] * (y * radial + p1 * (r2 + T(2) * y * y) + T(2) * p2 * x * y) + camera[3];
    residual[0] = (u - T(pixel.x())) / T(sigma_px);
    residual[1] = (v - T(pixel.y())) / T(sigma_px);
    return true;
  }

  // The camera's base is that of the target's arm.
  template <class T>
  bool operator()(const T* base_from_camera, const T* gripper_from_target, const T* correction, const T* camera,
                  T* residual) const {
    const Vector<T> in_base = InBase(gripper_from_target, correction);
    return Project(InverseTransform(base_from_camera, in_base), camera, residual);
  }

  // The camera is in the world, which is the base of the first arm.
  template <class T>
  bool operator()(const T* world_from_camera, const T* gripper_from_target, const T* correction, const T* camera,
                  const T* world_from_base, T* residual) const {
    const Vector<T> in_world = Transform<T>(world_from_base, InBase(gripper_from_target, correction));
    return Project(InverseTransform(world_from_camera, in_world), camera, residual);
  }
};

struct CorrectionPrior {
  RobotNoise noise;

  template <class T>
  bool operator()(const T* correction, T* residual) const {
    const T quaternion[4] = {correction[3], correction[0], correction[1], correction[2]};
    ceres::QuaternionToAngleAxis(quaternion, residual + 3);
    for (int i = 0; i < 3; ++i) {
      residual[i] = correction[4 + i] / T(noise.translation_m);
      residual[3 + i] /= T(noise.rotation_rad);
    }
    return true;
  }
};

std::vector<PoseBlock> ToBlocks(const std::vector<Rigid3d>& poses) {
  std::vector<PoseBlock> blocks;
  for (const Rigid3d& pose : poses) blocks.push_back(ToBlock(pose));
  return blocks;
}
std::vector<Rigid3d> FromBlocks(const std::vector<PoseBlock>& blocks) {
  std::vector<Rigid3d> poses;
  for (const PoseBlock& block : blocks) poses.push_back(FromBlock(block.data()));
  return poses;
}

// Returns the cost of a point; `has_base` says whether the base of the target's arm is unknown.
ceres::CostFunction* CostOf(const PointResidual& residual, bool has_base) {
  if (has_base) {
    return new ceres::AutoDiffCostFunction<PointResidual, 2, 7, 7, 7, 9, 7>(new PointResidual(residual));
  }
  return new ceres::AutoDiffCostFunction<PointResidual, 2, 7, 7, 7, 9>(new PointResidual(residual));
}

ceres::Solver::Options SolverOptions(const TextbookCellOptions& rig_options,
                                     const std::shared_ptr<ceres::ParameterBlockOrdering>& ordering) {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.linear_solver_ordering = ordering;
  options.max_num_iterations = rig_options.max_iterations;
  options.function_tolerance = rig_options.function_tolerance;
  options.logging_type = ceres::SILENT;
  return options;
}

}  // namespace

TextbookCellResult RefineCellAsInTextbooks(const Problem& problem, const TextbookCellState& start,
                                           const TextbookCellOptions& rig_options) {
  TextbookCellResult result;
  result.state.cameras = start.cameras;
  std::vector<PoseBlock> cameras = ToBlocks(start.poses.mount_from_camera);
  std::vector<PoseBlock> targets = ToBlocks(start.poses.mount_from_target);
  std::vector<PoseBlock> bases = ToBlocks(start.poses.world_from_base);
  std::vector<std::vector<PoseBlock>> corrections;
  for (const std::vector<Rigid3d>& of_capture : start.corrections) corrections.push_back(ToBlocks(of_capture));

  ceres::Problem ceres_problem;
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  const auto add_pose = [&](PoseBlock* block, int group) {
    if (ordering->IsMember(block->data())) return;
    ceres_problem.AddParameterBlock(
        block->data(), 7, new ceres::ProductManifold<ceres::EigenQuaternionManifold, ceres::EuclideanManifold<3>>);
    ordering->AddElementToGroup(block->data(), group);
  };
  for (size_t i = 0; i < problem.captures.size(); ++i) {
    for (const ProblemImage& image : problem.captures[i].images) {
      const Mount& camera_mount = problem.cameras[image.camera].mount;
      const size_t arm = problem.targets[image.target].mount.robot;
      CHECK(camera_mount.part == Mount::Part::kBase && camera_mount.robot == 0);
      CHECK(problem.targets[image.target].mount.part == Mount::Part::kGripper);
      PoseBlock* const camera = &cameras[image.camera];
      PoseBlock* const target = &targets[image.target];
      PoseBlock* const correction = &corrections[i][arm];
      double* const intrinsics = result.state.cameras[image.camera].params.data();
      if (!ordering->IsMember(correction->data())) {
        add_pose(correction, 0);
        ceres_problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<CorrectionPrior, 6, 7>(new CorrectionPrior{rig_options.robot_noise}),
            nullptr, correction->data());
      }
      add_pose(camera, 1);
      add_pose(target, 1);
      if (arm > 0) add_pose(&bases[arm], 1);
      ordering->AddElementToGroup(intrinsics, 1);
      std::vector<double*> blocks = {camera->data(), target->data(), correction->data(), intrinsics};
      if (arm > 0) blocks.push_back(bases[arm].data());
      for (Eigen::Index p = 0; p < image.observations.size(); ++p) {
        const PointResidual residual{problem.captures[i].base_from_gripper[arm],
                                     image.observations.points_in_target.col(p), image.observations.pixels.col(p),
                                     rig_options.pixel_noise_px};
        ceres_problem.AddResidualBlock(CostOf(residual, arm > 0), nullptr, blocks);
      }
    }
  }
  ceres::Solver::Summary summary;
  ceres::Solve(SolverOptions(rig_options, ordering), &ceres_problem, &summary);
  result.state.poses = {FromBlocks(cameras), FromBlocks(targets), FromBlocks(bases)};
  for (const std::vector<PoseBlock>& of_capture : corrections) {
    result.state.corrections.push_back(FromBlocks(of_capture));
  }
  result.initial_cost = summary.initial_cost;
  result.final_cost = summary.final_cost;
  result.iterations = static_cast<int>(summary.iterations.size()) - 1;
  result.converged = summary.termination_type == ceres::CONVERGENCE;
  return result;
}

}  // namespace heba
