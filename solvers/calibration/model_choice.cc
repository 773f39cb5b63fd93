

#include "solvers/calibration/model_choice.h"
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include "heba/base/distributions.h"
#include "heba/base/error.h"
#include "solvers/calibration/camera_choice.h"
#include "solvers/calibration/smooth_search.h"
#include "solvers/refine/bundle_model.h"
#include "solvers/refine/fit.h"
#include "solvers/refine/hand_eye_problem.h"
#include "solvers/residuals/inliers.h"
#include "solvers/residuals/noise_scale.h"
#include "solvers/residuals/repeated_poses.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

using Robot = BundleOptions::Robot;

struct FittedModel {
  ErrorModel model;
  BundleOptions options;
  Solution solution;
  double log_likelihood = 0;
};

int NumShapeParams(const ErrorModel& model) { return 2 * static_cast<int>(model.shape.size()); }

// Returns whether all of `smaller` are among `larger`; null stands for no effects.
bool Contains(const SharedEffects* larger, const SharedEffects* smaller) {
  if (smaller == nullptr) return true;
  return larger != nullptr && larger->num_all == smaller->num_all &&
         std::all_of(smaller->effects.begin(), smaller->effects.end(), [&](const SharedEffect& effect) {
           return std::any_of(larger->effects.begin(), larger->effects.end(),
                              [&](const SharedEffect& other) { return other.index == effect.index; });
         });
}

bool Contains(const ErrorModel& larger, const ErrorModel& smaller) {
  return NumVariances(larger) >= NumVariances(smaller) && Contains(larger.effects.get(), smaller.effects.get()) &&
         std::all_of(smaller.shape.begin(), smaller.shape.end(), [&](TargetShapeGroup group) {
           return std::find(larger.shape.begin(), larger.shape.end(), group) != larger.shape.end();
         });
}

// Returns the models to compare, in the order of their number of parameters.
std::vector<ErrorModel> Candidates(const BundleOptions& options, const AutoModel& choose, bool has_few_poses) {
  std::vector<Robot> robots = {options.robot};
  if (choose.robot_noise) robots = {Robot::kExact, Robot::kEstimatedNoise};
  if (choose.robot_noise && has_few_poses) robots = {Robot::kEstimatedNoise};
  std::vector<std::vector<TargetShapeGroup>> shapes = {options.free_shape};
  if (choose.target_shape) {
    shapes = {
        {}, {TargetShapeGroup::kScale}, {TargetShapeGroup::kBend}, {TargetShapeGroup::kScale, TargetShapeGroup::kBend}};
  }
  // Systematic errors are modelled beside the random ones, never instead of them.
  std::vector<std::shared_ptr<const SharedEffects>> effects = {choose.effects.empty() ? options.effects : nullptr};
  if (!has_few_poses) effects.insert(effects.end(), choose.effects.begin(), choose.effects.end());
  std::vector<ErrorModel> candidates;
  for (const Robot robot : robots) {
    for (const std::vector<TargetShapeGroup>& shape : shapes) {
      for (const auto& of_robot : effects) {
        const bool is_random_only = of_robot == nullptr || choose.effects.empty();
        if (is_random_only || robot != Robot::kExact) candidates.push_back({robot, shape, of_robot});
      }
    }
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const ErrorModel& a, const ErrorModel& b) { return DofOf(a) < DofOf(b); });
  return candidates;
}

// Returns the options of a model.
BundleOptions OptionsOf(const ErrorModel& model, BundleOptions options) {
  options.robot = model.robot;
  options.free_shape = model.shape;
  options.effects = model.effects;
  return options;
}

// Returns the problem with fixed weights, computed from the residuals of one fit and used in all fits that follow.
Problem WithFixedWeights(const Problem& problem, std::optional<double> unmodelled_sigma_px) {
  Problem fixed = problem;
  if (unmodelled_sigma_px) WeightByCovariance(*unmodelled_sigma_px, &fixed.views);
  for (View& view : fixed.views) view.observations.covariances_px2.clear();
  return fixed;
}

std::optional<FittedModel> Fit(const Problem& problem, const HandEye& start, const ErrorModel& model,
                               const BundleOptions& options) {
  const Outcome<Solution> solution = RefineHandEye(problem, start, options);
  if (!solution) return std::nullopt;
  return FittedModel{model, options, *solution, LogLikelihoodOf(problem, *solution, options)};
}

std::optional<FittedModel> FitFrom(const Problem& problem, const FittedModel& from, const ErrorModel& model,
                                   const BundleOptions& options) {
  Problem at = problem;
  at.camera = from.solution.camera;
  at.shape = from.solution.shape;
  return Fit(at, from.solution.hand_eye, model, options);
}

// Fits a model to its own optimum, which is at least as good as that of any model that it contains.
std::optional<FittedModel> FitModel(const Problem& problem, const HandEye& start, const ErrorModel& model,
                                    BundleOptions options, const std::vector<FittedModel>& fitted) {
  options = OptionsOf(model, std::move(options));
  const FittedModel* best_within = nullptr;
  const FittedModel* nearest = nullptr;
  for (const FittedModel& other : fitted) {
    if (!Contains(model, other.model)) continue;
    if (best_within == nullptr || other.log_likelihood > best_within->log_likelihood) best_within = &other;
    const bool has_same_shape = other.model.shape == model.shape;
    if (nearest == nullptr || has_same_shape) nearest = &other;
  }
  // Models of other shapes have nearly the same noise. A start at zero would stay there.
  if (nearest != nullptr && nearest->model.effects == model.effects && nearest->solution.robot_noise) {
    constexpr double kLeast = 1e-5;
    const RobotNoise& noise = *nearest->solution.robot_noise;
    options.robot_noise_start.translation_m = std::max(kLeast, noise.translation_m);
    options.robot_noise_start.rotation_rad = std::max(kLeast, noise.rotation_rad);
  }
  std::optional<FittedModel> found =
      nearest != nullptr ? FitFrom(problem, *nearest, model, options) : Fit(problem, start, model, options);
  constexpr double kRounding = 1e-3;
  if (best_within == nullptr || (found && found->log_likelihood >= best_within->log_likelihood - kRounding)) {
    return found;
  }
  // Starts again from the smaller model with nearly no robot noise, because that model explains the data without it.
  constexpr RobotNoise kAlmostExact = {1e-6, 1e-6};
  BundleOptions again = options;
  again.robot_noise_start = best_within->solution.robot_noise.value_or(kAlmostExact);
  std::optional<FittedModel> other = FitFrom(problem, *best_within, model, again);
  return other && (!found || other->log_likelihood > found->log_likelihood) ? other : found;
}

double ChanceAgainst(const FittedModel& larger, const FittedModel& smaller) {
  return ChanceOfRatio(smaller.log_likelihood, larger.log_likelihood,
                       {NumShapeParams(larger.model) - NumShapeParams(smaller.model),
                        NumVariances(larger.model) - NumVariances(smaller.model)},
                       larger.solution.covariance_dof);
}

// Returns whether the likelihood ratio alone does not reject a model.
bool IsLikelyEnough(const ModelAlternative& smaller, const ErrorModel& largest) {
  const bool lacks_systematic = smaller.model.effects == nullptr && largest.effects != nullptr;
  return smaller.p.value_or(1) >= (lacks_systematic ? kRandomErrorsRejected : kModelRejected);
}

// Returns the options with all noise held at that of a solution.
BundleOptions WithNoiseOf(const Solution& solution, BundleOptions options) {
  options.pixel_noise_px = solution.pixel_sigma_px;
  if (solution.robot_noise) {
    options.robot = Robot::kGivenNoise;
    options.robot_noise = *solution.robot_noise;
  }
  if (options.effects != nullptr) {
    auto effects = std::make_shared<SharedEffects>(*options.effects);
    for (size_t g = 0; g < effects->groups.size(); ++g) effects->groups[g].sigma = solution.effect_sigmas[g];
    options.effects = std::move(effects);
  }
  return options;
}

// Returns minus the log-likelihood of the captures at each robot pose.
std::vector<double> CaptureCosts(const Problem& problem, const Solution& solution, const BundleOptions& options) {
  const RigProblem whole = HandEyeProblem(problem, options);
  const RigSolution of_whole = ProblemSolution(solution);
  return GroupCosts(whole, GroupByRobotPoses(whole), StateOf(of_whole), NoiseOf(of_whole), InlierLoss(options));
}

// A lens that was fitted with the noise of the largest one.
struct FittedLens {
  Solution solution;
  std::vector<double> costs;  // CaptureCosts.
  size_t alternative = 0;     // Index in LensChoice::alternatives.
};

struct LensChoice {
  Problem problem;  // With the camera, and the shape, of the chosen lens.
  HandEye start;
  std::vector<CameraAlternative> alternatives;
};

// Chooses the smallest lens that no larger one rejects, under the error model of `options`; one without distortion only
// if no other one can be fitted. Returns a Failure if none can be fitted.
Outcome<LensChoice> ChooseLens(const Problem& problem, const HandEye& start, const std::vector<Camera>& lenses,
                               const BundleOptions& options) {
  LensChoice choice;
  for (const Camera& lens : lenses) {
    choice.alternatives.push_back({lens.model, 0, static_cast<int>(lens.params.size()), std::nullopt});
  }
  std::vector<FittedLens> fitted;  // The largest first.
  std::string reason;
  double dof = std::numeric_limits<double>::infinity();
  BundleOptions given = options;
  for (size_t i = lenses.size(); i-- > 0;) {
    Problem with_lens = problem;
    HandEye from = start;
    if (problem.camera.model != lenses[i].model) with_lens.camera = lenses[i];
    if (fitted.empty()) {
      const Outcome<Solution> own = RefineHandEye(with_lens, from, options);
      if (!own) {
        choice.alternatives[i].reason = reason = own.reason();
        continue;
      }
      dof = own->covariance_dof;
      given = WithNoiseOf(*own, options);
      from = own->hand_eye;
      with_lens.camera = own->camera;
      with_lens.shape = own->shape;
    }
    const Outcome<Solution> solution = RefineHandEye(with_lens, from, given);
    if (solution) {
      fitted.push_back({*solution, CaptureCosts(problem, *solution, given), i});
    } else {
      choice.alternatives[i].reason = solution.reason();
    }
  }
  if (fitted.empty()) return Failure{reason};
  const auto sum = [](const std::vector<double>& costs) { return std::accumulate(costs.begin(), costs.end(), 0.0); };
  const FittedLens* chosen = nullptr;
  for (size_t k = fitted.size(); k-- > 0;) {
    CameraAlternative& alternative = choice.alternatives[fitted[k].alternative];
    alternative.log_likelihood = sum(fitted.front().costs) - sum(fitted[k].costs);
    bool is_rejected = false;
    for (size_t larger = 0; larger < k; ++larger) {
      std::vector<double> gains;
      for (size_t g = 0; g < fitted[k].costs.size(); ++g) {
        gains.push_back(fitted[k].costs[g] - fitted[larger].costs[g]);
      }
      const LensComparison comparison =
          CompareLenses(gains, NumMoreParams(fitted[k].solution.camera, fitted[larger].solution.camera), dof);
      alternative.p = std::min(alternative.p.value_or(1), comparison.p);
      is_rejected = is_rejected || comparison.RejectsSmaller();
    }
    if (k > 0) alternative.reason = WhyNotBesideLarger(fitted[k].solution.camera);
    if (chosen == nullptr && !is_rejected && alternative.reason.empty()) chosen = &fitted[k];
  }
  choice.problem = problem;
  choice.problem.camera = chosen->solution.camera;
  choice.problem.shape = chosen->solution.shape;
  choice.start = chosen->solution.hand_eye;
  return choice;
}

// The error models that were fitted, and the one that was chosen.
struct ErrorModelChoice {
  std::vector<FittedModel> fitted;
  std::vector<ModelAlternative> alternatives;
  size_t chosen = 0;
};

// Chooses among the error models with one lens. Returns nothing if none can be fitted.
std::optional<ErrorModelChoice> ChooseErrorModel(const Problem& problem, const HandEye& start,
                                                 const std::vector<ErrorModel>& candidates,
                                                 const BundleOptions& options) {
  ErrorModelChoice choice;
  for (const ErrorModel& model : candidates) {
    std::optional<FittedModel> fit = FitModel(problem, start, model, options, choice.fitted);
    if (fit && std::isfinite(fit->log_likelihood)) choice.fitted.push_back(std::move(*fit));
  }
  const FittedModel* best = nullptr;
  for (const FittedModel& smaller : choice.fitted) {
    ModelAlternative alternative{smaller.model, smaller.log_likelihood, smaller.solution.robot_noise,
                                 DofOf(smaller.model), std::nullopt};
    // The largest of the models that contain `smaller`.
    const FittedModel* largest = nullptr;
    for (const FittedModel& other : choice.fitted) {
      if (&other == &smaller || !Contains(other.model, smaller.model)) continue;
      if (largest == nullptr || DofOf(other.model) > DofOf(largest->model)) largest = &other;
    }
    if (largest != nullptr) {
      alternative.p = ChanceAgainst(*largest, smaller);
      alternative.odds = OddsAgainst(largest->model, alternative, [&](const SharedEffects& effects) {
        return LogLikelihoodAtLeast(problem, largest->solution, largest->options, effects);
      });
    }
    choice.alternatives.push_back(alternative);
    if (largest != nullptr && !IsAcceptable(alternative, largest->model)) continue;
    const bool is_better = best == nullptr || (DofOf(smaller.model) == DofOf(best->model) &&
                                               smaller.log_likelihood > best->log_likelihood);
    if (!is_better) continue;
    best = &smaller;
    choice.chosen = choice.alternatives.size() - 1;
  }
  if (best == nullptr) return std::nullopt;
  return choice;
}

// Adds the points that were left out before a fit to those that it rejected.
void AddRejected(const Solution& before, Solution* solution) {
  for (size_t i = 0; i < solution->views.size(); ++i) {
    std::vector<int>& ids = solution->views[i].rejected_ids;
    ids.insert(ids.end(), before.views[i].rejected_ids.begin(), before.views[i].rejected_ids.end());
    std::sort(ids.begin(), ids.end());
  }
}

}  // namespace

bool IsAcceptable(const ModelAlternative& smaller, const ErrorModel& largest) {
  return IsLikelyEnough(smaller, largest) && (!smaller.odds || *smaller.odds >= kLeastOdds);
}

std::optional<double> OddsAgainst(
    const ErrorModel& largest, const ModelAlternative& smaller,
    const std::function<std::optional<double>(const SharedEffects& smaller)>& log_likelihood_at_least) {
  if (smaller.model.effects == nullptr || !IsLikelyEnough(smaller, largest)) return std::nullopt;
  const std::optional<double> at_least = log_likelihood_at_least(*smaller.model.effects);
  return at_least ? std::optional<double>(std::exp(smaller.log_likelihood - *at_least)) : std::nullopt;
}

int NumVariances(const ErrorModel& model) {
  const int num_of_noise = model.robot == Robot::kEstimatedNoise ? 2 : 0;
  if (model.effects == nullptr) return num_of_noise;
  return num_of_noise + static_cast<int>(model.effects->groups.size()) + model.effects->num_fitted;
}

double ChanceOfRatio(double smaller_log_likelihood, double larger_log_likelihood, const ModelDifference& difference,
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

int DofOf(const ErrorModel& model) { return NumVariances(model) + NumShapeParams(model); }

std::vector<std::vector<TargetShapeGroup>> TargetShapeCombinations() {
  std::vector<std::vector<TargetShapeGroup>> combinations(4);
  combinations[1].push_back(TargetShapeGroup::kScale);
  combinations[2].push_back(TargetShapeGroup::kBend);
  combinations[3].push_back(TargetShapeGroup::kScale);
  combinations[3].push_back(TargetShapeGroup::kBend);
  return combinations;
}

std::string NameOf(const ErrorModel& model) {
  const auto has = [&](TargetShapeGroup group) {
    return std::find(model.shape.begin(), model.shape.end(), group) != model.shape.end();
  };
  const bool is_scaled = has(TargetShapeGroup::kScale);
  const bool is_bent = has(TargetShapeGroup::kBend);
  const std::string target = is_scaled && is_bent ? "target scaled and bent"
                             : is_scaled          ? "target scaled"
                             : is_bent            ? "target bent"
                                                  : "target as designed";
  return (model.robot == Robot::kExact ? "exact robot" : "robot noise") +
         (model.effects == nullptr ? std::string() : " and " + model.effects->name) + ", " + target;
}

std::vector<std::optional<EffectsFit>> FitEffects(
    const Problem& problem_in, const Solution& start, const BundleOptions& options_in,
    const std::vector<std::vector<std::shared_ptr<const PoseEffect>>>& effects_of_captures,
    const std::vector<std::vector<Matrix6X>>& joints_of_captures) {
  CHECK(joints_of_captures.empty() || joints_of_captures.size() == effects_of_captures.size());
  BundleOptions options = options_in;
  options.robot = Robot::kEstimatedNoise;
  options.loss = InlierLoss(options_in).kind;
  options.effects_avoid_zero = false;
  Problem problem = WithFixedWeights(WithoutRejected(problem_in, start), start.unmodelled_sigma_px);
  problem.camera = start.camera;
  problem.shape = start.shape;
  std::vector<std::optional<EffectsFit>> fits;
  for (size_t k = 0; k < effects_of_captures.size(); ++k) {
    for (View& view : problem.views) {
      view.effect = effects_of_captures[k][view.capture];
      if (!joints_of_captures.empty()) view.gripper_by_joints = joints_of_captures[k][view.capture];
    }
    const Outcome<Solution> solution = RefineHandEye(problem, start.hand_eye, options);
    std::optional<EffectsFit>& fit = fits.emplace_back();
    if (!solution) continue;
    const double log_likelihood = LogLikelihoodOf(problem, *solution, options);
    if (std::isfinite(log_likelihood)) fit = EffectsFit{log_likelihood, solution->robot_noise.value_or(RobotNoise{})};
  }
  return fits;
}

std::optional<size_t> MostLikelyEffects(
    const Problem& problem, const Solution& start, const BundleOptions& options,
    const std::vector<std::vector<std::shared_ptr<const PoseEffect>>>& effects_of_captures,
    const std::vector<std::vector<Matrix6X>>& joints_of_captures) {
  const std::vector<std::optional<EffectsFit>> fits =
      FitEffects(problem, start, options, effects_of_captures, joints_of_captures);
  std::optional<size_t> best;
  for (size_t k = 0; k < fits.size(); ++k) {
    if (fits[k] && (!best || fits[k]->log_likelihood > fits[*best]->log_likelihood)) best = k;
  }
  return best;
}

std::optional<FoundSmoothErrors> MostLikelySmoothErrors(const Problem& problem, const Solution& solution,
                                                        const BundleOptions& options) {
  Problem inliers = WithoutRejected(problem, solution);
  inliers.camera = solution.camera;
  std::vector<SmoothErrorsOfArm> found =
      FindSmoothErrorsOfArms(HandEyeProblem(inliers, options), ProblemSolution(solution));
  if (found.empty()) return std::nullopt;
  return std::move(found.front().found);
}

Outcome<ModelChoice> ChooseModel(const Problem& problem_in, const HandEye& start_in, const BundleOptions& options_in,
                                 const AutoModel& choose) {
  BundleOptions options = options_in;
  const size_t num_poses = GroupByRobotPose(problem_in.setup, problem_in.views).size();
  const bool has_few_poses = num_poses < kMinPosesForVariances;
  if (choose.robot_noise && has_few_poses) options.robot_noise_prior = IndustrialArmPrior();
  const std::vector<ErrorModel> candidates = Candidates(options, choose, has_few_poses);
  const bool chooses_lens = choose.lenses.size() > 1;

  // The largest model that can be fitted determines the inliers and their weights: points that a smaller model cannot
  // explain must remain, so that it can be judged by them.
  std::vector<Problem> with_lenses = {problem_in};
  for (auto lens = choose.lenses.rbegin(); chooses_lens && lens != choose.lenses.rend(); ++lens) {
    if (lens->model == problem_in.camera.model) continue;
    with_lenses.push_back(problem_in);
    with_lenses.back().camera = *lens;
  }
  std::optional<Solution> largest;
  const ErrorModel* largest_model = nullptr;
  std::string reason;
  for (const Problem& with_lens : with_lenses) {
    for (auto model = candidates.rbegin(); !largest && model != candidates.rend(); ++model) {
      const BundleOptions of_model = OptionsOf(*model, options);
      const Outcome<Solution> solution = RefineHandEye(with_lens, start_in, of_model);
      if (!solution) {
        if (reason.empty()) reason = solution.reason();
        continue;
      }
      if (candidates.size() == 1 && !chooses_lens) return ModelChoice{of_model, *solution, {}, 0};
      largest = *solution;
      largest_model = &*model;
    }
  }
  if (!largest) return Failure{reason};
  Problem problem = WithFixedWeights(WithoutRejected(problem_in, *largest), largest->unmodelled_sigma_px);
  problem.camera = largest->camera;
  HandEye start = start_in;
  options.loss = InlierLoss(options_in).kind;
  options.effects_avoid_zero = false;  // The models with variances of zero are part of the comparison.

  ModelChoice choice;
  std::optional<ErrorModelChoice> errors;
  std::string lens;
  constexpr int kMostRounds = 3;
  for (int round = 0; round < kMostRounds; ++round) {
    const ErrorModel& model = errors ? errors->fitted[errors->chosen].model : *largest_model;
    if (chooses_lens) {
      Outcome<LensChoice> of_lens = ChooseLens(problem, start, choose.lenses, OptionsOf(model, options));
      if (!of_lens && !errors) return Failure{of_lens.reason()};
      if (!of_lens || of_lens->problem.camera.model == lens) break;
      problem.camera = std::move(of_lens->problem.camera);
      start = of_lens->start;
      lens = problem.camera.model;
      choice.lenses = std::move(of_lens->alternatives);
    }
    std::optional<ErrorModelChoice> next = ChooseErrorModel(problem, start, candidates, options);
    if (!next && !errors) return Failure{"no model of the errors could be fitted"};
    if (!next) break;
    errors = std::move(next);
    if (!chooses_lens) break;
  }
  const FittedModel& best = errors->fitted[errors->chosen];
  choice.alternatives = std::move(errors->alternatives);
  choice.chosen = errors->chosen;
  choice.options = best.options;
  choice.options.loss = options_in.loss;
  choice.options.effects_avoid_zero = options_in.effects_avoid_zero;
  choice.solution = best.solution;
  choice.solution.unmodelled_sigma_px = largest->unmodelled_sigma_px;
  AddRejected(*largest, &choice.solution);
  return choice;
}

}  // namespace heba
