#include "solvers/residuals/loop_problem.h"

#include <algorithm>
#include <array>
#include <memory>
#include <tuple>
#include <utility>

#include "heba/base/factorisation.h"
#include "heba/geometry/pose_block.h"

namespace heba {
namespace {

enum HandEyePose : int { kHandEye, kBoard };

}  // namespace

KinematicLoop HandEyeLoop(Setup setup, const Rigid3d& camera_mount_from_target_mount,
                          std::shared_ptr<const PoseEffect> effect, bool has_correction) {
  // The errors of the gripper's pose, in the order in which they multiply it.
  std::vector<LoopFactor> errors;
  if (effect != nullptr) errors.push_back(EffectFactor(0, std::move(effect)));
  if (has_correction) errors.push_back(OwnFactor(0));
  std::vector<LoopFactor> factors = {Inverse(SharedFactor(kHandEye))};
  if (setup == Setup::kEyeToHand) {
    factors.push_back(KnownFactor(camera_mount_from_target_mount));
    factors.insert(factors.end(), errors.begin(), errors.end());
  } else {
    for (auto error = errors.rbegin(); error != errors.rend(); ++error) factors.push_back(Inverse(*error));
    factors.push_back(KnownFactor(camera_mount_from_target_mount));
  }
  factors.push_back(SharedFactor(kBoard));
  return KinematicLoop(std::move(factors));
}

std::vector<OwnerBlock> ParameterBlocksOf(const UnknownLayout& layout) {
  std::vector<OwnerBlock> blocks;
  std::array<size_t, 4> num_of_owner{};
  size_t first = 0;
  for (const UnknownBlock& unknowns : layout.blocks()) {
    auto size = static_cast<int>(unknowns.size);
    if (unknowns.owner == UnknownOwner::kPose) size = static_cast<int>(std::tuple_size_v<PoseBlock>);
    if (unknowns.owner == UnknownOwner::kCamera) size = NumParams(*unknowns.model);
    if (unknowns.owner == UnknownOwner::kTarget && size > 0) size = TargetShape::kNumParams;
    const size_t index = num_of_owner[static_cast<size_t>(unknowns.owner)]++;
    if (size == 0) continue;
    blocks.push_back({unknowns, index, first, size});
    first += static_cast<size_t>(size);
  }
  return blocks;
}

std::vector<double> JoinedBlocks(const std::vector<OwnerBlock>& blocks, const LoopValues& values) {
  std::vector<double> joined;
  const auto append = [&](const auto& numbers) { joined.insert(joined.end(), numbers.begin(), numbers.end()); };
  for (const OwnerBlock& block : blocks) {
    switch (block.unknowns.owner) {
      case UnknownOwner::kPose:
        append(ToBlock(values.poses[block.index]));
        break;
      case UnknownOwner::kEffects:
        append(values.effects[block.index]);
        break;
      case UnknownOwner::kCamera:
        append(values.cameras[block.index]);
        break;
      case UnknownOwner::kTarget:
        append(values.targets[block.index].params);
        break;
    }
  }
  return joined;
}

LoopValues ValuesIn(const std::vector<OwnerBlock>& blocks, const std::vector<double>& joined,
                    const std::vector<TargetShape>& held) {
  LoopValues values;
  values.targets = held;
  for (const OwnerBlock& block : blocks) {
    const double* const from = &joined[block.first];
    switch (block.unknowns.owner) {
      case UnknownOwner::kPose:
        values.poses.push_back(FromBlock(from));
        break;
      case UnknownOwner::kEffects:
        values.effects.emplace_back(Eigen::Map<const Eigen::VectorXd>(from, block.size));
        break;
      case UnknownOwner::kCamera:
        values.cameras.emplace_back(from, from + block.size);
        break;
      case UnknownOwner::kTarget:
        std::copy_n(from, block.size, values.targets[block.index].params.begin());
        break;
    }
  }
  return values;
}

double PixelSigmaOf(const LoopProblem& problem, size_t camera, double pixel_sigma_px) {
  return problem.pixel_sigma_ratios.empty() ? pixel_sigma_px : problem.pixel_sigma_ratios[camera] * pixel_sigma_px;
}

FreeParameters FreeOf(const LoopProblem& problem, int camera, int target) {
  const auto camera_index = static_cast<size_t>(camera);
  const UnknownBlock of_camera = problem.layout.BlocksOf(UnknownOwner::kCamera)[camera_index];
  const UnknownBlock of_target = problem.layout.BlocksOf(UnknownOwner::kTarget)[static_cast<size_t>(target)];
  FreeParameters free(static_cast<size_t>(NumParams(*problem.cameras[camera_index])), false);
  const size_t num_params = free.size();
  if (of_target.size > 0) free.resize(num_params + TargetShape::kNumParams, false);
  for (Eigen::Index i = of_camera.first; i < of_camera.end(); ++i) {
    free[static_cast<size_t>(problem.layout[i].index)] = true;
  }
  for (Eigen::Index i = of_target.first; i < of_target.end(); ++i) {
    free[num_params + static_cast<size_t>(problem.layout[i].index)] = true;
  }
  return free;
}

Matrix6 CorrectionPrior(const RobotNoise& noise, const Matrix6X& gripper_by_joints) {
  Tangent6 sigmas;
  sigmas << Eigen::Vector3d::Constant(noise.translation_m), Eigen::Vector3d::Constant(noise.rotation_rad);
  if (gripper_by_joints.cols() == 0 || noise.joint_rad == 0) return sigmas.cwiseInverse().asDiagonal();
  // Q is factorised in units of the white noise, because metres and radians are mixed.
  const Matrix6X scaled = noise.joint_rad * sigmas.cwiseInverse().asDiagonal() * gripper_by_joints;
  return CholeskyFactor<6>::OfIdentityPlusSquare(scaled).SolveLower(Matrix6(sigmas.cwiseInverse().asDiagonal()));
}

NuisancePoseResidual NuisancePoseResidualAt(const Rigid3d& pose, const Matrix6& prior) {
  const Tangent6 tangent = LocalCoordinates(Rigid3d(), pose);
  // The inverse right Jacobian of the rotation vector to second order; corrections are small.
  const Eigen::Matrix3d skew = Skew(tangent.tail<3>());
  Matrix6 local_from_tangent = Matrix6::Zero();
  local_from_tangent.topLeftCorner<3, 3>() = pose.RotationMatrix();
  local_from_tangent.bottomRightCorner<3, 3>() = Eigen::Matrix3d::Identity() + 0.5 * skew + skew * skew / 12;
  return {prior * tangent, prior * local_from_tangent};
}

}  // namespace heba
