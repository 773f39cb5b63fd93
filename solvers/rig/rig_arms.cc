#include "solvers/rig/rig_arms.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "heba/base/text.h"
#include "solvers/calibration/model_choice.h"
#include "solvers/refine/fit.h"
#include "solvers/rig/rig_outliers.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

using Model = std::shared_ptr<const SharedEffects>;

// The errors of one arm that are part of a problem.
struct ArmPart {
  size_t robot = 0;
  Model model;
  const std::vector<std::shared_ptr<const PoseEffect>>* effects = nullptr;  // One per capture, of all effects.
};

// Returns the problem with these errors of its arms.
RigProblem WithArmErrors(RigProblem problem, const std::vector<ArmPart>& parts) {
  problem.effects.assign(problem.robots.size(), nullptr);
  for (RigCapture& capture : problem.captures) capture.effects.assign(problem.robots.size(), nullptr);
  for (const ArmPart& part : parts) {
    if (part.model == nullptr) continue;
    problem.effects[part.robot] = part.model;
    std::vector<int> indices;
    for (const SharedEffect& effect : part.model->effects) indices.push_back(effect.index);
    for (size_t i = 0; i < problem.captures.size(); ++i) {
      problem.captures[i].effects[part.robot] = SelectEffects((*part.effects)[i], part.model->num_all, indices);
    }
  }
  // The lengths of an arm are told from the size of a target by what is known about either.
  for (RigTarget& target : problem.targets) target.scale_sigma = kPrintScaleSigma;
  return problem;
}

// The captures of a rig, linearised at an estimate, and the variances of their errors.
struct LinearisedRig {
  std::vector<LinearisedView> views;
  std::vector<VarianceGroup> groups;
  std::map<size_t, size_t> first_group_of;  // By arm: the place of the first group of its effects.

  // Estimates the variances that are free, and returns the restricted log-likelihood at them.
  double Maximise() {
    FitVariances(views, &groups);
    return LogLikelihood();
  }
  double LogLikelihood() const { return RestrictedLogLikelihood(views, 1, groups, views.front().by_unknowns.cols()); }
};

// Linearises at the state of a solution, with the effects of the problem, of which those without an estimate are zero.
// The groups of the effects of `first_robot` come before those of the others. Returns nothing if a point cannot be
// projected.
std::optional<LinearisedRig> LineariseAt(const RigProblem& problem, const RigSolution& solution, size_t first_robot) {
  const RigProblem weighted = WeightedAs(solution, problem);
  FitState state = StateOf(solution);
  FitNoise noise = NoiseOf(solution);
  AddEffects(problem, &state, &noise);
  std::optional<std::vector<LinearisedView>> views =
      LineariseFit(weighted, GroupByRobotPoses(weighted), state, noise, LossOf(LossKind::kNone), 1);
  if (!views) return std::nullopt;
  LinearisedRig rig;
  rig.views = std::move(*views);
  VarianceSetting setting;
  setting.effects_avoid_zero = false;  // The models whose variances are zero are part of the comparison.
  const std::vector<VarianceGroup> groups = VarianceGroupsOf(weighted, noise, setting);
  const size_t first_effect = FirstEffectGroup(groups);
  rig.groups.assign(groups.begin(), groups.begin() + static_cast<std::ptrdiff_t>(first_effect));
  // The places of each arm's groups, which VarianceGroupsOf has in the order of the arms.
  std::map<size_t, size_t> place_of;
  size_t place = first_effect;
  std::vector<size_t> order = {first_robot};
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    if (EffectsOf(problem, r) == nullptr) continue;
    place_of[r] = place;
    place += noise.effect_sigmas[r].size();
    if (r != first_robot) order.push_back(r);
  }
  for (const size_t r : order) {
    rig.first_group_of[r] = rig.groups.size();
    for (size_t g = 0; g < noise.effect_sigmas[r].size(); ++g) rig.groups.push_back(groups[place_of[r] + g]);
  }
  return rig;
}

// Returns the index of the possible effects of an arm's captures that explain them best; nothing if a point cannot be
// projected.
std::optional<size_t> MostLikelyBranch(const RigArmErrors& arm, size_t robot, const RigProblem& used,
                                       const RigSolution& solution) {
  std::optional<size_t> best;
  double best_log_likelihood = 0;
  for (size_t k = 0; k < arm.effects_of_captures.size(); ++k) {
    const RigProblem with_errors = WithArmErrors(used, {{robot, arm.models.back(), &arm.effects_of_captures[k]}});
    std::optional<LinearisedRig> rig = LineariseAt(with_errors, solution, robot);
    if (!rig) return std::nullopt;
    const double log_likelihood = rig->Maximise();
    if (!std::isfinite(log_likelihood) || (best && log_likelihood <= best_log_likelihood)) continue;
    best = k;
    best_log_likelihood = log_likelihood;
  }
  return best;
}

// Returns the restricted log-likelihood of a model of an arm's errors: the largest one with the variances of the groups
// that `smaller` lacks at zero. `smaller` may be null.
double LogLikelihoodOf(LinearisedRig rig, size_t robot, const SharedEffects& largest, const SharedEffects* smaller) {
  const size_t first = rig.first_group_of.at(robot);
  for (size_t g = smaller == nullptr ? 0 : smaller->groups.size(); g < largest.groups.size(); ++g) {
    rig.groups[first + g].variance = 0;
    rig.groups[first + g].is_free = false;
  }
  return rig.Maximise();
}

std::string NameOf(const SharedEffects* model) { return model == nullptr ? "noise of the poses" : model->name; }

// Chooses the simplest model of an arm's errors that is acceptable beside the largest one. `rig` is linearised at the
// adjustment with the largest.
void ChooseModelOf(const RigArmErrors& arm, const LinearisedRig& rig, double dof, RigArmChoice* choice) {
  const ErrorModel largest{BundleOptions::Robot::kEstimatedNoise, {}, arm.models.back()};
  const double largest_log_likelihood =
      LogLikelihoodOf(rig, choice->robot, *arm.models.back(), arm.models.back().get());
  std::vector<Model> models = {nullptr};
  models.insert(models.end(), arm.models.begin(), arm.models.end());
  bool is_chosen = false;
  for (const Model& model : models) {
    ModelAlternative alternative{
        {BundleOptions::Robot::kEstimatedNoise, {}, model}, largest_log_likelihood, std::nullopt, 0, std::nullopt};
    alternative.dof = NumVariances(alternative.model);
    if (model != arm.models.back()) {
      alternative.log_likelihood = LogLikelihoodOf(rig, choice->robot, *arm.models.back(), model.get());
      alternative.p = ChanceOfRatio(alternative.log_likelihood, largest_log_likelihood,
                                    {0, NumVariances(largest) - alternative.dof}, dof);
      alternative.odds = OddsAgainst(largest, alternative, [&](const SharedEffects& smaller) -> std::optional<double> {
        LinearisedRig raised = rig;
        if (!RaiseToLeast(raised.views, *arm.models.back(), smaller, &raised.groups)) return std::nullopt;
        return raised.LogLikelihood();
      });
    }
    if (!is_chosen && IsAcceptable(alternative, largest)) {
      choice->model = model;
      is_chosen = true;
    }
    choice->alternatives.push_back(std::move(alternative));
  }
  CHECK(is_chosen) << "the largest model cannot be rejected";
  if (choice->model != nullptr) return;
  const auto best = std::max_element(
      choice->alternatives.begin() + 1, choice->alternatives.end(),
      [](const ModelAlternative& a, const ModelAlternative& b) { return a.log_likelihood < b.log_likelihood; });
  const ModelAlternative& none = choice->alternatives.front();
  choice->reason = "'" + NameOf(best->model.effects.get()) + "' is not significantly better than '" + NameOf(nullptr) +
                   "' alone (log-likelihood higher by " +
                   Significant(std::max(0.0, best->log_likelihood - none.log_likelihood), 2) + " with " +
                   std::to_string(best->dof - none.dof) + " more parameters)";
}

// Returns why the errors of an arm cannot be estimated; empty if they can.
std::string WhyNotEstimable(const RigCalibrationOptions& options, const RigProblem& used, size_t robot) {
  if (options.adjustment.robot != BundleOptions::Robot::kEstimatedNoise) {
    return "the errors of an arm are estimated beside the noise of its poses, which refine.robot_noise holds";
  }
  const std::vector<size_t> moving = MovingRobots(used);
  if (std::find(moving.begin(), moving.end(), robot) == moving.end()) {
    return "the arm moves no target against a camera";
  }
  if (GroupByRobotPoses(used).size() < kMinPosesForVariances) {
    return "the captures are too few to tell the errors of the arm from those of its poses";
  }
  return "";
}

// Returns the parts with the chosen model of each arm.
std::vector<ArmPart> PartsOf(const std::vector<RigArmErrors>& arms, const std::vector<RigArmChoice>& choices) {
  std::vector<ArmPart> parts;
  for (const RigArmChoice& choice : choices) {
    if (choice.model == nullptr) continue;
    parts.push_back({choice.robot, choice.model, &arms[choice.robot].effects_of_captures[choice.branch]});
  }
  return parts;
}

}  // namespace

std::vector<RigArmChoice> AddArmErrors(const RigCalibrationOptions& options, RigProblem* problem, JudgedRig* judged) {
  const bool is_any_known = std::any_of(options.arms.begin(), options.arms.end(),
                                        [](const RigArmErrors& arm) { return !arm.models.empty(); });
  if (!is_any_known) return {};
  const RigProblem used = UsedPoints(*problem, *judged);
  std::vector<RigArmChoice> choices;
  for (size_t r = 0; r < options.arms.size(); ++r) {
    const RigArmErrors& arm = options.arms[r];
    if (arm.models.empty()) continue;
    CHECK(!arm.effects_of_captures.empty());
    RigArmChoice& choice = choices.emplace_back();
    choice.robot = r;
    choice.noise_before = judged->solution.robot_noise[r];
    choice.reason = WhyNotEstimable(options, used, r);
    if (!choice.reason.empty()) continue;
    const std::optional<size_t> branch =
        arm.effects_of_captures.size() == 1 ? 0 : MostLikelyBranch(arm, r, used, judged->solution);
    if (!branch) {
      choice.reason = "the errors of the arm could be fitted in none of its configurations";
      continue;
    }
    choice.branch = *branch;
    choice.model = arm.models.back();
  }
  std::vector<ArmPart> largest = PartsOf(options.arms, choices);
  if (largest.empty()) return choices;
  const auto decline_all = [&](const std::string& reason) {
    for (RigArmChoice& choice : choices) {
      if (choice.model == nullptr) continue;
      choice.model = nullptr;
      choice.reason = reason;
    }
    return choices;
  };
  RigProblem with_errors = WithArmErrors(*problem, largest);
  Outcome<JudgedRig> refined =
      RefineWithoutOutliers(with_errors, judged->solution.poses, judged->left_out, options.adjustment);
  if (!refined) return decline_all("the refinement with the arm's errors failed: " + refined.reason());
  const RigProblem used_with_errors = UsedPoints(with_errors, *refined);
  for (RigArmChoice& choice : choices) {
    const RigArmErrors& arm = options.arms[choice.robot];
    if (choice.model == nullptr || !arm.is_chosen) continue;
    const std::optional<LinearisedRig> rig = LineariseAt(used_with_errors, refined->solution, choice.robot);
    if (!rig) return decline_all("the refinement with the arm's errors hides a point of a target");
    ChooseModelOf(arm, *rig, refined->solution.covariance_dof, &choice);
  }
  const std::vector<ArmPart> chosen = PartsOf(options.arms, choices);
  if (chosen.empty()) return choices;
  const bool is_largest =
      std::equal(chosen.begin(), chosen.end(), largest.begin(), largest.end(),
                 [](const ArmPart& a, const ArmPart& b) { return a.robot == b.robot && a.model == b.model; });
  if (!is_largest) {
    with_errors = WithArmErrors(*problem, chosen);
    refined = RefineWithoutOutliers(with_errors, refined->solution.poses, refined->left_out, options.adjustment);
    if (!refined) return decline_all("the refinement with the arm's errors failed: " + refined.reason());
  }
  *problem = std::move(with_errors);
  *judged = std::move(*refined);
  return choices;
}

}  // namespace heba
