#include "solvers/uncertainty/robot_noise.h"

#include <algorithm>
#include <cmath>

#include "heba/base/distributions.h"
#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "heba/base/units.h"
#include "heba/kernels/small_matrix.h"
#include "heba/kernels/stacked_rows.h"

namespace heba {
namespace {

// Returns p I + G Q G^T, where G is the first `rows` rows of the view's by_effects.
Eigen::MatrixXd CovarianceOfRows(const LinearisedView& view, Eigen::Index rows, double pixel_variance,
                                 const Eigen::VectorXd& effect_variances) {
  const RowMajorMatrix by_sigmas = view.by_effects.topRows(rows) * effect_variances.cwiseSqrt().asDiagonal();
  Eigen::MatrixXd covariance = by_sigmas.lazyProduct(by_sigmas.transpose());
  covariance.diagonal().array() += pixel_variance;
  return covariance;
}

}  // namespace

Rigid3d CameraFromTarget(Setup setup, const HandEye& hand_eye, const Rigid3d& camera_mount_from_target_mount,
                         const Rigid3d& correction) {
  return CameraFromTarget(hand_eye, CorrectedMount(setup, camera_mount_from_target_mount, correction));
}

Rigid3d CorrectionFor(Setup setup, const HandEye& hand_eye, const Rigid3d& camera_mount_from_target_mount,
                      const Rigid3d& camera_from_target) {
  const Rigid3d corrected =
      hand_eye.camera_mount_from_camera * camera_from_target * Inverse(hand_eye.target_mount_from_target);
  return Inverse(BaseFromGripper(setup, camera_mount_from_target_mount)) * BaseFromGripper(setup, corrected);
}

Eigen::VectorXd CorrectionVariances(const RobotNoise& noise, Eigen::Index num_columns) {
  CHECK_GE(num_columns, 6);
  Eigen::VectorXd variances(num_columns);
  variances.head<3>().setConstant(noise.translation_m * noise.translation_m);
  variances.segment<3>(3).setConstant(noise.rotation_rad * noise.rotation_rad);
  variances.tail(num_columns - 6).setConstant(noise.joint_rad * noise.joint_rad);
  return variances;
}

RobotNoise NoiseElsewhere(const Solution& solution, size_t robot) {
  RobotNoise noise = solution.robot_noise[robot].value_or(RobotNoise{});
  const RobotNoise smooth = SmoothNoiseOf(solution, robot).value_or(RobotNoise{});
  noise.translation_m = std::hypot(noise.translation_m, smooth.translation_m);
  noise.rotation_rad = std::hypot(noise.rotation_rad, smooth.rotation_rad);
  return noise;
}

RobotNoisePrior IndustrialArmPrior() {
  // The 95 % interval of the logarithm is 2 x 1.96 sigmas wide, and its bounds differ by a factor of 20.
  const double log_sigma = std::log(20.0) / (2 * 1.96);
  return {{std::sqrt(kIndustrialArmM[0] * kIndustrialArmM[1]),
           DegToRad(std::sqrt(kIndustrialArmDeg[0] * kIndustrialArmDeg[1]))},
          log_sigma};
}

std::vector<VarianceGroup> CorrectionGroups(double pixel_variance, const RobotNoise& robot, bool pixel_is_free,
                                            bool robot_is_free, const RobotNoisePrior* prior, Eigen::Index num_joints) {
  const Eigen::VectorXd variances = CorrectionVariances(robot, 6 + num_joints);
  std::vector<VarianceGroup> groups = {
      {VarianceGroup::Kind::kPixels, {}, pixel_variance, pixel_is_free},
      {VarianceGroup::Kind::kEffects, {0, 1, 2}, variances[0], robot_is_free},
      {VarianceGroup::Kind::kEffects, {3, 4, 5}, variances[3], robot_is_free},
  };
  if (num_joints > 0) {
    groups.push_back({VarianceGroup::Kind::kEffects, {}, variances[6], robot_is_free});
    for (Eigen::Index j = 0; j < num_joints; ++j) groups.back().columns.push_back(6 + j);
  }
  if (prior != nullptr) {
    groups[kTranslationGroup].prior = SigmaPrior{prior->median.translation_m, prior->log_sigma};
    groups[kRotationGroup].prior = SigmaPrior{prior->median.rotation_rad, prior->log_sigma};
  }
  return groups;
}

std::vector<VarianceGroup> WithEffectGroups(std::vector<VarianceGroup> groups, const UnknownBlock& block,
                                            const SharedEffects* effects, const std::vector<double>& sigmas,
                                            bool are_free, bool avoid_zero) {
  if (effects == nullptr) return groups;
  const size_t first_group = groups.size();
  for (size_t g = 0; g < sigmas.size(); ++g) {
    groups.push_back({VarianceGroup::Kind::kUnknowns, {}, sigmas[g] * sigmas[g], are_free});
    groups.back().avoids_zero = are_free && avoid_zero;
    const double most = effects->groups[g].most_sigma;
    if (most > 0) groups.back().most = most * most;
    if (const double scale = effects->groups[g].half_cauchy_sigma; scale > 0) groups.back().half_cauchy = scale;
  }
  const Eigen::Index first = block.first;
  for (size_t i = 0; i < effects->effects.size(); ++i) {
    groups[first_group + effects->effects[i].group].columns.push_back(first + static_cast<Eigen::Index>(i));
  }
  return groups;
}

size_t FirstEffectGroup(const std::vector<VarianceGroup>& groups) {
  const auto first = std::find_if(groups.begin(), groups.end(), [](const VarianceGroup& group) {
    return group.kind == VarianceGroup::Kind::kUnknowns;
  });
  return static_cast<size_t>(first - groups.begin());
}

bool RaiseToLeast(const SharedEffects& effects, const SharedEffects& smaller, size_t first,
                  std::vector<VarianceGroup>* groups) {
  bool has_raised = false;
  for (size_t g = smaller.groups.size(); g < effects.groups.size(); ++g) {
    const double least = effects.groups[g].least_sigma;
    if (!(least > 0)) continue;
    VarianceGroup& group = (*groups)[first + g];
    group.variance = std::max(group.variance, least * least);
    group.is_free = false;
    has_raised = true;
  }
  return has_raised;
}

RobotNoise RobotNoiseOf(const std::vector<VarianceGroup>& groups, const VarianceComponents& variances) {
  const bool has_joints = FirstEffectGroup(groups) > kJointGroup;
  return {std::sqrt(variances.variances[kTranslationGroup]), std::sqrt(variances.variances[kRotationGroup]),
          has_joints ? std::sqrt(variances.variances[kJointGroup]) : 0.0};
}

Eigen::MatrixXd MarginalCovariance(const LinearisedView& view, double pixel_variance,
                                   const Eigen::VectorXd& effect_variances) {
  return CovarianceOfRows(view, view.offset.size(), pixel_variance, effect_variances);
}

RowMajorMatrix WhitenedRows(const LinearisedView& view, double pixel_variance,
                            const Eigen::VectorXd& effect_variances) {
  const Eigen::Index n = view.by_unknowns.cols();
  const Eigen::Index num_dependent = view.offset.size() - view.num_rows_without_effects;
  const double root_weight = 1 / std::sqrt(pixel_variance);
  RowMajorMatrix whitened(view.offset.size(), n + 1);
  if (whitened.rows() == 0) return whitened;
  whitened << view.by_unknowns, view.offset;
  if (num_dependent == 0) return root_weight * whitened;
  RowMajorMatrix dependent = whitened.topRows(num_dependent);
  Eigen::MatrixXd covariance = CovarianceOfRows(view, num_dependent, pixel_variance, effect_variances);
  auto root = Cholesky(covariance);
  if (!root) {
    // The noise of a pose that is close to the camera hides that of the pixels, which has no digits left in the sum.
    constexpr double kDigits = 1e-12;
    covariance.diagonal().array() += kDigits * covariance.trace();
    root = Cholesky(covariance);
  }
  // Rows without a finite covariance say nothing.
  if (!root) return RowMajorMatrix::Zero(view.offset.size(), n + 1);
  SolveLowerInPlace(root->lower(), &dependent);
  whitened.topRows(num_dependent) = dependent;
  whitened.bottomRows(view.num_rows_without_effects) *= root_weight;
  return whitened;
}

double PValueOf(const Tangent6& vector, const Matrix6& covariance, double nothing, double dof) {
  const SymmetricEigen<6> eigen = EigenOfSymmetric(covariance);
  const Tangent6 along = eigen.vectors.transpose() * vector;
  double statistic = 0;
  int rank = 0;
  for (int i = 0; i < 6; ++i) {
    if (eigen.values[i] < nothing) continue;
    statistic += along[i] * along[i] / eigen.values[i];
    ++rank;
  }
  return rank == 0 ? 1 : FisherTail(statistic / rank, rank, dof);
}

Eigen::MatrixXd MarginalInformation(const std::vector<LinearisedView>& views, const Eigen::VectorXd& effect_variances,
                                    double pixel_variance) {
  const Eigen::Index n = views.front().by_unknowns.cols();
  StackedRows stacked(static_cast<int>(n));
  for (const LinearisedView& view : views) {
    stacked.Next<Eigen::Dynamic>(view.offset.size()) = WhitenedRows(view, pixel_variance, effect_variances).leftCols(n);
  }
  return stacked.Products();
}

}  // namespace heba
