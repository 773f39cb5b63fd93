#include "solvers/calibration/scale_share.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <set>
#include <utility>

#include "heba/base/factorisation.h"
#include "heba/data/joint_prior.h"
#include "heba/kernels/stacked_rows.h"
#include "solvers/calibration/diagnostics.h"
#include "solvers/refine/fit.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

constexpr const char* kScaleEffect = "scale";

bool IsScaleFree(const ProblemTarget& target) {
  return std::find(target.free_shape.begin(), target.free_shape.end(), TargetShapeGroup::kScale) !=
         target.free_shape.end();
}

// The error of a reported pose whose translation is to be stretched by the last effect, after its other errors.
class StretchedEffect final : public PoseEffect {
 public:
  StretchedEffect(const Rigid3d& base_from_gripper, std::shared_ptr<const PoseEffect> others)
      : translation_in_gripper_m_(base_from_gripper.rotation.conjugate() * base_from_gripper.translation),
        others_(std::move(others)) {}
  Rigid3d Evaluate(const Eigen::VectorXd& effects, Matrix6X* tangent_from_effects) const override {
    const Eigen::Index num_others = effects.size() - 1;
    Matrix6X by_others = Matrix6X::Zero(6, num_others);
    Rigid3d pose;
    if (others_ != nullptr) {
      pose = others_->Evaluate(effects.head(num_others), tangent_from_effects != nullptr ? &by_others : nullptr);
    }
    pose.translation += effects[num_others] * translation_in_gripper_m_;
    if (tangent_from_effects != nullptr) {
      tangent_from_effects->setZero(6, effects.size());
      tangent_from_effects->leftCols(num_others) = by_others;
      tangent_from_effects->col(num_others).head<3>() = pose.rotation.conjugate() * translation_in_gripper_m_;
    }
    return pose;
  }

 private:
  Eigen::Vector3d translation_in_gripper_m_;
  std::shared_ptr<const PoseEffect> others_;
};

// A problem with scales among its unknowns, the state at which it is linearised, and its noise.
struct ScaledProblem {
  Problem problem;
  FitState state;
  FitNoise noise;
};

// Returns it with the scale of an arm's translations among its effects, with one sigma of it.
ScaledProblem WithScaleOfRobot(ScaledProblem scaled, size_t robot, double sigma) {
  Problem& problem = scaled.problem;
  const size_t num_robots = problem.robots.size();
  problem.effects.resize(num_robots);
  scaled.state.effects.resize(num_robots);
  scaled.noise.effect_sigmas.resize(num_robots);
  auto with_scale = std::make_shared<SharedEffects>();
  if (problem.effects[robot] != nullptr) *with_scale = *problem.effects[robot];
  // The effects of a problem are those that are estimated.
  const Eigen::Index num_others = with_scale->size();
  with_scale->groups.push_back({kScaleEffect, "", sigma});
  with_scale->effects.push_back({kScaleEffect, static_cast<int>(num_others), with_scale->groups.size() - 1});
  problem.effects[robot] = std::move(with_scale);
  scaled.state.effects[robot].conservativeResize(num_others + 1);
  scaled.state.effects[robot][num_others] = 0;
  scaled.noise.effect_sigmas[robot].push_back(sigma);
  for (ProblemCapture& capture : problem.captures) {
    capture.effects.resize(num_robots);
    capture.effects[robot] =
        std::make_shared<StretchedEffect>(capture.base_from_gripper[robot], std::move(capture.effects[robot]));
  }
  return scaled;
}

// The normal equations of all unknowns, those of the solution and the scales that it held.
struct NormalEquationsOfAll {
  UnknownLayout layout;
  Eigen::MatrixXd matrix;
  Eigen::VectorXd right;
};

std::optional<NormalEquationsOfAll> NormalEquationsOf(const Problem& problem, const FitState& state,
                                                      const FitNoise& noise) {
  const std::optional<std::vector<LinearisedView>> views =
      LineariseFit(problem, GroupByRobotPoses(problem), state, noise, LossOf(LossKind::kNone), 1);
  if (!views) return std::nullopt;
  const Eigen::VectorXd variances = CorrectionVariances(noise, NoisyJointsOf(problem, MovingRobots(problem)));
  NormalEquationsOfAll equations{UnknownsOf(problem), {}, {}};
  const Eigen::Index size = equations.layout.size();
  StackedRows stacked(static_cast<int>(size + 1));
  for (const LinearisedView& view : *views) {
    stacked.Next<Eigen::Dynamic>(view.offset.size()) = WhitenedRows(view, 1, variances);
  }
  const Eigen::MatrixXd products = stacked.Products();
  equations.matrix = products.topLeftCorner(size, size);
  equations.right = products.topRightCorner(size, 1);
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    const SharedEffects* const effects = EffectsOf(problem, r);
    if (effects == nullptr) continue;
    const Eigen::Index first = equations.layout.Block(ErrorsBlock(problem.robots[r])).first;
    for (Eigen::Index i = 0; i < effects->size(); ++i) {
      const double sigma = noise.effect_sigmas[r][effects->effects[static_cast<size_t>(i)].group];
      equations.matrix(first + i, first + i) += 1 / (sigma * sigma);
    }
  }
  return equations;
}

// Returns the covariance without what the prior knowledge of the scales of targets, C P C, contributes to it.
Covariance WithoutScalesOfTargets(const Problem& problem, const Covariance& covariance) {
  Covariance without = covariance;
  for (const ProblemTarget& target : problem.targets) {
    if (!target.scale_sigma) continue;
    const UnknownBlock block = covariance.layout.Block(TargetShapeBlock(target));
    for (Eigen::Index i = block.first; i < block.end(); ++i) {
      if (covariance.layout[i].group != UnknownGroup::kScale) continue;
      const Eigen::VectorXd change = covariance.matrix.col(i) / *target.scale_sigma;
      without.matrix -= change * change.transpose();
    }
  }
  return without;
}

// Returns the changes of a prior's means by what all sessions of the cell have in common, in the layout of a solution.
std::vector<Eigen::VectorXd> ChangesOfCell(const JointPrior& prior, const UnknownLayout& layout) {
  std::vector<Eigen::VectorXd> changes;
  for (const Eigen::VectorXd& of_cell : prior.of_cell) {
    Eigen::VectorXd& change = changes.emplace_back(Eigen::VectorXd::Zero(layout.size()));
    for (Eigen::Index i = 0; i < of_cell.size(); ++i) {
      const std::optional<Eigen::Index> place = layout.Place(prior.covariance.layout.Name(i));
      if (place) change[*place] = of_cell[i];
    }
  }
  return changes;
}

// Returns the findings about the scales of targets that were estimated.
std::vector<Finding> JudgeScales(const Problem& problem, const Solution& solution, const ScaleSigmas& sigmas) {
  std::vector<Finding> findings;
  const double robot = sigmas.robots.empty() ? 0 : *std::max_element(sigmas.robots.begin(), sigmas.robots.end());
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    const ProblemTarget& target = problem.targets[t];
    if (!IsScaleFree(target)) continue;
    // The focal length of the only camera takes part of a wrong scale if it is free.
    const bool is_focal_held = problem.cameras.size() == 1 && problem.cameras[0].free_intrinsics.empty();
    std::optional<Finding> finding = JudgeScale(solution.shapes[t], solution.covariance, TargetShapeBlock(target),
                                                is_focal_held, std::hypot(sigmas.targets[t], robot));
    if (!finding) continue;
    if (!target.name.empty()) finding->names.emplace_back("of_target", target.name);
    findings.push_back(std::move(*finding));
  }
  return findings;
}

// Returns the finding that says where the scale comes from; `changes` are those by the scales. Nothing if there are
// none.
std::optional<Finding> DescribeSource(const Problem& problem, const ScaleSigmas& sigmas,
                                      const std::vector<Eigen::VectorXd>& changes, const UnknownLayout& layout) {
  size_t largest = 0;
  double share_m = 0;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const UnknownBlock pose = layout.Block(CameraPoseBlock(problem.cameras[c]));
    double squares_m2 = 0;
    for (const Eigen::VectorXd& change : changes) squares_m2 += change.segment<3>(pose.first).squaredNorm();
    if (std::sqrt(squares_m2) <= share_m) continue;
    share_m = std::sqrt(squares_m2);
    largest = c;
  }
  if (share_m <= 0) return std::nullopt;
  const bool has_target = std::any_of(problem.targets.begin(), problem.targets.end(),
                                      [](const ProblemTarget& target) { return !IsScaleFree(target); });
  Finding finding{Grade::kGood, FindingCode("scale_source")};
  finding.numbers = {{"share_mm", 1000 * share_m},
                     {"robot_scale_sigma", *std::max_element(sigmas.robots.begin(), sigmas.robots.end())},
                     {"target_scale_sigma", *std::max_element(sigmas.targets.begin(), sigmas.targets.end())}};
  finding.names = {{"source", has_target ? "robot_and_target" : "robot"}};
  const std::string& camera = problem.cameras[largest].name;
  if (!camera.empty()) finding.names.emplace_back("of_camera", camera);
  return finding;
}

}  // namespace

ScaleShare ShareOfScales(const Problem& problem, const Solution& solution, const ScaleSigmas& sigmas) {
  CHECK_EQ(sigmas.targets.size(), problem.targets.size());
  CHECK_EQ(sigmas.robots.size(), problem.robots.size());
  ScaleShare share;
  share.repeatable = WithoutScalesOfTargets(problem, solution.covariance);
  share.findings = JudgeScales(problem, solution, sigmas);
  if (problem.prior != nullptr) {
    // The captures of an earlier session were measured with the same scales.
    share.changes = ChangesOfCell(*problem.prior, solution.covariance.layout);
    return share;
  }
  ScaledProblem scaled{WeightedAs(solution, problem), StateOf(solution), NoiseOf(solution)};
  std::set<std::string> held;
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    ProblemTarget& target = scaled.problem.targets[t];
    if (IsScaleFree(target) || sigmas.targets[t] <= 0) continue;
    target.free_shape.push_back(TargetShapeGroup::kScale);
    target.scale_sigma = sigmas.targets[t];
    for (const char* param : {"scale_x", "scale_y"}) held.insert(TargetShapeBlock(target) + "." + param);
  }
  for (const size_t r : MovingRobots(problem)) {
    if (sigmas.robots[r] <= 0) continue;
    scaled = WithScaleOfRobot(std::move(scaled), r, sigmas.robots[r]);
    held.insert(ErrorsBlock(problem.robots[r]) + "." + kScaleEffect);
  }
  if (held.empty()) return share;
  const std::optional<NormalEquationsOfAll> equations = NormalEquationsOf(scaled.problem, scaled.state, scaled.noise);
  if (!equations) return share;
  std::vector<Eigen::Index> of_solution;
  std::vector<Eigen::Index> of_scales;
  for (Eigen::Index i = 0; i < equations->layout.size(); ++i) {
    (held.contains(equations->layout.Name(i)) ? of_scales : of_solution).push_back(i);
  }
  CHECK_EQ(static_cast<Eigen::Index>(of_solution.size()), solution.covariance.layout.size());
  const Eigen::MatrixXd coupling = equations->matrix(of_solution, of_scales);
  Eigen::MatrixXd right(coupling.rows(), coupling.cols() + 1);
  right << coupling, equations->right(of_solution);
  const Eigen::MatrixXd solved = SolveSymmetric(equations->matrix(of_solution, of_solution), right);
  const Eigen::MatrixXd by_scales = solved.leftCols(coupling.cols());
  const Eigen::MatrixXd information = equations->matrix(of_scales, of_scales) - coupling.transpose() * by_scales;
  const Eigen::VectorXd gradient = equations->right(of_scales) - coupling.transpose() * solved.col(coupling.cols());
  const auto factor = Cholesky(information);
  if (!factor) return share;
  const Eigen::MatrixXd covariance = factor->Inverse();
  const auto root = Cholesky(covariance);
  if (!root) return share;
  const Eigen::MatrixXd columns = by_scales * root->lower().triangularView<Eigen::Lower>();
  for (Eigen::Index j = 0; j < columns.cols(); ++j) share.changes.emplace_back(columns.col(j));
  share.changes.emplace_back(by_scales * (covariance * gradient));
  std::optional<Finding> source = DescribeSource(problem, sigmas, share.changes, solution.covariance.layout);
  if (source) share.findings.push_back(std::move(*source));
  return share;
}

}  // namespace heba
