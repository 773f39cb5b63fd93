#include "solvers/calibration/model_choice.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "heba/base/distributions.h"
#include "heba/base/error.h"
#include "heba/base/failure_code.h"
#include "solvers/calibration/lens_choice.h"
#include "solvers/refine/fit.h"
#include "solvers/refine/hand_eye_problem.h"
#include "solvers/residuals/inliers.h"
#include "solvers/residuals/loss.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

using Robot = BundleOptions::Robot;
using Effects = std::shared_ptr<const SharedEffects>;

struct FittedModel {
  ProblemModel model;
  AdjustmentOptions options;
  Solution solution;
  double log_likelihood = 0;
};

std::optional<FittedModel> FittedAs(const Problem& problem, const CellPoses& start, const ProblemModel& model,
                                    const AdjustmentOptions& options) {
  const Outcome<Solution> solution = RefineProblem(problem, start, options);
  if (!solution) return std::nullopt;
  return FittedModel{model, options, *solution, LogLikelihoodOf(problem, *solution, options)};
}

// Fits a model to its own optimum, which is at least as good as that of any model that it contains.
std::optional<FittedModel> FitModel(const ModelComparison& comparison, const ProblemModel& model,
                                    const std::vector<FittedModel>& fitted) {
  AdjustmentOptions options = comparison.options;
  options.robot = model.robot;
  const FittedModel* best_within = nullptr;
  const FittedModel* nearest = nullptr;
  for (const FittedModel& other : fitted) {
    if (!Contains(model, other.model)) continue;
    if (best_within == nullptr || other.log_likelihood > best_within->log_likelihood) best_within = &other;
    const bool has_same_shape = other.model.shapes == model.shapes;
    if (nearest == nullptr || has_same_shape) nearest = &other;
  }
  // Models of other shapes have nearly the same noise.
  if (nearest != nullptr && nearest->model.effects == model.effects)
    options = StartingFromNoise(std::move(options), nearest->solution);
  const Problem with_model = WithModel(comparison.problem, model, comparison.space);
  const auto fit_from = [&](const FittedModel& from, const AdjustmentOptions& of_fit) {
    return FittedAs(StartingFrom(with_model, from.solution), from.solution.poses, model, of_fit);
  };
  std::optional<FittedModel> found =
      nearest != nullptr ? fit_from(*nearest, options) : FittedAs(with_model, comparison.start, model, options);
  constexpr double kRounding = 1e-3;
  if (best_within == nullptr || (found && found->log_likelihood >= best_within->log_likelihood - kRounding)) {
    return found;
  }
  // Starts again from the smaller model with nearly no robot noise, because that model explains the data without it.
  AdjustmentOptions again = options;
  again.robot_noise_start = {1e-6, 1e-6};
  for (const std::optional<RobotNoise>& noise : best_within->solution.robot_noise) {
    if (!noise) continue;
    again.robot_noise_start = *noise;
    break;
  }
  std::optional<FittedModel> other = fit_from(*best_within, again);
  return other && (!found || other->log_likelihood > found->log_likelihood) ? other : found;
}

double PValueAgainst(const FittedModel& larger, const FittedModel& smaller) {
  return PValueOfRatio(smaller.log_likelihood, larger.log_likelihood,
                       {NumShapeParams(larger.model) - NumShapeParams(smaller.model),
                        NumVariances(larger.model) - NumVariances(smaller.model)},
                       larger.solution.covariance_dof);
}

// Returns whether a model lacks systematic errors of an arm that the largest one has.
bool LacksSystematic(const std::vector<Effects>& smaller, const std::vector<Effects>& largest) {
  for (size_t r = 0; r < largest.size(); ++r) {
    if (smaller[r] == nullptr && largest[r] != nullptr) return true;
  }
  return false;
}

// Returns whether the likelihood ratio alone does not reject a model.
bool IsLikelyEnough(std::optional<double> p, bool lacks_systematic) {
  return p.value_or(1) >= (lacks_systematic ? kRandomErrorsRejected : kModelRejected);
}

// Returns whether neither the likelihood ratio nor the odds reject a model.
bool IsAcceptable(std::optional<double> p, std::optional<double> odds, bool lacks_systematic) {
  return IsLikelyEnough(p, lacks_systematic) && (!odds || *odds >= kLeastOdds);
}

// The error models that were compared, and the one that was chosen.
struct ErrorModelChoice {
  std::vector<ProblemAlternative> alternatives;
  size_t chosen = 0;
  FittedModel best;
};

// Returns ModelAlternative::odds of a model beside the largest one that contains it.
std::optional<double> OddsBeside(const ModelComparison& comparison, const FittedModel& largest,
                                 const ProblemAlternative& smaller) {
  const std::vector<Effects>& kept = smaller.model.effects;
  const bool has_effects = std::any_of(kept.begin(), kept.end(), [](const Effects& one) { return one != nullptr; });
  if (!has_effects || !IsLikelyEnough(smaller.p, LacksSystematic(kept, largest.model.effects))) return std::nullopt;
  const std::optional<double> at_least = LogLikelihoodAtLeast(
      WithModel(comparison.problem, largest.model, comparison.space), largest.solution, largest.options, kept);
  return at_least ? std::optional<double>(std::exp(smaller.log_likelihood - *at_least)) : std::nullopt;
}

// Compares models that were fitted, the simplest first: each with the largest that contains it.
ErrorModelChoice Compare(const ModelComparison& comparison, std::vector<FittedModel> fitted) {
  ErrorModelChoice choice;
  std::optional<size_t> best;
  for (size_t k = 0; k < fitted.size(); ++k) {
    const FittedModel& smaller = fitted[k];
    ProblemAlternative alternative{smaller.model, smaller.log_likelihood, smaller.solution.robot_noise, std::nullopt,
                                   std::nullopt};
    const FittedModel* largest = nullptr;
    for (const FittedModel& other : fitted) {
      if (&other == &smaller || !Contains(other.model, smaller.model)) continue;
      if (largest == nullptr || DofOf(other.model) > DofOf(largest->model)) largest = &other;
    }
    if (largest != nullptr) {
      alternative.p = PValueAgainst(*largest, smaller);
      alternative.odds = OddsBeside(comparison, *largest, alternative);
    }
    const bool is_acceptable =
        largest == nullptr ||
        IsAcceptable(alternative.p, alternative.odds, LacksSystematic(smaller.model.effects, largest->model.effects));
    choice.alternatives.push_back(std::move(alternative));
    if (!is_acceptable) continue;
    const bool is_better = !best || (DofOf(smaller.model) == DofOf(fitted[*best].model) &&
                                     smaller.log_likelihood > fitted[*best].log_likelihood);
    if (is_better) best = k;
  }
  choice.chosen = *best;  // The largest is acceptable.
  choice.best = std::move(fitted[*best]);
  return choice;
}

// Chooses among error models with the same lenses, the simplest of which comes first. Returns nothing if none can be
// fitted.
std::optional<ErrorModelChoice> ChooseErrorModel(const ModelComparison& comparison,
                                                 const std::vector<ProblemModel>& candidates) {
  const auto fit = [&](const ProblemModel& model, const std::vector<FittedModel>& fitted) {
    std::optional<FittedModel> found = FitModel(comparison, model, fitted);
    if (found && !std::isfinite(found->log_likelihood)) found.reset();
    return found;
  };
  std::optional<FittedModel> largest;
  size_t num_smaller = candidates.size();
  while (!largest && num_smaller > 0) largest = fit(candidates[--num_smaller], {});
  if (!largest) return std::nullopt;
  std::vector<FittedModel> smaller;
  const auto compare = [&] {
    std::vector<FittedModel> fitted = smaller;
    fitted.push_back(*largest);
    return Compare(comparison, std::move(fitted));
  };
  ErrorModelChoice choice = compare();
  for (size_t k = 0; k < num_smaller; ++k) {
    // Models with more parameters than the chosen one cannot be chosen.
    if (DofOf(candidates[k]) > DofOf(choice.best.model)) break;
    std::optional<FittedModel> found = fit(candidates[k], smaller);
    if (!found) continue;
    smaller.push_back(std::move(*found));
    if (Contains(largest->model, smaller.back().model) && smaller.back().log_likelihood > largest->log_likelihood) {
      if (std::optional<FittedModel> again = fit(largest->model, smaller)) largest = std::move(again);
    }
    choice = compare();
  }
  return choice;
}

// Chooses the parts of an error model, group by group, the later ones as in `largest` until their turn comes.
std::optional<ErrorModelChoice> ChooseGroups(const ModelComparison& comparison,
                                             const std::vector<std::vector<PartOptions>>& groups,
                                             const ProblemModel& largest) {
  if (groups.empty()) return ChooseErrorModel(comparison, {largest});
  std::optional<ErrorModelChoice> choice;
  for (const std::vector<PartOptions>& group : groups) {
    std::optional<ErrorModelChoice> of_group =
        ChooseErrorModel(comparison, CombinationsOf(group, choice ? choice->best.model : largest));
    if (!of_group) break;
    if (choice) {
      of_group->chosen += choice->alternatives.size();
      of_group->alternatives.insert(of_group->alternatives.begin(), choice->alternatives.begin(),
                                    choice->alternatives.end());
    }
    choice = std::move(of_group);
  }
  return choice;
}

// A comparison with the chosen lenses.
struct ChosenLenses {
  ModelComparison comparison;
  std::vector<std::vector<CameraAlternative>> alternatives;  // One list per camera.
  bool has_others = false;                                   // Whether any lens is another one than before.
};

// Chooses the lens of each camera under an error model. Returns the Failure if no lens of a camera can be fitted.
Outcome<ChosenLenses> ChooseLenses(const ProblemModel& model, const ModelComparison& before,
                                   const std::vector<std::vector<CameraAlternative>>& alternatives) {
  ChosenLenses chosen{before, alternatives, false};
  ModelComparison& comparison = chosen.comparison;
  for (size_t c = 0; c < comparison.space.lenses.size(); ++c) {
    if (comparison.space.lenses[c].size() < 2) continue;
    Outcome<LensChoice> choice = ChooseLens(comparison, c, model);
    if (!choice) return choice.failure();
    const Camera& camera = choice->solution.cameras[c];
    const bool is_first = alternatives[c].empty();
    if (!is_first && camera.model == comparison.problem.cameras[c].camera.model) continue;
    chosen.has_others = true;
    comparison.problem.cameras[c].camera = camera;
    comparison.start = choice->solution.poses;
    chosen.alternatives[c] = std::move(choice->alternatives);
  }
  return chosen;
}

// A model, and its solution.
struct LargestFit {
  ProblemModel model;
  Solution solution;
};

// Returns the models that are fitted until one can be: the largest first, those with smaller parts of the later groups
// next.
std::vector<ProblemModel> ToTry(const std::vector<std::vector<PartOptions>>& groups, const ProblemModel& largest) {
  std::vector<ProblemModel> models = {largest};
  for (size_t g = groups.size(); g-- > 0;) {
    const std::vector<ProblemModel> combinations = CombinationsOf(groups[g], models.back());
    models.insert(models.end(), combinations.rbegin(), combinations.rend());
  }
  if (!groups.empty()) models.erase(models.begin());  // It is the largest combination, too.
  return models;
}

// Fits models to the problems with the lenses that are tried, until one can be. Returns the first Failure if none can.
Outcome<LargestFit> FitLargest(const std::vector<Problem>& with_lenses, const CellPoses& start,
                               const AdjustmentOptions& options_in, const std::vector<ProblemModel>& to_try,
                               const ModelSpace& space) {
  Failure first;
  AdjustmentOptions options = options_in;
  for (const Problem& with_lens : with_lenses) {
    for (const ProblemModel& model : to_try) {
      options.robot = model.robot;
      Outcome<Solution> solution = RefineProblem(WithModel(with_lens, model, space), start, options);
      if (solution) return LargestFit{model, std::move(*solution)};
      if (first.empty()) first = solution.failure();
    }
  }
  return first;
}

}  // namespace

bool IsAcceptable(const ModelAlternative& smaller, const ErrorModel& largest) {
  return IsAcceptable(smaller.p, smaller.odds, LacksSystematic({smaller.model.effects}, {largest.effects}));
}

std::optional<double> OddsAgainst(
    const ErrorModel& largest, const ModelAlternative& smaller,
    const std::function<std::optional<double>(const SharedEffects& smaller)>& log_likelihood_at_least) {
  const bool lacks_systematic = LacksSystematic({smaller.model.effects}, {largest.effects});
  if (smaller.model.effects == nullptr || !IsLikelyEnough(smaller.p, lacks_systematic)) return std::nullopt;
  const std::optional<double> at_least = log_likelihood_at_least(*smaller.model.effects);
  return at_least ? std::optional<double>(std::exp(smaller.log_likelihood - *at_least)) : std::nullopt;
}

double PValueOfRatio(double smaller_log_likelihood, double larger_log_likelihood, const ModelDifference& difference,
                     double covariance_dof) {
  const double statistic = std::max(0.0, 2 * (larger_log_likelihood - smaller_log_likelihood));
  const double num_shape = difference.num_shape;
  if (difference.num_variances > 0) {
    // A variance at its bound of zero counts for half of the data sets; the other half has one more parameter.
    const double num_params = num_shape + difference.num_variances;
    const double tail_of_fewer = num_params > 1 ? ChiSquareTail(statistic, num_params - 1) : statistic > 0 ? 0.0 : 1.0;
    return 0.5 * (tail_of_fewer + ChiSquareTail(statistic, num_params));
  }
  if (!std::isfinite(covariance_dof)) return ChiSquareTail(statistic, num_shape);
  // The likelihood ratio statistic of a linear model is (dof + k) log(1 + k F / dof).
  return FisherTail(covariance_dof / num_shape * std::expm1(statistic / (covariance_dof + num_shape)), num_shape,
                    covariance_dof);
}

std::vector<std::optional<EffectsFit>> FitEffects(
    const PairProblem& problem_in, const PairSolution& start, const BundleOptions& options_in,
    const std::vector<std::vector<std::shared_ptr<const PoseEffect>>>& effects_of_captures,
    const std::vector<std::vector<Matrix6X>>& joints_of_captures) {
  CHECK(joints_of_captures.empty() || joints_of_captures.size() == effects_of_captures.size());
  BundleOptions options = options_in;
  options.robot = Robot::kEstimatedNoise;
  options.loss = OfInliers(options_in.loss);
  options.effects_avoid_zero = false;
  PairProblem problem = WithoutRejected(problem_in, start);
  problem.camera = start.camera;
  problem.shape = start.shape;
  const Solution whole_start = ProblemSolution(start);
  std::vector<std::optional<EffectsFit>> fits;
  for (size_t k = 0; k < effects_of_captures.size(); ++k) {
    for (View& view : problem.views) {
      view.effect = effects_of_captures[k][view.capture];
      if (!joints_of_captures.empty()) view.gripper_by_joints = joints_of_captures[k][view.capture];
    }
    const Problem whole = WithFixedWeights(HandEyeProblem(problem, options), whole_start);
    const AdjustmentOptions& of_whole = options;
    const Outcome<Solution> solution = RefineProblem(whole, whole_start.poses, of_whole);
    std::optional<EffectsFit>& fit = fits.emplace_back();
    if (!solution) continue;
    const double log_likelihood = LogLikelihoodOf(whole, *solution, of_whole);
    if (std::isfinite(log_likelihood)) {
      fit = EffectsFit{log_likelihood, solution->robot_noise.front().value_or(RobotNoise{})};
    }
  }
  return fits;
}

ModelAlternative AlternativeOf(const ProblemAlternative& one, size_t robot,
                               const std::shared_ptr<const SharedEffects>& effects) {
  ErrorModel model = ModelOf(one.model, robot, 0);
  if (model.effects == nullptr) model.effects = effects;
  return {model, one.log_likelihood, one.robot_noise[robot], DofOf(model), one.p, one.odds};
}

Outcome<ProblemChoice> ChooseModel(const Problem& problem, const CellPoses& start, const AdjustmentOptions& options_in,
                                   const ModelSpace& space, const Solution* at_largest) {
  AdjustmentOptions options = options_in;
  const bool has_few_poses = GroupByRobotPoses(problem).size() < kMinPosesForVariances;
  if (space.robot_noise && has_few_poses) options.robot_noise_prior = IndustrialArmPrior();
  const std::vector<PartOptions> parts = PartsOf(problem, space, options, has_few_poses);
  const std::vector<std::vector<PartOptions>> groups = GroupParts(parts);
  const ProblemModel largest_of_all =
      LargestModel(problem, parts, space.robot_noise ? Robot::kEstimatedNoise : options.robot);
  const bool chooses_lens = std::any_of(space.lenses.begin(), space.lenses.end(),
                                        [](const std::vector<Camera>& lenses) { return lenses.size() > 1; });
  const bool is_known = at_largest != nullptr && !groups.empty() && HasModel(problem, options, largest_of_all);
  const Outcome<LargestFit> largest =
      is_known ? LargestFit{largest_of_all, *at_largest}
               : FitLargest(WithLenses(problem, space), start, options, ToTry(groups, largest_of_all), space);
  if (!largest) return largest.failure();
  if (parts.empty() && !chooses_lens) {
    Problem with_model = WithModel(problem, largest->model, space);
    options.robot = largest->model.robot;
    return ProblemChoice{std::move(with_model), options, largest->model, largest->solution, {}, 0, {}};
  }
  ModelComparison comparison{WithFixedWeights(WithoutRejected(problem, largest->solution), largest->solution),
                             largest->solution.poses, options, space};
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    comparison.problem.cameras[c].camera = largest->solution.cameras[c];
  }
  comparison.options.loss = OfInliers(options.loss);
  comparison.options.effects_avoid_zero = false;  // The models with variances of zero are part of the comparison.

  ProblemModel model = largest->model;
  ProblemChoice choice;
  choice.lenses.resize(space.lenses.size());
  std::optional<ErrorModelChoice> errors;
  constexpr int kMostRounds = 3;
  for (int round = 0; round < kMostRounds; ++round) {
    Outcome<ChosenLenses> chosen = ChooseLenses(model, comparison, choice.lenses);
    if (!chosen && !errors) return chosen.failure();
    if (round > 0 && !(chosen && chosen->has_others)) break;
    comparison = std::move(chosen->comparison);
    choice.lenses = std::move(chosen->alternatives);
    std::optional<ErrorModelChoice> next = ChooseGroups(comparison, groups, largest->model);
    if (!next && !errors) return Failure{FailureCode("no_error_model")};
    if (!next) break;
    errors = std::move(next);
    model = errors->alternatives[errors->chosen].model;
    if (!chooses_lens) break;
  }
  const FittedModel& best = errors->best;
  choice.alternatives = std::move(errors->alternatives);
  choice.chosen = errors->chosen;
  choice.model = model;
  choice.problem = WithModel(problem, model, space);
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const Camera& camera = best.solution.cameras[c];
    if (camera.model != problem.cameras[c].camera.model) choice.problem.cameras[c].camera = camera;
  }
  choice.options = best.options;
  choice.options.pixel_noise_start_px.clear();
  choice.options.loss = options_in.loss;
  choice.options.effects_avoid_zero = options_in.effects_avoid_zero;
  choice.solution = WithRejectedBefore(best.solution, largest->solution);
  choice.solution.unmodelled_sigma_px = largest->solution.unmodelled_sigma_px;
  return choice;
}

Outcome<ModelChoice> ChooseModel(const PairProblem& problem, const HandEye& start, const BundleOptions& options,
                                 const AutoModel& choose) {
  ModelSpace space;
  space.robot_noise = choose.robot_noise;
  space.shapes = {choose.target_shape};
  space.twists = space.shapes;
  space.lenses = {choose.lenses};
  BundleOptions with_fixed = options;
  if (!choose.effects.empty()) {
    with_fixed.effects = nullptr;
    ArmErrorModels& arm = space.arms.emplace_back();
    arm.models = choose.effects;
    std::vector<std::shared_ptr<const PoseEffect>>& effects = arm.effects_of_captures.emplace_back();
    for (const View& view : problem.views) effects.push_back(view.effect);
  }
  Outcome<ProblemChoice> chosen =
      ChooseModel(HandEyeProblem(problem, with_fixed), HandEyePosesOf(start), with_fixed, space);
  if (!chosen) return chosen.failure();
  const std::shared_ptr<const SharedEffects>& fixed = with_fixed.effects;
  ModelChoice choice;
  ErrorModel model = ModelOf(chosen->model, 0, 0);
  if (model.effects == nullptr) model.effects = fixed;
  choice.options = options;
  choice.options.robot = model.robot;
  choice.options.free_shape = model.shape;
  choice.options.effects = model.effects;
  choice.options.robot_noise_start = chosen->options.robot_noise_start;
  choice.options.robot_noise_prior = chosen->options.robot_noise_prior;
  choice.solution = HandEyeSolution(chosen->solution, choice.options);
  for (const ProblemAlternative& one : chosen->alternatives) {
    choice.alternatives.push_back(AlternativeOf(one, 0, fixed));
  }
  choice.chosen = chosen->chosen;
  if (!chosen->lenses.empty()) choice.lenses = std::move(chosen->lenses.front());
  return choice;
}

}  // namespace heba
