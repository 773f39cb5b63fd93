#include "solvers/calibration/model_search.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "heba/base/even_indices.h"
#include "heba/base/failure_code.h"
#include "heba/base/units.h"
#include "solvers/calibration/capture_outliers.h"
#include "solvers/calibration/choice_levels.h"
#include "solvers/calibration/posture_choice.h"
#include "solvers/calibration/smooth_search.h"
#include "solvers/refine/fit.h"
#include "solvers/refine/linearised_images.h"
#include "solvers/residuals/inliers.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// Returns a problem with errors of an arm; `effects` are functions of all its effects, one per capture.
Problem WithErrorsOfRobot(Problem problem, size_t robot, const std::shared_ptr<const SharedEffects>& model,
                          const std::vector<std::shared_ptr<const PoseEffect>>& effects) {
  problem = WithEffects(std::move(problem), robot, model, effects);
  // The lengths of an arm are told from the size of a target by what is known about either.
  for (ProblemTarget& target : problem.targets) {
    if (!target.scale_sigma) target.scale_sigma = AsMeasured(target.known_scale_sigma);
  }
  return problem;
}

// Returns by how much the scales of a target that a solution has found contradict what is known about them; 0 if they
// do not, or if they were held.
double Contradiction(const ProblemTarget& target, const Solution& solution, size_t index, double robot_scale_sigma) {
  constexpr double kContradicts = 4;
  const double known = std::hypot(target.known_scale_sigma, robot_scale_sigma);
  const Covariance& covariance = solution.covariance;
  const UnknownBlock block = covariance.layout.Block(TargetShapeBlock(target));
  double largest = 0;
  for (Eigen::Index i = block.first; i < block.end(); ++i) {
    if (covariance.layout[i].group != UnknownGroup::kScale) continue;
    const double deviation =
        std::abs(solution.shapes[index].params[static_cast<size_t>(covariance.layout[i].index)] - 1);
    const double limit = kContradicts * std::hypot(known, std::sqrt(covariance.matrix(i, i)));
    if (deviation > limit) largest = std::max(largest, deviation);
  }
  return largest;
}

// Returns a problem in which targets whose scales contradict what is known about them have a prior that does not hide
// it; nothing if there are none.
std::optional<Problem> WithWiderScales(Problem problem, const Solution& solution, double robot_scale_sigma) {
  bool has_any = false;
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    ProblemTarget& target = problem.targets[t];
    const double contradiction = Contradiction(target, solution, t, robot_scale_sigma);
    if (!target.scale_sigma || contradiction <= *target.scale_sigma) continue;
    target.scale_sigma = contradiction;
    has_any = true;
  }
  return has_any ? std::optional(std::move(problem)) : std::nullopt;
}

// Returns a problem with what makes the noise of an arm's joints part of that of its poses, if it is known.
Problem WithJoints(Problem problem, const ArmErrorModels& arm, size_t robot, const std::vector<size_t>& branches) {
  if (arm.joints_of_captures.empty()) return problem;
  for (size_t i = 0; i < problem.captures.size(); ++i) {
    std::vector<ArmPosture>& postures = problem.captures[i].postures;
    postures.resize(problem.robots.size());
    postures[robot].gripper_by_joints = arm.joints_of_captures[branches[i]][i];
  }
  return problem;
}

// Returns the effects of the captures in these configurations.
std::vector<std::shared_ptr<const PoseEffect>> EffectsIn(const ArmErrorModels& arm,
                                                         const std::vector<size_t>& branches) {
  std::vector<std::shared_ptr<const PoseEffect>> effects;
  for (size_t i = 0; i < branches.size(); ++i) effects.push_back(arm.effects_of_captures[branches[i]][i]);
  return effects;
}

// Returns a configuration for each capture, of which one set of errors explains all captures best (ChoosePostures).
// `fixed` is the problem at `solution`. Nothing if a point cannot be projected.
std::optional<std::vector<size_t>> BranchesOfCaptures(const ArmErrorModels& arm, size_t robot, const Problem& fixed,
                                                      const Solution& solution) {
  const std::vector<size_t> moving = MovingRobots(fixed);
  const auto place = std::find(moving.begin(), moving.end(), robot);
  std::optional<std::vector<LinearisedView>> views =
      LineariseEachCapture(WeightedAs(solution, fixed), StateOf(solution), NoiseOf(solution), LossOf(LossKind::kNone));
  if (place == moving.end() || !views) return std::nullopt;
  // The noise of the poses without errors of the arm; that of an exact arm is one that hides none.
  constexpr RobotNoise kOfExact = {1e-4, 1e-4};
  const std::vector<size_t> captures = CapturesWithPoints(fixed);
  PosturesOfCaptures postures = PosturesByErrors(arm, captures);
  postures.first_column = 6 * (place - moving.begin());
  postures.variances.resize(6 * static_cast<Eigen::Index>(moving.size()));
  for (size_t k = 0; k < moving.size(); ++k) {
    postures.variances.segment<6>(6 * static_cast<Eigen::Index>(k)) =
        CorrectionVariances(solution.robot_noise[moving[k]].value_or(kOfExact));
  }
  postures.views = std::move(*views);
  return BranchesOfAll(arm, captures, ChoosePostures(postures));
}

// Returns the configurations of an arm's captures that explain them best (MostProbableBranches).
std::optional<std::vector<size_t>> MostLikelyBranches(const ArmErrorModels& arm, size_t robot, const ModelSpace& parts,
                                                      const SearchedModel& model) {
  AdjustmentOptions options = model.options;
  options.loss = OfInliers(options.loss);
  options.robot = BundleOptions::Robot::kEstimatedNoise;
  options.effects_avoid_zero = false;
  const Solution& solution = model.judged.solution;
  Problem fixed = StartingFrom(WithFixedWeights(UsedPoints(model.problem, model.judged), solution), solution);
  for (size_t t = 0; t < parts.shapes.size(); ++t) {
    if (parts.shapes[t]) fixed.targets[t] = WithShape(std::move(fixed.targets[t]), TargetShapeCombinations().back());
  }
  const auto fit = [&](const std::vector<size_t>& branches) -> std::optional<FittedPostures<Solution>> {
    // The noise of the poses contains that of the joints where the captures do not determine it.
    const Problem without_joints = WithErrorsOfRobot(fixed, robot, ErrorsOfBranches(arm), EffectsIn(arm, branches));
    Problem with_errors = WithJoints(without_joints, arm, robot, branches);
    Outcome<Solution> refined = RefineProblem(with_errors, solution.poses, options);
    if (!refined && !arm.joints_of_captures.empty()) {
      with_errors = without_joints;
      refined = RefineProblem(with_errors, solution.poses, options);
    }
    if (!refined) return std::nullopt;
    const double log_likelihood = LogLikelihoodOf(with_errors, *refined, options);
    // The corrections of the poses contain the errors, of which `fixed` knows none.
    FittedPostures<Solution> fitted{WithEffectsOf(fixed, std::move(*refined)), log_likelihood};
    fitted.solution.effects.clear();
    fitted.solution.effect_sigmas.clear();
    return fitted;
  };
  const auto choose = [&](const Solution& at) { return BranchesOfCaptures(arm, robot, fixed, at); };
  return MostProbableBranches(arm, model.problem.captures.size(), std::optional(solution), fit, choose);
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
  const Problem used = UsedPoints(model.problem, model.judged);
  const std::vector<size_t> moving = MovingRobots(used);
  if (std::find(moving.begin(), moving.end(), robot) == moving.end()) {
    return FailureCode("idle_arm");
  }
  if (GroupByRobotPoses(used).size() < kMinPosesForVariances) {
    return FailureCode("few_captures_of_arm");
  }
  return {};
}

// Adjusts a model as it is, from its adjustment, and judges the images. Returns the Failure if that fails.
Outcome<SearchedModel> Readjusted(SearchedModel model, const Judge& judge) {
  JudgedProblem& judged = model.judged;
  Outcome<Solution> solution = RefineProblem(StartingFrom(Without(model.problem, judged.left_out), judged.solution),
                                             judged.solution.poses, model.options);
  if (!solution) return solution.failure();
  judged.solution = std::move(*solution);
  judged = judge(model.problem, std::move(judged), model.options);
  model.is_fitted = true;
  return model;
}

// Returns the initial guess of a camera that has the model of a lens that was chosen.
const Camera& GuessOf(const Camera& chosen, const Camera& now, const std::vector<Camera>& lenses) {
  const auto guess =
      std::find_if(lenses.begin(), lenses.end(), [&](const Camera& lens) { return lens.model == chosen.model; });
  return guess == lenses.end() || chosen.model == now.model ? now : *guess;
}

// Returns the model with the parts that one pass of WithChosenParts chooses.
Outcome<SearchedModel> ChosenOnce(SearchedModel model, const ModelSpace& space, const Judge& judge) {
  const Solution& solution = model.judged.solution;
  Problem used = Without(model.problem, model.judged.left_out);
  for (size_t c = 0; c < used.cameras.size(); ++c) used.cameras[c].camera = solution.cameras[c];
  const Outcome<ProblemChoice> choice =
      ChooseModel(used, solution.poses, model.options, space, model.is_fitted ? &solution : nullptr);
  if (!choice) return choice.failure();
  bool is_same = model.is_fitted && HasModel(model.problem, model.options, choice->model);
  for (size_t c = 0; c < space.lenses.size(); ++c) {
    Camera& camera = model.problem.cameras[c].camera;
    is_same = is_same && camera.model == choice->solution.cameras[c].model;
    camera = GuessOf(choice->solution.cameras[c], camera, space.lenses[c]);
  }
  model.problem = WithModel(std::move(model.problem), choice->model, space);
  model.options.robot = choice->model.robot;
  model.options.robot_noise_prior = choice->options.robot_noise_prior;
  model.model = choice->model;
  model.alternatives = choice->alternatives;
  if (!choice->lenses.empty()) model.lenses = choice->lenses;
  // The images have been judged under this model.
  if (is_same) return model;
  for (const std::optional<RobotNoise>& noise : choice->solution.robot_noise) {
    if (noise && !choice->alternatives.empty()) model.options.robot_noise_start = *noise;
  }
  model.judged.solution = choice->solution;
  model.is_fitted = true;
  // A single model has been fitted to its own inliers already; otherwise all points are judged again. The points of the
  // choice are a sound selection, too.
  if (!choice->alternatives.empty()) {
    if (Outcome<SearchedModel> readjusted = Readjusted(model, judge)) return readjusted;
  }
  model.judged = judge(model.problem, std::move(model.judged), model.options);
  return model;
}

// Returns the choice that keeps the judgement of the images.
JudgedProblem KeepImages(const Problem& /*problem*/, JudgedProblem at, const AdjustmentOptions& /*options*/) {
  return at;
}

// Returns why an arm's errors explain nothing: the noise of its poses stays. A better likelihood alone can be that of
// another arm, or of joints that belong to other poses. Empty if they explain something.
Failure WhyNothingExplained(const std::optional<RobotNoise>& before, const std::optional<RobotNoise>& after) {
  constexpr double kMostLeft = 0.7;
  if (!before || !after || after->translation_m <= kMostLeft * before->translation_m ||
      after->rotation_rad <= kMostLeft * before->rotation_rad) {
    return {};
  }
  return {FailureCode("little_explained"),
          {{"before_mm", 1000 * before->translation_m},
           {"before_deg", RadToDeg(before->rotation_rad)},
           {"after_mm", 1000 * after->translation_m},
           {"after_deg", RadToDeg(after->rotation_rad)}}};
}

// Returns whether a size of a target that contradicts what is known about it explains the poses of the arms better than
// smooth errors do: it is far from what is known beside these, too, and less white noise is left with it.
bool IsSizeWrong(const SearchedModel& as_known, const SearchedModel& widened, double robot_scale_sigma) {
  constexpr double kMostLeft = 0.7;
  const Solution& solution = widened.judged.solution;
  bool has_any = false;
  for (size_t t = 0; t < widened.problem.targets.size(); ++t) {
    has_any = has_any || Contradiction(widened.problem.targets[t], solution, t, robot_scale_sigma) > 0;
  }
  for (size_t r = 0; r < solution.robot_noise.size() && has_any; ++r) {
    const std::optional<RobotNoise>& before = as_known.judged.solution.robot_noise[r];
    const std::optional<RobotNoise>& after = solution.robot_noise[r];
    if (before && after && after->translation_m < kMostLeft * before->translation_m) return true;
  }
  return false;
}

// Returns the product of all sigmas of the arms' poses.
double NoiseVolume(const SearchedModel& model) {
  double volume = 1;
  for (size_t r = 0; r < model.problem.robots.size(); ++r) {
    const std::optional<RobotNoise> noise = NoiseOfPoses(model.problem, model.judged.solution, r);
    if (noise) volume *= noise->translation_m * noise->rotation_rad;
  }
  return volume;
}

}  // namespace

RobotNoise WithJointNoise(const RobotNoise& noise, const std::vector<Matrix6X>& gripper_by_joints) {
  double translation_m2 = 0;
  double rotation_rad2 = 0;
  for (const Matrix6X& by_joints : gripper_by_joints) {
    translation_m2 += by_joints.topRows<3>().squaredNorm() / 3;
    rotation_rad2 += by_joints.bottomRows<3>().squaredNorm() / 3;
  }
  const double variance_rad2 =
      noise.joint_rad * noise.joint_rad / std::max<double>(1, static_cast<double>(gripper_by_joints.size()));
  return {std::sqrt(noise.translation_m * noise.translation_m + variance_rad2 * translation_m2),
          std::sqrt(noise.rotation_rad * noise.rotation_rad + variance_rad2 * rotation_rad2), 0};
}

std::optional<RobotNoise> NoiseOfPoses(const Problem& problem, const Solution& solution, size_t robot) {
  const std::optional<RobotNoise>& noise = solution.robot_noise[robot];
  if (!noise) return std::nullopt;
  std::vector<Matrix6X> by_joints;
  for (const ProblemCapture& capture : problem.captures) {
    if (!capture.postures.empty()) by_joints.push_back(capture.postures[robot].gripper_by_joints);
  }
  return WithJointNoise(*noise, by_joints);
}

Outcome<SearchedModel> WithChosenParts(const SearchedModel& model, const ModelSpace& space, const Judge& judge) {
  Outcome<SearchedModel> chosen = ChosenOnce(model, space, judge);
  if (!chosen || chosen->judged.left_out == model.judged.left_out) return chosen;
  Outcome<SearchedModel> again = ChosenOnce(*chosen, space, KeepImages);
  if (again) chosen = std::move(again);
  return chosen;
}

SearchedModel WithChosenTwists(const SearchedModel& model, const std::vector<bool>& twists) {
  if (std::find(twists.begin(), twists.end(), true) == twists.end()) return model;
  ModelSpace space;
  space.twists = twists;
  Outcome<SearchedModel> chosen = ChosenOnce(model, space, KeepImages);
  if (!chosen || NoiseVolume(*chosen) > NoiseVolume(model)) return model;
  // The choice is one among models with the same errors of arms.
  chosen->model.effects = model.model.effects;
  for (ProblemAlternative& one : chosen->alternatives) one.model.effects = model.model.effects;
  chosen->alternatives.insert(chosen->alternatives.begin(), model.alternatives.begin(), model.alternatives.end());
  chosen->lenses = model.lenses;
  return *std::move(chosen);
}

ModelWithArmErrors WithArmErrors(const SearchedModel& model, const ErrorSpace& space, const Judge& judge) {
  SearchedModel with_errors = model;
  ModelSpace parts = space.parts;
  parts.arms.resize(space.arms.size());
  std::vector<ArmErrorChoice> choices;
  bool has_any = false;
  bool is_any_chosen = false;
  for (size_t r = 0; r < space.arms.size(); ++r) {
    const ArmErrorModels& arm = space.arms[r];
    const bool has_models = !arm.models.empty();
    if (!has_models && arm.joints_of_captures.empty()) continue;
    ArmErrorChoice& choice = choices.emplace_back();
    choice.robot = r;
    choice.noise_before = model.judged.solution.robot_noise[r];
    if (has_models) choice.reason = WhyNotEstimable(model, space.parts, r);
    if (!choice.reason.empty()) continue;
    std::optional<std::vector<size_t>> branches = MostLikelyBranches(arm, r, space.parts, model);
    if (!branches) {
      choice.reason = FailureCode("no_configuration_fits");
      continue;
    }
    choice.branches = std::move(*branches);
    with_errors.problem = WithJoints(std::move(with_errors.problem), arm, r, choice.branches);
    has_any = true;
    if (!has_models) continue;
    choice.model = arm.models.back();
    const std::vector<std::shared_ptr<const PoseEffect>> effects = EffectsIn(arm, choice.branches);
    if (arm.is_chosen) parts.arms[r] = {arm.models, true, {effects}};
    is_any_chosen = is_any_chosen || arm.is_chosen;
    with_errors.problem = WithErrorsOfRobot(std::move(with_errors.problem), r, choice.model, effects);
  }
  if (!has_any) return {model, choices};
  const auto decline_all = [&](const Failure& failure) -> ModelWithArmErrors {
    for (ArmErrorChoice& choice : choices) {
      choice.model = nullptr;
      if (choice.reason.empty()) choice.reason = {FailureCode("arm_refinement_failed"), {}, {}, {failure}};
    }
    return {model, choices};
  };
  // Captures in a region where the errors of an arm are large are no outliers of a model that has these errors. Such
  // captures come in clusters, which the model has to see before it can be asked.
  with_errors.judged.left_out.clear();
  with_errors.is_fitted = false;
  if (space.parts.robot_noise) with_errors.options.robot = BundleOptions::Robot::kEstimatedNoise;
  // A twist that was chosen without the errors may be one of them. It is chosen beside them, after the images have been
  // judged.
  parts.twists.clear();
  for (size_t t = 0; t < space.parts.shapes.size(); ++t) {
    if (!space.parts.shapes[t]) continue;
    ProblemTarget& target = with_errors.problem.targets[t];
    target = WithShape(target, WithGroup(target.free_shape, TargetShapeGroup::kTwist, false));
  }
  Outcome<SearchedModel> adjusted = Readjusted(with_errors, judge);
  if (!adjusted) {
    with_errors.problem = WithoutNoisyJoints(std::move(with_errors.problem));
    adjusted = Readjusted(with_errors, judge);
  }
  if (!adjusted) return decline_all(adjusted.failure());
  const Outcome<SearchedModel> chosen = WithChosenParts(*adjusted, parts, judge);
  if (!chosen) return decline_all(chosen.failure());
  with_errors = WithChosenTwists(*chosen, space.parts.twists);
  for (ArmErrorChoice& choice : choices) {
    if (parts.arms[choice.robot].models.empty()) continue;
    choice.model = with_errors.model.effects[choice.robot];
    choice.alternatives = AlternativesOf(with_errors, choice.robot);
    if (choice.model == nullptr) choice.reason = WhyNone(with_errors, choice.alternatives, choice.robot);
  }
  for (const ArmErrorChoice& choice : choices) {
    if (choice.model == nullptr || !space.arms[choice.robot].is_chosen) continue;
    const Failure reason = WhyNothingExplained(
        choice.noise_before, NoiseOfPoses(with_errors.problem, with_errors.judged.solution, choice.robot));
    if (reason.empty()) continue;
    // The others are judged without this arm.
    ErrorSpace without = space;
    without.arms[choice.robot] = {};
    ModelWithArmErrors of_others = WithArmErrors(model, without, judge);
    ArmErrorChoice declined = choice;
    declined.model = nullptr;
    declined.reason = reason;
    of_others.arms.push_back(std::move(declined));
    return of_others;
  }
  const bool is_declined =
      is_any_chosen &&
      std::all_of(choices.begin(), choices.end(), [](const ArmErrorChoice& choice) { return choice.model == nullptr; });
  if (is_declined) return {model, std::move(choices)};
  return {std::move(with_errors), std::move(choices)};
}

ModelWithSmoothErrors WithSmoothErrors(const SearchedModel& model, const ErrorSpace& space, const Judge& judge) {
  const Problem& problem = model.problem;
  const std::vector<Eigen::Index> num_joints = NoisyJointsOf(problem, MovingRobots(problem));
  const bool has_noisy_joints = std::any_of(num_joints.begin(), num_joints.end(), [](Eigen::Index n) { return n > 0; });
  const bool is_free = model.options.robot == BundleOptions::Robot::kEstimatedNoise || space.parts.robot_noise;
  if (space.smooth == SmoothPoseErrors::kNone || !is_free || has_noisy_joints || model.options.robot_noise_prior) {
    return {model, {}};
  }
  const Solution& solution = model.judged.solution;
  std::vector<AddedSmoothErrors> added;
  SearchedModel with_errors = model;
  for (SmoothErrorsOfArm& arm : FindSmoothErrorsOfArms(UsedPoints(model.problem, model.judged), solution)) {
    const double p_value = PValueWithout(arm.found);
    const bool are_likely = space.must_be_shown ? p_value < kRandomErrorsRejected : AreLikely(arm.found);
    if (space.smooth == SmoothPoseErrors::kAuto && !are_likely) continue;
    const auto errors = std::make_shared<const SmoothErrors>(std::move(arm.found.errors));
    added.push_back({arm.robot, errors, solution.robot_noise[arm.robot].value_or(RobotNoise{}), p_value,
                     arm.found.log_likelihood_gain, arm.found.odds_without});
    std::vector<std::shared_ptr<const PoseEffect>> effects;
    for (const ProblemCapture& capture : model.problem.captures) {
      effects.push_back(errors->EffectAt(capture.base_from_gripper[arm.robot]));
    }
    with_errors.problem = WithErrorsOfRobot(std::move(with_errors.problem), arm.robot,
                                            std::make_shared<const SharedEffects>(errors->effects()), effects);
  }
  if (added.empty()) return {model, {}};
  with_errors.options.robot = BundleOptions::Robot::kEstimatedNoise;
  with_errors.alternatives.clear();
  Outcome<SearchedModel> adjusted = Readjusted(with_errors, judge);
  if (!adjusted) return {model, {}};
  // A prior on the size of a target must not make its contradiction one of the robot. With white noise alone, the size
  // may seem to be wrong because the robot is.
  if (std::optional<Problem> wider = WithWiderScales(with_errors.problem, solution, space.robot_scale_sigma)) {
    with_errors.problem = *std::move(wider);
    Outcome<SearchedModel> widened = Readjusted(with_errors, judge);
    if (widened && IsSizeWrong(*adjusted, *widened, space.robot_scale_sigma)) adjusted = std::move(widened);
  }
  return {*std::move(adjusted), std::move(added)};
}

}  // namespace heba
