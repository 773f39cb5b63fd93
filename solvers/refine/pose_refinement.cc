#include "solvers/refine/pose_refinement.h"

#include <algorithm>
#include <cmath>

#include <ceres/ceres.h>

#include "heba/base/factorisation.h"
#include "heba/base/failure_code.h"
#include "heba/geometry/pose_block.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/refine/reprojection_problem.h"
#include "solvers/residuals/loop_problem.h"
#include "solvers/residuals/repeated_poses.h"
#include "solvers/uncertainty/information.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// Returns the misclosure of camera_from_target and its derivative with respect to a further left perturbation.
Tangent6 Misclosure(const Rigid3d& predicted, const Rigid3d& seen, Matrix6* by_left) {
  const Rigid3d difference = predicted * Inverse(seen);
  const Eigen::Vector3d angle = LogRotation(difference.rotation);
  Tangent6 misclosure;
  misclosure << difference.translation, angle;
  if (by_left != nullptr) {
    const Eigen::Matrix3d skew = Skew(angle);
    by_left->setIdentity();
    by_left->topRightCorner<3, 3>() = -Skew(difference.translation);
    // The inverse left Jacobian of the rotation vector.
    const double theta = angle.norm();
    const double factor = theta < 1e-4 ? 1.0 / 12 : (1 - 0.5 * theta / std::tan(0.5 * theta)) / (theta * theta);
    by_left->bottomRightCorner<3, 3>() = Eigen::Matrix3d::Identity() - 0.5 * skew + factor * skew * skew;
  }
  return misclosure;
}

// Residual: the whitened misclosure of one capture.
class ChainCost final : public ceres::SizedCostFunction<6, 7, 7> {
 public:
  ChainCost(const PosePair& pair, const Matrix6& whitening)
      : loop_({Inverse(SharedFactor(0)), KnownFactor(pair.camera_mount_from_target_mount), SharedFactor(1)}),
        camera_from_target_(pair.camera_from_target),
        whitening_(whitening) {}

  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
    const std::vector<Rigid3d> poses = {FromBlock(parameters[0]), FromBlock(parameters[1])};
    LoopDerivatives derivatives;
    const Rigid3d predicted = loop_.Evaluate({poses, {}, {}}, jacobians == nullptr ? nullptr : &derivatives);
    Matrix6 by_left;
    Eigen::Map<Tangent6> residual(residuals);
    residual = whitening_ * Misclosure(predicted, camera_from_target_, jacobians == nullptr ? nullptr : &by_left);
    for (int i = 0; jacobians != nullptr && i < 2; ++i) {
      if (jacobians[i] == nullptr) continue;
      Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>> jacobian(jacobians[i]);
      jacobian = whitening_ * by_left * derivatives.shared[static_cast<size_t>(i)] * TangentFromBlock(parameters[i]);
    }
    return true;
  }

 private:
  KinematicLoop loop_;
  Rigid3d camera_from_target_;
  Matrix6 whitening_;
};

// Returns W with W^T W = S^-1 for each pair.
std::vector<Matrix6> Whitenings(const std::vector<PosePair>& pairs) {
  Matrix6 typical = Matrix6::Zero();
  int num_known = 0;
  for (const PosePair& pair : pairs) {
    if (!pair.covariance_at_1px) continue;
    typical += *pair.covariance_at_1px;
    ++num_known;
  }
  typical = num_known == 0 ? Matrix6(1e-6 * Matrix6::Identity()) : Matrix6(typical / num_known);
  std::vector<Matrix6> whitenings;
  for (const PosePair& pair : pairs) {
    const auto factor = Cholesky(pair.covariance_at_1px.value_or(typical));
    CHECK(factor.has_value()) << "a pose's covariance is not positive definite";
    whitenings.emplace_back(factor->SolveLower(Matrix6::Identity()));
  }
  return whitenings;
}

// Linearises the misclosures of all pairs at a solution, with one correction for each robot pose. The step of the
// effects is their value. Pairs at one robot pose have one view each.
std::vector<LinearisedView> LineariseEachPair(Setup setup, const std::vector<PosePair>& pairs,
                                              const std::vector<Matrix6>& whitenings, const UnknownLayout& layout,
                                              const PairSolution& at) {
  std::vector<int> indices;
  for (size_t i = 0; at.shared_effects != nullptr && i < at.shared_effects->effects.size(); ++i) {
    indices.push_back(at.shared_effects->effects[i].index);
  }
  const std::vector<Rigid3d> poses = {at.hand_eye.camera_mount_from_camera, at.hand_eye.target_mount_from_target};
  const std::vector<Eigen::VectorXd> effects(indices.empty() ? 0 : 1, at.effects);
  const std::vector<Rigid3d> own(1);
  const UnknownBlock robot = layout.Block(kRobotBlock);
  std::vector<LinearisedView> views;
  for (size_t i = 0; i < pairs.size(); ++i) {
    const bool has_effect = !indices.empty() && pairs[i].effect != nullptr;
    const KinematicLoop loop =
        HandEyeLoop(setup, pairs[i].camera_mount_from_target_mount,
                    has_effect ? SelectEffects(pairs[i].effect, at.shared_effects->num_all, indices) : nullptr, true);
    LoopDerivatives derivatives;
    const Rigid3d predicted = loop.Evaluate({poses, effects, own}, &derivatives);
    Matrix6 by_left;
    LinearisedView& view = views.emplace_back();
    view.offset = whitenings[i] * Misclosure(predicted, pairs[i].camera_from_target, &by_left);
    const Matrix6 whitened = -whitenings[i] * by_left;
    view.by_unknowns.setZero(6, layout.size());
    view.by_unknowns.middleCols<6>(layout.Block(kHandEyeBlock).first) = whitened * derivatives.shared[0];
    view.by_unknowns.middleCols<6>(layout.Block(kBoardBlock).first) = whitened * derivatives.shared[1];
    view.by_effects = whitened * derivatives.own[0];
    if (!has_effect) continue;
    view.by_unknowns.middleCols(robot.first, robot.size) = whitened * derivatives.effects[0];
    view.offset += view.by_unknowns.middleCols(robot.first, robot.size) * at.effects;
  }
  return views;
}

// Likewise, with one view per robot pose.
std::vector<LinearisedView> LineariseChain(Setup setup, const std::vector<PosePair>& pairs,
                                           const std::vector<Matrix6>& whitenings, const UnknownLayout& layout,
                                           const PairSolution& at) {
  return StackGroups(LineariseEachPair(setup, pairs, whitenings, layout, at), GroupByRobotPose(setup, pairs));
}

UnknownLayout ChainUnknowns(const SharedEffects* effects) {
  UnknownLayout layout = HandEyePoses();
  if (effects != nullptr) layout.AddEffects(kRobotBlock, effects->Names());
  return layout;
}

// The rows and the variances of a solution, by which its restricted likelihood is computed.
struct ChainRows {
  UnknownLayout layout;
  std::vector<LinearisedView> views;
  std::vector<VarianceGroup> groups;

  ChainRows(Setup setup, const std::vector<PosePair>& pairs, const PairSolution& solution)
      : layout(ChainUnknowns(solution.shared_effects.get())),
        views(LineariseChain(setup, pairs, Whitenings(pairs), layout, solution)),
        groups(WithEffectGroups(
            CorrectionGroups(solution.pixel_sigma_px * solution.pixel_sigma_px, *solution.robot_noise, true, true),
            layout.Block(kRobotBlock), solution.shared_effects.get(), solution.effect_sigmas, true, false)) {}

  double LogLikelihood() const { return RestrictedLogLikelihood(views, 1, groups, layout.size()); }
};

}  // namespace

std::vector<LinearisedView> LinearisePairs(Setup setup, const std::vector<PosePair>& pairs, const PairSolution& at) {
  PairSolution without = at;
  without.shared_effects = nullptr;
  std::vector<LinearisedView> views =
      LineariseEachPair(setup, pairs, Whitenings(pairs), ChainUnknowns(nullptr), without);
  for (LinearisedView& view : views) {
    view.by_unknowns /= at.pixel_sigma_px;
    view.by_effects /= at.pixel_sigma_px;
    view.offset /= at.pixel_sigma_px;
  }
  return views;
}

double ChainLogLikelihoodOf(Setup setup, const std::vector<PosePair>& pairs, const PairSolution& solution) {
  return ChainRows(setup, pairs, solution).LogLikelihood();
}

std::optional<double> ChainLogLikelihoodAtLeast(Setup setup, const std::vector<PosePair>& pairs,
                                                const PairSolution& solution, const SharedEffects& smaller) {
  if (solution.shared_effects == nullptr) return std::nullopt;
  ChainRows rows(setup, pairs, solution);
  if (!RaiseToLeast(*solution.shared_effects, smaller, FirstEffectGroup(rows.groups), &rows.groups)) {
    return std::nullopt;
  }
  FitVariances(rows.views, VarianceStart::kAnywhere, &rows.groups);
  return rows.LogLikelihood();
}

Outcome<PairSolution> RefineChainWithNoise(Setup setup, const std::vector<PosePair>& pairs, const HandEye& start,
                                           const std::shared_ptr<const SharedEffects>& effects) {
  if (const std::optional<Failure> failure = HandEyeInput(pairs).why_not()) return *failure;
  const std::vector<Matrix6> whitenings = Whitenings(pairs);
  const UnknownLayout layout = ChainUnknowns(effects.get());
  const UnknownBlock hand_eye = layout.Block(kHandEyeBlock);
  const UnknownBlock board = layout.Block(kBoardBlock);
  const UnknownBlock robot = layout.Block(kRobotBlock);
  PairSolution solution;
  solution.hand_eye = start;
  solution.shared_effects = effects;
  solution.effects = Eigen::VectorXd::Zero(robot.size);
  for (size_t g = 0; effects != nullptr && g < effects->groups.size(); ++g) {
    solution.effect_sigmas.push_back(effects->groups[g].sigma);
  }
  solution.robot_noise = RobotNoise{1e-3, 2e-3};
  double variance = 1;
  constexpr double kExact = 1e-9;
  constexpr int kMaxRounds = 100;
  for (int round = 0; round < kMaxRounds; ++round) {
    const std::vector<LinearisedView> views = LineariseChain(setup, pairs, whitenings, layout, solution);
    const std::vector<VarianceGroup> groups =
        WithEffectGroups(CorrectionGroups(variance, *solution.robot_noise, true, true), robot, effects.get(),
                         solution.effect_sigmas, true, false);
    const VarianceComponents found = EstimateVariances(views, groups);
    variance = found.variances[kPixelGroup];
    const RobotNoise noise = RobotNoiseOf(groups, found);
    solution.robot_noise = {std::max(kExact, noise.translation_m), std::max(kExact, noise.rotation_rad)};
    Eigen::VectorXd prior = Eigen::VectorXd::Zero(layout.size());
    for (size_t g = 0; g < solution.effect_sigmas.size(); ++g) {
      const double group_variance = found.variances[static_cast<Eigen::Index>(FirstEffectGroup(groups) + g)];
      solution.effect_sigmas[g] = std::max(kExact, std::sqrt(group_variance));
    }
    for (Eigen::Index i = 0; i < robot.size; ++i) {
      const double sigma = solution.effect_sigmas[effects->effects[static_cast<size_t>(i)].group];
      prior[robot.first + i] = 1 / (sigma * sigma);
    }
    Information information{layout, prior.asDiagonal()};
    Eigen::VectorXd right = Eigen::VectorXd::Zero(layout.size());
    for (const LinearisedView& view : views) {
      const RowMajorMatrix rows = WhitenedRows(view, variance, CorrectionVariances(*solution.robot_noise));
      const auto by_unknowns = rows.leftCols(layout.size());
      information.matrix += by_unknowns.transpose() * by_unknowns;
      right += by_unknowns.transpose() * rows.rightCols<1>();
    }
    if (const std::optional<Failure> failure = CheckObservable(information)) return *failure;
    solution.covariance = InvertInformation(information, 1.0);
    const Eigen::VectorXd step = solution.covariance.matrix * right;
    const Eigen::VectorXd change = step.segment(robot.first, robot.size) - solution.effects;
    solution.hand_eye = {Retract(solution.hand_eye.camera_mount_from_camera, step.segment<6>(hand_eye.first)),
                         Retract(solution.hand_eye.target_mount_from_target, step.segment<6>(board.first))};
    solution.effects = step.segment(robot.first, robot.size);
    solution.covariance_dof = DegreesOfFreedom(views, groups, found);
    solution.convergence.iterations = round + 1;
    constexpr double kSmall = 1e-9;
    const double largest =
        std::max(step.head(robot.first).cwiseAbs().maxCoeff(), change.size() > 0 ? change.cwiseAbs().maxCoeff() : 0.0);
    if (largest < kSmall) {
      solution.convergence.converged = true;
      solution.pixel_sigma_px = std::sqrt(variance);
      return solution;
    }
  }
  return Failure{FailureCode("poses_not_converged")};
}

Outcome<PairSolution> RefineChain(const std::vector<PosePair>& pairs, const HandEye& start) {
  if (const std::optional<Failure> failure = HandEyeInput(pairs).why_not()) return *failure;
  const std::vector<Matrix6> whitenings = Whitenings(pairs);
  PoseBlock hand_eye = ToBlock(start.camera_mount_from_camera);
  PoseBlock board = ToBlock(start.target_mount_from_target);
  ceres::Problem problem;
  problem.AddParameterBlock(hand_eye.data(), 7, new PoseManifold);
  problem.AddParameterBlock(board.data(), 7, new PoseManifold);
  for (size_t i = 0; i < pairs.size(); ++i) {
    problem.AddResidualBlock(new ChainCost(pairs[i], whitenings[i]), nullptr, hand_eye.data(), board.data());
  }
  constexpr int kMaxIterations = 200;
  ceres::Solver::Options options = ReprojectionSolverOptions(kMaxIterations);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (summary.termination_type != ceres::CONVERGENCE) {
    return Failure{FailureCode("chain_not_converged"), {}, {{"message", summary.message}}};
  }

  PairSolution solution;
  solution.hand_eye = {FromBlock(hand_eye.data()), FromBlock(board.data())};
  solution.convergence = {true,
                          static_cast<int>(summary.iterations.size()) - 1,
                          summary.initial_cost,
                          summary.final_cost,
                          summary.total_time_in_seconds,
                          summary.message};
  Information information{HandEyePoses(), {}};
  const Eigen::Index num_unknowns = information.layout.size();
  const Eigen::Index hand_eye_first = information.layout.Block(kHandEyeBlock).first;
  const Eigen::Index board_first = information.layout.Block(kBoardBlock).first;
  information.matrix = Eigen::MatrixXd::Zero(num_unknowns, num_unknowns);
  for (size_t i = 0; i < pairs.size(); ++i) {
    const Rigid3d predicted = CameraFromTarget(solution.hand_eye, pairs[i].camera_mount_from_target_mount);
    Matrix6 by_left;
    Misclosure(predicted, pairs[i].camera_from_target, &by_left);
    Matrix6X j(6, num_unknowns);
    j.middleCols<6>(hand_eye_first) = -Matrix6::Identity();
    j.middleCols<6>(board_first) = Adjoint(predicted);
    j = (whitenings[i] * by_left * j).eval();
    information.matrix += j.transpose() * j;
  }
  if (const std::optional<Failure> failure = CheckObservable(information)) return *failure;
  const double dof = 6.0 * static_cast<double>(pairs.size()) - static_cast<double>(num_unknowns);
  solution.pixel_sigma_px = std::sqrt(2 * summary.final_cost / dof);
  solution.covariance_dof = dof;
  solution.covariance = InvertInformation(information, solution.pixel_sigma_px * solution.pixel_sigma_px);
  return solution;
}

}  // namespace heba
