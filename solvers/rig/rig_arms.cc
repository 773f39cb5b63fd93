#include "solvers/rig/rig_arms.h"

#include <algorithm>
#include <cmath>
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

// Returns the index of the possible effects of an arm's captures that explain them best: that of the largest restricted
// likelihood, with the largest model. Nothing if none can be fitted.
std::optional<size_t> MostLikelyBranch(const RigArmErrors& arm, size_t robot, const RigProblem& used,
                                       const RigSolution& solution, RigOptions options) {
  options.loss = options.loss == LossKind::kTruncated ? LossKind::kNone : options.loss;
  options.effects_avoid_zero = false;
  const RigProblem fixed = WithFixedWeights(used, solution);
  std::optional<size_t> best;
  double best_log_likelihood = 0;
  for (size_t k = 0; k < arm.effects_of_captures.size(); ++k) {
    const RigProblem with_errors = WithArmErrors(fixed, {{robot, arm.models.back(), &arm.effects_of_captures[k]}});
    const Outcome<RigSolution> refined = RefineRig(with_errors, solution.poses, options);
    if (!refined) continue;
    const double log_likelihood = LogLikelihoodOf(with_errors, *refined, options);
    if (!std::isfinite(log_likelihood) || (best && log_likelihood <= best_log_likelihood)) continue;
    best = k;
    best_log_likelihood = log_likelihood;
  }
  return best;
}

std::string NameOf(const SharedEffects* model) { return model == nullptr ? "noise of the poses" : model->name; }

// Returns why no model of an arm's errors was taken, given the models that were compared.
std::string WhyNone(const std::vector<ModelAlternative>& alternatives) {
  const auto best = std::max_element(
      alternatives.begin() + 1, alternatives.end(),
      [](const ModelAlternative& a, const ModelAlternative& b) { return a.log_likelihood < b.log_likelihood; });
  const ModelAlternative& none = alternatives.front();
  return "'" + NameOf(best->model.effects.get()) + "' is not significantly better than '" + NameOf(nullptr) +
         "' alone (log-likelihood higher by " +
         Significant(std::max(0.0, best->log_likelihood - none.log_likelihood), 2) + " with " +
         std::to_string(best->dof - none.dof) + " more parameters)";
}

// Returns the models of one arm that were compared beside the chosen ones of the other arms.
std::vector<ModelAlternative> AlternativesOf(const ProblemChoice& chosen, size_t robot) {
  std::vector<ModelAlternative> alternatives;
  for (const ProblemAlternative& one : chosen.alternatives) {
    ProblemModel others = one.model;
    others.effects[robot] = chosen.model.effects[robot];
    if (others.effects != chosen.model.effects) continue;
    ErrorModel model = ModelOf(one.model, robot, 0);
    model.shape.clear();
    alternatives.push_back({model, one.log_likelihood, one.robot_noise[robot], NumVariances(model), one.p, one.odds});
  }
  return alternatives;
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
        arm.effects_of_captures.size() == 1 ? 0 : MostLikelyBranch(arm, r, used, judged->solution, options.adjustment);
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
  ModelSpace space;
  space.arms.resize(problem->robots.size());
  bool is_any_chosen = false;
  for (const RigArmChoice& choice : choices) {
    const RigArmErrors& arm = options.arms[choice.robot];
    if (choice.model == nullptr || !arm.is_chosen) continue;
    space.arms[choice.robot] = {arm.models, true, {arm.effects_of_captures[choice.branch]}};
    is_any_chosen = true;
  }
  if (is_any_chosen) {
    const Outcome<ProblemChoice> models =
        ChooseModel(UsedPoints(with_errors, *refined), refined->solution.poses, options.adjustment, space);
    if (!models) return decline_all("the refinement with the arm's errors failed: " + models.reason());
    for (RigArmChoice& choice : choices) {
      if (space.arms[choice.robot].models.empty()) continue;
      choice.model = models->model.effects[choice.robot];
      choice.alternatives = AlternativesOf(*models, choice.robot);
      if (choice.model == nullptr) choice.reason = WhyNone(choice.alternatives);
    }
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
