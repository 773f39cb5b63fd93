#include "solvers/calibration/model_search.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "heba/base/failure_code.h"
#include "solvers/calibration/choice_levels.h"
#include "solvers/calibration/smooth_search.h"
#include "solvers/refine/fit.h"

namespace heba {
namespace {

// Adds errors of an arm to a problem; `effects` are functions of all its effects, one per capture.
void SetErrors(size_t robot, const std::shared_ptr<const SharedEffects>& model,
               const std::vector<std::shared_ptr<const PoseEffect>>& effects, RigProblem* problem) {
  SetEffects(robot, model, effects, problem);
  // The lengths of an arm are told from the size of a target by what is known about either.
  for (RigTarget& target : problem->targets) {
    if (!target.scale_sigma) target.scale_sigma = kPrintScaleSigma;
  }
}

// Adds what makes the noise of an arm's joints part of that of its poses, if it is known.
void SetJoints(const RigArmErrors& arm, size_t robot, size_t branch, RigProblem* problem) {
  if (arm.joints_of_captures.empty()) return;
  for (size_t i = 0; i < problem->captures.size(); ++i) {
    std::vector<ArmPosture>& postures = problem->captures[i].postures;
    postures.resize(problem->robots.size());
    postures[robot].gripper_by_joints = arm.joints_of_captures[branch][i];
  }
}

// Returns the index of the possible effects of an arm's captures that explain them best: that of the largest restricted
// likelihood. Nothing if none can be fitted.
std::optional<size_t> MostLikelyBranch(const RigArmErrors& arm, size_t robot, const ModelSpace& parts,
                                       const SearchedModel& model) {
  RigOptions options = model.options;
  if (options.loss == LossKind::kTruncated) options.loss = LossKind::kNone;
  options.robot = BundleOptions::Robot::kEstimatedNoise;
  options.effects_avoid_zero = false;
  const RigSolution& solution = model.judged.solution;
  RigProblem fixed = StartingFrom(WithFixedWeights(UsedPoints(model.problem, model.judged), solution), solution);
  for (size_t t = 0; t < parts.shapes.size(); ++t) {
    if (parts.shapes[t]) fixed.targets[t].free_shape = TargetShapeCombinations().back();
  }
  std::optional<size_t> best;
  double best_log_likelihood = 0;
  for (size_t k = 0; k < arm.effects_of_captures.size(); ++k) {
    RigProblem with_errors = fixed;
    SetErrors(robot, arm.of_branches != nullptr ? arm.of_branches : arm.models.back(), arm.effects_of_captures[k],
              &with_errors);
    SetJoints(arm, robot, k, &with_errors);
    const Outcome<RigSolution> refined = RefineRig(with_errors, solution.poses, options);
    if (!refined) continue;
    const double log_likelihood = LogLikelihoodOf(with_errors, *refined, options);
    if (!std::isfinite(log_likelihood) || (best && log_likelihood <= best_log_likelihood)) continue;
    best = k;
    best_log_likelihood = log_likelihood;
  }
  return best;
}

// Returns the models of one arm that were compared beside the chosen ones of the other arms.
std::vector<ModelAlternative> AlternativesOf(const SearchedModel& chosen, size_t robot) {
  std::vector<ModelAlternative> alternatives;
  for (const ProblemAlternative& one : chosen.alternatives) {
    ProblemModel others = one.model;
    others.effects[robot] = chosen.model.effects[robot];
    if (others.effects == chosen.model.effects) alternatives.push_back(AlternativeOf(one, robot, nullptr));
  }
  return alternatives;
}

// Returns why no model of an arm's errors was taken.
Failure WhyNone(const SearchedModel& chosen, const std::vector<ModelAlternative>& alternatives, size_t robot) {
  const ErrorModel none = ModelOf(chosen.model, robot, 0);
  const ModelAlternative* without = nullptr;
  const ModelAlternative* best = nullptr;
  for (const ModelAlternative& one : alternatives) {
    const bool is_none = one.model.effects == nullptr;
    if (is_none && one.model.robot == none.robot && one.model.shape == none.shape) without = &one;
    if (!is_none && (best == nullptr || one.log_likelihood > best->log_likelihood)) best = &one;
  }
  if (without == nullptr || best == nullptr) {
    return FailureCode("few_captures_of_arm");
  }
  return {FailureCode("no_better_than_noise"),
          {{"gain", std::max(0.0, best->log_likelihood - without->log_likelihood)},
           {"parameters", best->dof - without->dof}},
          {{"errors", best->model.effects->name}}};
}

// Returns why the errors of an arm cannot be estimated; empty if they can.
Failure WhyNotEstimable(const SearchedModel& model, const ModelSpace& parts, size_t robot) {
  if (model.options.robot != BundleOptions::Robot::kEstimatedNoise && !parts.robot_noise) {
    return FailureCode("held_arm_noise");
  }
  const RigProblem used = UsedPoints(model.problem, model.judged);
  const std::vector<size_t> moving = MovingRobots(used);
  if (std::find(moving.begin(), moving.end(), robot) == moving.end()) {
    return FailureCode("idle_arm");
  }
  if (GroupByRobotPoses(used).size() < kMinPosesForVariances) {
    return FailureCode("few_captures_of_arm");
  }
  return {};
}

// Adjusts a model as it is, from its adjustment, and judges the images. Returns the Failure if that fails, which
// changes nothing.
std::optional<Failure> Readjust(const Judge& judge, SearchedModel* model) {
  JudgedRig& judged = model->judged;
  Outcome<RigSolution> solution = RefineRig(StartingFrom(Without(model->problem, judged.left_out), judged.solution),
                                            judged.solution.poses, model->options);
  if (!solution) return solution.failure();
  judged.solution = std::move(*solution);
  judged = judge(model->problem, std::move(judged), model->options);
  model->is_fitted = true;
  return std::nullopt;
}

// Returns the initial guess of a camera that has the model of a lens that was chosen.
const Camera& GuessOf(const Camera& chosen, const Camera& now, const std::vector<Camera>& lenses) {
  const auto guess =
      std::find_if(lenses.begin(), lenses.end(), [&](const Camera& lens) { return lens.model == chosen.model; });
  return guess == lenses.end() || chosen.model == now.model ? now : *guess;
}

std::optional<Failure> ChooseOnce(const ModelSpace& space, const Judge& judge, SearchedModel* model) {
  const RigSolution& solution = model->judged.solution;
  RigProblem used = Without(model->problem, model->judged.left_out);
  for (size_t c = 0; c < used.cameras.size(); ++c) used.cameras[c].camera = solution.cameras[c];
  const Outcome<ProblemChoice> choice =
      ChooseModel(used, solution.poses, model->options, space, model->is_fitted ? &solution : nullptr);
  if (!choice) return choice.failure();
  bool is_same = model->is_fitted && HasModel(model->problem, model->options, choice->model);
  for (size_t c = 0; c < space.lenses.size(); ++c) {
    Camera& camera = model->problem.cameras[c].camera;
    is_same = is_same && camera.model == choice->solution.cameras[c].model;
    camera = GuessOf(choice->solution.cameras[c], camera, space.lenses[c]);
  }
  model->problem = WithModel(std::move(model->problem), choice->model, space);
  model->options.robot = choice->model.robot;
  model->options.robot_noise_prior = choice->options.robot_noise_prior;
  model->model = choice->model;
  model->alternatives = choice->alternatives;
  if (!choice->lenses.empty()) model->lenses = choice->lenses;
  // The images have been judged under this model.
  if (is_same) return std::nullopt;
  for (const std::optional<RobotNoise>& noise : choice->solution.robot_noise) {
    if (noise && !choice->alternatives.empty()) model->options.robot_noise_start = *noise;
  }
  model->judged.solution = choice->solution;
  model->is_fitted = true;
  // A single model has been fitted to its own inliers already; otherwise all points are judged again. The points of the
  // choice are a sound selection, too.
  if (choice->alternatives.empty() || Readjust(judge, model)) {
    model->judged = judge(model->problem, std::move(model->judged), model->options);
  }
  return std::nullopt;
}

// Adds the errors of the arms, as AddErrors.
std::vector<RigArmChoice> AddArmErrors(const ErrorSpace& space, const Judge& judge, SearchedModel* model) {
  SearchedModel with_errors = *model;
  ModelSpace parts = space.parts;
  parts.arms.resize(space.arms.size());
  std::vector<RigArmChoice> choices;
  bool has_any = false;
  bool is_any_chosen = false;
  for (size_t r = 0; r < space.arms.size(); ++r) {
    const RigArmErrors& arm = space.arms[r];
    const bool has_models = !arm.models.empty();
    if (!has_models && arm.joints_of_captures.empty()) continue;
    RigArmChoice& choice = choices.emplace_back();
    choice.robot = r;
    choice.noise_before = model->judged.solution.robot_noise[r];
    if (has_models) choice.reason = WhyNotEstimable(*model, space.parts, r);
    if (!choice.reason.empty()) continue;
    const std::optional<size_t> branch =
        arm.effects_of_captures.size() == 1 ? 0 : MostLikelyBranch(arm, r, space.parts, *model);
    if (!branch) {
      choice.reason = FailureCode("no_configuration_fits");
      continue;
    }
    choice.branch = *branch;
    SetJoints(arm, r, *branch, &with_errors.problem);
    has_any = true;
    if (!has_models) continue;
    choice.model = arm.models.back();
    if (arm.is_chosen) parts.arms[r] = {arm.models, true, {arm.effects_of_captures[*branch]}};
    is_any_chosen = is_any_chosen || arm.is_chosen;
    SetErrors(r, choice.model, arm.effects_of_captures[*branch], &with_errors.problem);
  }
  if (!has_any) return choices;
  const auto decline_all = [&](const Failure& failure) {
    for (RigArmChoice& choice : choices) {
      choice.model = nullptr;
      if (choice.reason.empty()) choice.reason = {FailureCode("arm_refinement_failed"), {}, {}, {failure}};
    }
    return choices;
  };
  // Captures in a region where the errors of an arm are large are no outliers of a model that has these errors. Such
  // captures come in clusters, which the model has to see before it can be asked.
  with_errors.judged.left_out.clear();
  with_errors.is_fitted = false;
  if (space.parts.robot_noise) with_errors.options.robot = BundleOptions::Robot::kEstimatedNoise;
  if (const std::optional<Failure> failure = Readjust(judge, &with_errors)) return decline_all(*failure);
  if (const std::optional<Failure> failure = ChooseParts(parts, judge, &with_errors)) return decline_all(*failure);
  for (RigArmChoice& choice : choices) {
    if (parts.arms[choice.robot].models.empty()) continue;
    choice.model = with_errors.model.effects[choice.robot];
    choice.alternatives = AlternativesOf(with_errors, choice.robot);
    if (choice.model == nullptr) choice.reason = WhyNone(with_errors, choice.alternatives, choice.robot);
  }
  const bool is_declined = is_any_chosen && std::all_of(choices.begin(), choices.end(), [](const RigArmChoice& choice) {
                             return choice.model == nullptr;
                           });
  if (!is_declined) *model = std::move(with_errors);
  return choices;
}

// Adds the smooth errors, as AddErrors.
std::vector<RigSmoothErrors> AddSmoothErrors(const ErrorSpace& space, const Judge& judge, SearchedModel* model) {
  const bool is_free = model->options.robot == BundleOptions::Robot::kEstimatedNoise || space.parts.robot_noise;
  std::vector<RigSmoothErrors> added;
  if (space.smooth == SmoothPoseErrors::kNone || !is_free || model->options.robot_noise_prior) return added;
  const RigSolution& solution = model->judged.solution;
  SearchedModel with_errors = *model;
  for (SmoothErrorsOfArm& arm : FindSmoothErrorsOfArms(UsedPoints(model->problem, model->judged), solution)) {
    const double p_value = PValueWithout(arm.found);
    const bool are_likely = space.must_be_shown ? p_value < kRandomErrorsRejected : AreLikely(arm.found);
    if (space.smooth == SmoothPoseErrors::kAuto && !are_likely) continue;
    const auto errors = std::make_shared<const SmoothErrors>(std::move(arm.found.errors));
    added.push_back({arm.robot, errors, solution.robot_noise[arm.robot].value_or(RobotNoise{}), p_value,
                     arm.found.log_likelihood_gain, arm.found.odds_without});
    std::vector<std::shared_ptr<const PoseEffect>> effects;
    for (const RigCapture& capture : model->problem.captures) {
      effects.push_back(errors->EffectAt(capture.base_from_gripper[arm.robot]));
    }
    SetErrors(arm.robot, std::make_shared<const SharedEffects>(errors->effects()), effects, &with_errors.problem);
  }
  if (added.empty()) return added;
  ModelSpace parts = space.parts;
  parts.robot_noise = false;
  with_errors.options.robot = BundleOptions::Robot::kEstimatedNoise;
  with_errors.is_fitted = false;
  if (ChooseParts(parts, judge, &with_errors)) return {};
  *model = std::move(with_errors);
  return added;
}

}  // namespace

std::optional<Failure> ChooseParts(const ModelSpace& space, const Judge& judge, SearchedModel* model) {
  SearchedModel chosen = *model;
  if (const std::optional<Failure> failure = ChooseOnce(space, judge, &chosen)) return failure;
  SearchedModel again = chosen;
  const Judge keep = [](const RigProblem&, JudgedRig at, const RigOptions&) { return at; };
  const bool has_other_images = chosen.judged.left_out != model->judged.left_out;
  if (has_other_images && !ChooseOnce(space, keep, &again)) chosen = std::move(again);
  *model = std::move(chosen);
  return std::nullopt;
}

FoundErrors AddErrors(const ErrorSpace& space, const Judge& judge, SearchedModel* model) {
  FoundErrors found;
  found.arms = AddArmErrors(space, judge, model);
  const std::vector<Eigen::Index> num_joints = NoisyJointsOf(model->problem, MovingRobots(model->problem));
  const bool has_noisy_joints = std::any_of(num_joints.begin(), num_joints.end(), [](Eigen::Index n) { return n > 0; });
  if (!has_noisy_joints) found.smooth = AddSmoothErrors(space, judge, model);
  return found;
}

}  // namespace heba
