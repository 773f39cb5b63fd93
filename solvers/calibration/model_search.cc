#include "solvers/calibration/model_search.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "heba/base/text.h"
#include "solvers/calibration/choice_levels.h"
#include "solvers/calibration/smooth_search.h"
#include "solvers/refine/fit.h"

namespace heba {
namespace {

// Adds errors of an arm to a problem; `effects` are functions of all its effects, one per capture.
void AddErrors(size_t robot, const std::shared_ptr<const SharedEffects>& model,
               const std::vector<std::shared_ptr<const PoseEffect>>& effects, RigProblem* problem) {
  std::vector<int> estimated;
  for (const SharedEffect& effect : model->effects) estimated.push_back(effect.index);
  problem->effects.resize(problem->robots.size());
  problem->effects[robot] = model;
  for (size_t i = 0; i < problem->captures.size(); ++i) {
    std::vector<std::shared_ptr<const PoseEffect>>& of_capture = problem->captures[i].effects;
    of_capture.resize(problem->robots.size());
    of_capture[robot] = effects[i] == nullptr ? nullptr : SelectEffects(effects[i], model->num_all, estimated);
  }
  // The lengths of an arm are told from the size of a target by what is known about either.
  for (RigTarget& target : problem->targets) {
    if (!target.scale_sigma) target.scale_sigma = kPrintScaleSigma;
  }
}

// Returns the index of the possible effects of an arm's captures that explain them best: that of the largest restricted
// likelihood, with the largest model. Nothing if none can be fitted.
std::optional<size_t> MostLikelyBranch(const RigArmErrors& arm, size_t robot, const SearchedModel& model) {
  RigOptions options = model.options;
  if (options.loss == LossKind::kTruncated) options.loss = LossKind::kNone;
  options.effects_avoid_zero = false;
  const RigSolution& solution = model.judged.solution;
  const RigProblem fixed = WithFixedWeights(UsedPoints(model.problem, model.judged), solution);
  std::optional<size_t> best;
  double best_log_likelihood = 0;
  for (size_t k = 0; k < arm.effects_of_captures.size(); ++k) {
    RigProblem with_errors = fixed;
    AddErrors(robot, arm.models.back(), arm.effects_of_captures[k], &with_errors);
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
std::vector<ModelAlternative> AlternativesOf(const SearchedModel& chosen, size_t robot) {
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
std::string WhyNotEstimable(const SearchedModel& model, size_t robot) {
  if (model.options.robot != BundleOptions::Robot::kEstimatedNoise) {
    return "the errors of an arm are estimated beside the noise of its poses, which refine.robot_noise holds";
  }
  const RigProblem used = UsedPoints(model.problem, model.judged);
  const std::vector<size_t> moving = MovingRobots(used);
  if (std::find(moving.begin(), moving.end(), robot) == moving.end()) {
    return "the arm moves no target against a camera";
  }
  if (GroupByRobotPoses(used).size() < kMinPosesForVariances) {
    return "the captures are too few to tell the errors of the arm from those of its poses";
  }
  return "";
}

// Adjusts the model as it is, with other images left out if others contradict it. Returns the Failure if that fails,
// which changes nothing.
std::optional<Failure> JudgeAgain(const Judge& judge, SearchedModel* model) {
  Outcome<JudgedRig> judged =
      judge(model->problem, model->judged.solution.poses, model->judged.left_out, model->options);
  if (!judged) return Failure{judged.reason()};
  model->judged = std::move(*judged);
  return std::nullopt;
}

}  // namespace

std::optional<Failure> ChooseParts(const ModelSpace& space, const Judge& judge, SearchedModel* model) {
  SearchedModel chosen = *model;
  RigProblem used = Without(model->problem, model->judged.left_out);
  for (size_t c = 0; c < used.cameras.size(); ++c) used.cameras[c].camera = model->judged.solution.cameras[c];
  const RigSolution& solution = model->judged.solution;
  Outcome<ProblemChoice> choice = ChooseModel(used, solution.poses, model->options, space, &solution);
  if (!choice) return Failure{choice.reason()};
  chosen.problem = WithModel(std::move(chosen.problem), choice->model, space);
  chosen.model = choice->model;
  chosen.alternatives = std::move(choice->alternatives);
  // The images have been judged under the model that the problem had.
  if (!HasModel(model->problem, model->options, choice->model)) {
    if (std::optional<Failure> failure = JudgeAgain(judge, &chosen)) return failure;
  }
  *model = std::move(chosen);
  return std::nullopt;
}

std::vector<RigArmChoice> AddArmErrors(const std::vector<RigArmErrors>& arms, const Judge& judge,
                                       SearchedModel* model) {
  SearchedModel with_errors = *model;
  ModelSpace space;
  space.arms.resize(arms.size());
  std::vector<RigArmChoice> choices;
  bool has_any = false;
  for (size_t r = 0; r < arms.size(); ++r) {
    const RigArmErrors& arm = arms[r];
    if (arm.models.empty()) continue;
    CHECK(!arm.effects_of_captures.empty());
    RigArmChoice& choice = choices.emplace_back();
    choice.robot = r;
    choice.noise_before = model->judged.solution.robot_noise[r];
    choice.reason = WhyNotEstimable(*model, r);
    if (!choice.reason.empty()) continue;
    const std::optional<size_t> branch = arm.effects_of_captures.size() == 1 ? 0 : MostLikelyBranch(arm, r, *model);
    if (!branch) {
      choice.reason = "the errors of the arm could be fitted in none of its configurations";
      continue;
    }
    choice.branch = *branch;
    choice.model = arm.models.back();
    if (arm.is_chosen) space.arms[r] = {arm.models, true, {arm.effects_of_captures[*branch]}};
    AddErrors(r, choice.model, arm.effects_of_captures[*branch], &with_errors.problem);
    has_any = true;
  }
  if (!has_any) return choices;
  const auto decline_all = [&](const Failure& failure) {
    for (RigArmChoice& choice : choices) {
      if (choice.model == nullptr) continue;
      choice.model = nullptr;
      choice.reason = "the refinement with the arm's errors failed: " + failure.reason;
    }
    return choices;
  };
  if (const std::optional<Failure> failure = JudgeAgain(judge, &with_errors)) return decline_all(*failure);
  const bool is_any_chosen =
      std::any_of(space.arms.begin(), space.arms.end(), [](const RigArmErrors& arm) { return !arm.models.empty(); });
  if (is_any_chosen) {
    if (const std::optional<Failure> failure = ChooseParts(space, judge, &with_errors)) return decline_all(*failure);
    for (RigArmChoice& choice : choices) {
      if (space.arms[choice.robot].models.empty()) continue;
      choice.model = with_errors.model.effects[choice.robot];
      choice.alternatives = AlternativesOf(with_errors, choice.robot);
      if (choice.model == nullptr) choice.reason = WhyNone(choice.alternatives);
    }
  }
  const bool has_errors =
      std::any_of(choices.begin(), choices.end(), [](const RigArmChoice& choice) { return choice.model != nullptr; });
  if (has_errors) *model = std::move(with_errors);
  return choices;
}

std::vector<RigSmoothErrors> AddSmoothErrors(SmoothPoseErrors smooth, const Judge& judge, SearchedModel* model) {
  const bool has_noise =
      model->options.robot == BundleOptions::Robot::kEstimatedNoise && !model->options.robot_noise_prior;
  std::vector<RigSmoothErrors> added;
  if (smooth == SmoothPoseErrors::kNone || !has_noise) return added;
  const RigSolution& solution = model->judged.solution;
  SearchedModel with_errors = *model;
  for (const SmoothErrorsOfArm& arm : FindSmoothErrorsOfArms(UsedPoints(model->problem, model->judged), solution)) {
    const double p_value = PValueWithout(arm.found);
    if (smooth == SmoothPoseErrors::kAuto && p_value >= kRandomErrorsRejected) continue;
    const SmoothErrors& errors = arm.found.errors;
    added.push_back({arm.robot, errors.lengths(), *solution.robot_noise[arm.robot], p_value});
    std::vector<std::shared_ptr<const PoseEffect>> effects;
    for (const RigCapture& capture : model->problem.captures) {
      effects.push_back(errors.EffectAt(capture.base_from_gripper[arm.robot]));
    }
    AddErrors(arm.robot, std::make_shared<const SharedEffects>(errors.effects()), effects, &with_errors.problem);
  }
  if (added.empty() || JudgeAgain(judge, &with_errors)) return {};
  *model = std::move(with_errors);
  return added;
}

}  // namespace heba
