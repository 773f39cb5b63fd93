#include "solvers/calibration/model_choice.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <utility>

#include "heba/base/distributions.h"
#include "heba/base/error.h"
#include "heba/data/free_parameters.h"
#include "solvers/calibration/camera_choice.h"
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
using Shape = std::vector<TargetShapeGroup>;
using Effects = std::shared_ptr<const SharedEffects>;

struct FittedModel {
  ProblemModel model;
  RigOptions options;
  RigSolution solution;
  double log_likelihood = 0;
};

int NumShapeParams(const ProblemModel& model) {
  int num = 0;
  for (const Shape& shape : model.shapes) num += 2 * static_cast<int>(shape.size());
  return num;
}

int NumVariances(Robot robot, const std::vector<Effects>& effects) {
  int num = robot == Robot::kEstimatedNoise ? 2 : 0;
  for (const Effects& of_arm : effects) {
    if (of_arm != nullptr) num += static_cast<int>(of_arm->groups.size()) + of_arm->num_fitted;
  }
  return num;
}

int NumVariances(const ProblemModel& model) { return NumVariances(model.robot, model.effects); }

int DofOf(const ProblemModel& model) { return NumVariances(model) + NumShapeParams(model); }

// Returns whether all of `smaller` are among `larger`; null stands for no effects.
bool Contains(const SharedEffects* larger, const SharedEffects* smaller) {
  if (smaller == nullptr) return true;
  return larger != nullptr && larger->num_all == smaller->num_all &&
         std::all_of(smaller->effects.begin(), smaller->effects.end(), [&](const SharedEffect& effect) {
           return std::any_of(larger->effects.begin(), larger->effects.end(),
                              [&](const SharedEffect& other) { return other.index == effect.index; });
         });
}

bool Contains(const ProblemModel& larger, const ProblemModel& smaller) {
  if (NumVariances(larger) < NumVariances(smaller)) return false;
  for (size_t r = 0; r < larger.effects.size(); ++r) {
    if (!Contains(larger.effects[r].get(), smaller.effects[r].get())) return false;
  }
  for (size_t t = 0; t < larger.shapes.size(); ++t) {
    const Shape& all = larger.shapes[t];
    const bool has_all = std::all_of(smaller.shapes[t].begin(), smaller.shapes[t].end(), [&](TargetShapeGroup group) {
      return std::find(all.begin(), all.end(), group) != all.end();
    });
    if (!has_all) return false;
  }
  return true;
}

// One part of a model that is chosen: what it may be, as functions that set it. The simplest comes first.
using PartOptions = std::vector<std::function<void(ProblemModel*)>>;

// Returns the parts that are chosen. Systematic errors are modelled beside the random ones, never instead of them, so
// that the noise of the arms and the errors of one of them are one part if both are chosen.
std::vector<PartOptions> PartsOf(const RigProblem& problem, const ModelSpace& space, const RigOptions& options,
                                 bool has_few_poses) {
  std::vector<PartOptions> parts;
  const bool may_be_exact = space.robot_noise && !has_few_poses;
  bool has_noise_part = false;
  for (size_t r = 0; r < space.arms.size() && !has_few_poses; ++r) {
    if (space.arms[r].models.empty()) continue;
    PartOptions part;
    if (may_be_exact && !has_noise_part) {
      part.emplace_back([r](ProblemModel* model) {
        model->robot = Robot::kExact;
        model->effects[r] = nullptr;
      });
    }
    has_noise_part = true;
    std::vector<Effects> models = {nullptr};
    models.insert(models.end(), space.arms[r].models.begin(), space.arms[r].models.end());
    for (const Effects& effects : models) {
      const Robot robot = space.robot_noise ? Robot::kEstimatedNoise : options.robot;
      if (effects != nullptr && robot == Robot::kExact) continue;
      part.emplace_back([r, robot, effects](ProblemModel* model) {
        model->robot = robot;
        model->effects[r] = effects;
      });
    }
    parts.push_back(std::move(part));
  }
  if (may_be_exact && !has_noise_part) {
    parts.push_back({[](ProblemModel* model) { model->robot = Robot::kExact; },
                     [](ProblemModel* model) { model->robot = Robot::kEstimatedNoise; }});
  }
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    if (t >= space.shapes.size() || !space.shapes[t]) continue;
    PartOptions& part = parts.emplace_back();
    for (const Shape& shape : TargetShapeCombinations()) {
      part.emplace_back([t, shape](ProblemModel* model) { model->shapes[t] = shape; });
    }
  }
  return parts;
}

// Returns the combinations of parts, with the others as in `model`, the simplest first.
std::vector<ProblemModel> CombinationsOf(const std::vector<PartOptions>& parts, const ProblemModel& model) {
  std::vector<ProblemModel> models = {model};
  for (const PartOptions& part : parts) {
    std::vector<ProblemModel> more;
    for (const ProblemModel& one : models) {
      for (const auto& set : part) set(&more.emplace_back(one));
    }
    models = std::move(more);
  }
  std::stable_sort(models.begin(), models.end(),
                   [](const ProblemModel& a, const ProblemModel& b) { return DofOf(a) < DofOf(b); });
  return models;
}

// Returns the parts in groups that are chosen together.
std::vector<std::vector<PartOptions>> GroupParts(std::vector<PartOptions> parts) {
  std::vector<std::vector<PartOptions>> groups;
  size_t num_combinations = 0;
  for (PartOptions& part : parts) {
    if (groups.empty() || num_combinations * part.size() > kMostCombinations) {
      groups.emplace_back();
      num_combinations = 1;
    }
    num_combinations *= part.size();
    groups.back().push_back(std::move(part));
  }
  return groups;
}

// Returns the model of a problem, with the largest of each part that is chosen.
ProblemModel LargestModel(const RigProblem& problem, const std::vector<PartOptions>& parts, Robot robot) {
  ProblemModel model;
  model.robot = robot;
  for (const RigTarget& target : problem.targets) model.shapes.push_back(target.free_shape);
  model.effects.resize(problem.robots.size());
  for (const PartOptions& part : parts) part.back()(&model);
  return model;
}

}  // namespace

bool HasModel(const RigProblem& problem, const RigOptions& options, const ProblemModel& model) {
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    if (problem.targets[t].free_shape != model.shapes[t]) return false;
  }
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    if (EffectsOf(problem, r) != model.effects[r].get()) return false;
  }
  return options.robot == model.robot;
}

RigProblem StartingFrom(RigProblem problem, const RigSolution& solution) {
  for (size_t c = 0; c < problem.cameras.size(); ++c) problem.cameras[c].camera = solution.cameras[c];
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    RigTarget& target = problem.targets[t];
    const auto free = FreeShapeOf(target.free_shape);
    for (size_t i = 0; i < free.size(); ++i) {
      if (free[i]) target.shape.params[i] = solution.shapes[t].params[i];
    }
  }
  return problem;
}

namespace {

// The problem in which models are compared: its points have fixed weights.
struct Comparison {
  RigProblem problem;
  RigPoses start;
  RigOptions options;
  const ModelSpace& space;
};

std::optional<FittedModel> Fit(const RigProblem& problem, const RigPoses& start, const ProblemModel& model,
                               const RigOptions& options) {
  const Outcome<RigSolution> solution = RefineRig(problem, start, options);
  if (!solution) return std::nullopt;
  return FittedModel{model, options, *solution, LogLikelihoodOf(problem, *solution, options)};
}

// Fits a model to its own optimum, which is at least as good as that of any model that it contains.
std::optional<FittedModel> FitModel(const Comparison& comparison, const ProblemModel& model,
                                    const std::vector<FittedModel>& fitted) {
  RigOptions options = comparison.options;
  options.robot = model.robot;
  const FittedModel* best_within = nullptr;
  const FittedModel* nearest = nullptr;
  for (const FittedModel& other : fitted) {
    if (!Contains(model, other.model)) continue;
    if (best_within == nullptr || other.log_likelihood > best_within->log_likelihood) best_within = &other;
    const bool has_same_shape = other.model.shapes == model.shapes;
    if (nearest == nullptr || has_same_shape) nearest = &other;
  }
  // Models of other shapes have nearly the same noise. A start at zero would stay there.
  const auto start_from_noise = [](const RigSolution& solution, RigOptions* of_fit) {
    constexpr double kLeast = 1e-5;
    for (const std::optional<RobotNoise>& noise : solution.robot_noise) {
      if (!noise) continue;
      of_fit->robot_noise_start.translation_m = std::max(kLeast, noise->translation_m);
      of_fit->robot_noise_start.rotation_rad = std::max(kLeast, noise->rotation_rad);
      return;
    }
  };
  if (nearest != nullptr && nearest->model.effects == model.effects) start_from_noise(nearest->solution, &options);
  const RigProblem with_model = WithModel(comparison.problem, model, comparison.space);
  const auto fit_from = [&](const FittedModel& from, const RigOptions& of_fit) {
    return Fit(StartingFrom(with_model, from.solution), from.solution.poses, model, of_fit);
  };
  std::optional<FittedModel> found =
      nearest != nullptr ? fit_from(*nearest, options) : Fit(with_model, comparison.start, model, options);
  constexpr double kRounding = 1e-3;
  if (best_within == nullptr || (found && found->log_likelihood >= best_within->log_likelihood - kRounding)) {
    return found;
  }
  // Starts again from the smaller model with nearly no robot noise, because that model explains the data without it.
  RigOptions again = options;
  again.robot_noise_start = {1e-6, 1e-6};
  for (const std::optional<RobotNoise>& noise : best_within->solution.robot_noise) {
    if (!noise) continue;
    again.robot_noise_start = *noise;
    break;
  }
  std::optional<FittedModel> other = fit_from(*best_within, again);
  return other && (!found || other->log_likelihood > found->log_likelihood) ? other : found;
}

double ChanceAgainst(const FittedModel& larger, const FittedModel& smaller) {
  return ChanceOfRatio(smaller.log_likelihood, larger.log_likelihood,
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

// Returns the options with all noise held at that of a solution, and the problem with that of the arms' effects.
RigOptions WithNoiseOf(const RigSolution& solution, RigOptions options, RigProblem* problem) {
  // Every camera has the noise of the first one, which differs from the others' by a constant factor.
  options.pixel_noise_px = solution.pixel_sigmas_px.front();
  for (const std::optional<RobotNoise>& noise : solution.robot_noise) {
    if (!noise) continue;
    options.robot = Robot::kGivenNoise;
    options.robot_noise = *noise;
    break;
  }
  for (size_t r = 0; r < problem->effects.size(); ++r) {
    if (problem->effects[r] == nullptr) continue;
    auto effects = std::make_shared<SharedEffects>(*problem->effects[r]);
    for (size_t g = 0; g < effects->groups.size(); ++g) effects->groups[g].sigma = solution.effect_sigmas[r][g];
    problem->effects[r] = std::move(effects);
  }
  return options;
}

// A lens that was fitted with the noise of the largest one.
struct FittedLens {
  RigSolution solution;
  std::vector<double> costs;  // GroupCosts.
  size_t alternative = 0;     // Index in LensChoice::alternatives.
};

struct LensChoice {
  RigSolution solution;  // That of the chosen lens.
  std::vector<CameraAlternative> alternatives;
};

// Chooses the smallest lens of a camera that no larger one rejects, under an error model; one without distortion only
// if no other one can be fitted. Returns a Failure if none can be fitted.
Outcome<LensChoice> ChooseLens(const Comparison& comparison, size_t camera, const ProblemModel& model) {
  const std::vector<Camera>& lenses = comparison.space.lenses[camera];
  LensChoice choice;
  for (const Camera& lens : lenses) {
    choice.alternatives.push_back({lens.model, 0, static_cast<int>(lens.params.size()), std::nullopt});
  }
  RigProblem problem = WithModel(comparison.problem, model, comparison.space);
  RigPoses from = comparison.start;
  RigOptions options = comparison.options;
  options.robot = model.robot;
  std::vector<FittedLens> fitted;  // The largest first.
  std::string reason;
  double dof = std::numeric_limits<double>::infinity();
  for (size_t i = lenses.size(); i-- > 0;) {
    RigProblem with_lens = problem;
    Camera& of_camera = with_lens.cameras[camera].camera;
    if (of_camera.model != lenses[i].model) of_camera = lenses[i];
    if (fitted.empty()) {
      const Outcome<RigSolution> own = RefineRig(with_lens, from, options);
      if (!own) {
        choice.alternatives[i].reason = reason = own.reason();
        continue;
      }
      dof = own->covariance_dof;
      options = WithNoiseOf(*own, options, &problem);
      from = own->poses;
      with_lens = StartingFrom(problem, *own);
    }
    const Outcome<RigSolution> solution = RefineRig(with_lens, from, options);
    if (solution) {
      fitted.push_back({*solution,
                        GroupCosts(problem, GroupByRobotPoses(problem), StateOf(*solution), NoiseOf(*solution),
                                   LossOf(options.loss)),
                        i});
    } else {
      choice.alternatives[i].reason = solution.reason();
    }
  }
  if (fitted.empty()) return Failure{reason};
  const auto sum = [](const std::vector<double>& costs) { return std::accumulate(costs.begin(), costs.end(), 0.0); };
  const FittedLens* chosen = nullptr;
  for (size_t k = fitted.size(); k-- > 0;) {
    CameraAlternative& alternative = choice.alternatives[fitted[k].alternative];
    const Camera& smaller_lens = fitted[k].solution.cameras[camera];
    alternative.log_likelihood = sum(fitted.front().costs) - sum(fitted[k].costs);
    bool is_rejected = false;
    for (size_t larger = 0; larger < k; ++larger) {
      std::vector<double> gains;
      for (size_t g = 0; g < fitted[k].costs.size(); ++g) {
        gains.push_back(fitted[k].costs[g] - fitted[larger].costs[g]);
      }
      const LensComparison of_two =
          CompareLenses(gains, NumMoreParams(smaller_lens, fitted[larger].solution.cameras[camera]), dof);
      alternative.p = std::min(alternative.p.value_or(1), of_two.p);
      is_rejected = is_rejected || of_two.RejectsSmaller();
    }
    if (k > 0) alternative.reason = WhyNotBesideLarger(smaller_lens);
    if (chosen == nullptr && !is_rejected && alternative.reason.empty()) chosen = &fitted[k];
  }
  choice.solution = chosen->solution;
  return choice;
}

// The error models that were fitted, and the one that was chosen.
struct ErrorModelChoice {
  std::vector<FittedModel> fitted;
  std::vector<ProblemAlternative> alternatives;
  size_t chosen = 0;
};

// Returns ModelAlternative::odds of a model beside the largest one that contains it.
std::optional<double> OddsBeside(const Comparison& comparison, const FittedModel& largest,
                                 const ProblemAlternative& smaller) {
  const std::vector<Effects>& kept = smaller.model.effects;
  const bool has_effects = std::any_of(kept.begin(), kept.end(), [](const Effects& one) { return one != nullptr; });
  if (!has_effects || !IsLikelyEnough(smaller.p, LacksSystematic(kept, largest.model.effects))) return std::nullopt;
  const std::optional<double> at_least = LogLikelihoodAtLeast(
      WithModel(comparison.problem, largest.model, comparison.space), largest.solution, largest.options, kept);
  return at_least ? std::optional<double>(std::exp(smaller.log_likelihood - *at_least)) : std::nullopt;
}

// Compares models that were fitted, the simplest first: each with the largest that contains it.
ErrorModelChoice Compare(const Comparison& comparison, std::vector<FittedModel> fitted) {
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
      alternative.p = ChanceAgainst(*largest, smaller);
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
  choice.fitted = std::move(fitted);
  return choice;
}

// Chooses among error models with the same lenses, the simplest of which comes first. Returns nothing if none can be
// fitted.
std::optional<ErrorModelChoice> ChooseErrorModel(const Comparison& comparison,
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
    if (DofOf(candidates[k]) > DofOf(choice.fitted[choice.chosen].model)) break;
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

// Adds the points that were left out before a fit to those that it rejected.
void AddRejected(const RigSolution& before, RigSolution* solution) {
  for (size_t i = 0; i < solution->captures.size(); ++i) {
    for (size_t k = 0; k < solution->captures[i].rejected_ids.size(); ++k) {
      std::vector<int>& ids = solution->captures[i].rejected_ids[k];
      const std::vector<int>& others = before.captures[i].rejected_ids[k];
      ids.insert(ids.end(), others.begin(), others.end());
      std::sort(ids.begin(), ids.end());
    }
  }
}

// Returns the problems with the lenses that are tried until one can be fitted: as given, and with the other lenses of
// each camera, the largest first.
std::vector<RigProblem> WithLenses(const RigProblem& problem, const ModelSpace& space) {
  std::vector<RigProblem> with_lenses = {problem};
  for (size_t c = 0; c < space.lenses.size(); ++c) {
    const std::vector<Camera>& lenses = space.lenses[c];
    for (auto lens = lenses.rbegin(); lenses.size() > 1 && lens != lenses.rend(); ++lens) {
      if (lens->model == problem.cameras[c].camera.model) continue;
      with_lenses.push_back(problem);
      with_lenses.back().cameras[c].camera = *lens;
    }
  }
  return with_lenses;
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

int NumVariances(const ErrorModel& model) { return NumVariances(model.robot, {model.effects}); }

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

int DofOf(const ErrorModel& model) { return NumVariances(model) + 2 * static_cast<int>(model.shape.size()); }

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
  Problem problem = WithoutRejected(problem_in, start);
  problem.camera = start.camera;
  problem.shape = start.shape;
  const RigSolution whole_start = ProblemSolution(start);
  std::vector<std::optional<EffectsFit>> fits;
  for (size_t k = 0; k < effects_of_captures.size(); ++k) {
    for (View& view : problem.views) {
      view.effect = effects_of_captures[k][view.capture];
      if (!joints_of_captures.empty()) view.gripper_by_joints = joints_of_captures[k][view.capture];
    }
    const RigProblem whole = WithFixedWeights(HandEyeProblem(problem, options), whole_start);
    const RigOptions of_whole = AdjustmentOptionsOf(options);
    const Outcome<RigSolution> solution = RefineRig(whole, whole_start.poses, of_whole);
    std::optional<EffectsFit>& fit = fits.emplace_back();
    if (!solution) continue;
    const double log_likelihood = LogLikelihoodOf(whole, *solution, of_whole);
    if (std::isfinite(log_likelihood)) {
      fit = EffectsFit{log_likelihood, solution->robot_noise.front().value_or(RobotNoise{})};
    }
  }
  return fits;
}

ErrorModel ModelOf(const ProblemModel& model, size_t robot, size_t target) {
  return {model.robot, model.shapes[target], model.effects[robot]};
}

RigProblem WithModel(RigProblem problem, const ProblemModel& model, const ModelSpace& space) {
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    RigTarget& target = problem.targets[t];
    target.free_shape = model.shapes[t];
    // What is not free is as designed.
    const auto free = FreeShapeOf(target.free_shape);
    for (size_t i = 0; i < free.size(); ++i) {
      if (!free[i]) target.shape.params[i] = TargetShape().params[i];
    }
  }
  for (size_t r = 0; r < space.arms.size(); ++r) {
    if (space.arms[r].models.empty()) continue;
    problem.effects.resize(problem.robots.size());
    problem.effects[r] = model.effects[r];
    std::vector<int> estimated;
    for (size_t k = 0; model.effects[r] != nullptr && k < model.effects[r]->effects.size(); ++k) {
      estimated.push_back(model.effects[r]->effects[k].index);
    }
    for (size_t i = 0; i < problem.captures.size(); ++i) {
      std::vector<std::shared_ptr<const PoseEffect>>& effects = problem.captures[i].effects;
      effects.resize(problem.robots.size());
      const std::shared_ptr<const PoseEffect>& all = space.arms[r].effects_of_captures.front()[i];
      effects[r] = model.effects[r] == nullptr || all == nullptr
                       ? nullptr
                       : SelectEffects(all, model.effects[r]->num_all, estimated);
    }
  }
  return problem;
}

Outcome<ProblemChoice> ChooseModel(const RigProblem& problem, const RigPoses& start, const RigOptions& options_in,
                                   const ModelSpace& space, const RigSolution* at_largest) {
  RigOptions options = options_in;
  const bool has_few_poses = GroupByRobotPoses(problem).size() < kMinPosesForVariances;
  if (space.robot_noise && has_few_poses) options.robot_noise_prior = IndustrialArmPrior();
  const std::vector<PartOptions> parts = PartsOf(problem, space, options, has_few_poses);
  const ProblemModel largest_of_all =
      LargestModel(problem, parts, space.robot_noise ? Robot::kEstimatedNoise : options.robot);
  const bool chooses_lens = std::any_of(space.lenses.begin(), space.lenses.end(),
                                        [](const std::vector<Camera>& lenses) { return lenses.size() > 1; });

  // The largest model that can be fitted determines the inliers and their weights: points that a smaller model cannot
  // explain must remain, so that it can be judged by them.
  std::vector<std::vector<PartOptions>> groups = GroupParts(parts);
  ProblemModel largest_model;
  std::optional<RigSolution> largest;
  std::string reason;
  // Parts that are chosen later are held as far as those before them do not suffice.
  std::vector<ProblemModel> to_try = {largest_of_all};
  for (size_t g = groups.size(); g-- > 0;) {
    const std::vector<ProblemModel> combinations = CombinationsOf(groups[g], to_try.back());
    for (auto one = combinations.rbegin(); one != combinations.rend(); ++one) to_try.push_back(*one);
  }
  if (!groups.empty()) to_try.erase(to_try.begin());
  if (at_largest != nullptr && !groups.empty() && HasModel(problem, options, largest_of_all)) {
    largest = *at_largest;
    largest_model = largest_of_all;
  }
  for (const RigProblem& with_lens : WithLenses(problem, space)) {
    for (size_t k = 0; !largest && k < to_try.size(); ++k) {
      RigOptions of_model = options;
      of_model.robot = to_try[k].robot;
      const Outcome<RigSolution> solution = RefineRig(WithModel(with_lens, to_try[k], space), start, of_model);
      if (!solution) {
        if (reason.empty()) reason = solution.reason();
        continue;
      }
      largest_model = to_try[k];
      if (parts.empty() && !chooses_lens) {
        return ProblemChoice{WithModel(with_lens, largest_model, space), of_model, largest_model, *solution, {}, 0, {}};
      }
      largest = *solution;
    }
  }
  if (!largest) return Failure{reason};
  Comparison comparison{WithFixedWeights(WithoutRejected(problem, *largest), *largest), largest->poses, options, space};
  for (size_t c = 0; c < problem.cameras.size(); ++c) comparison.problem.cameras[c].camera = largest->cameras[c];
  if (options.loss == LossKind::kTruncated) comparison.options.loss = LossKind::kNone;
  comparison.options.effects_avoid_zero = false;  // The models with variances of zero are part of the comparison.

  ProblemModel model = largest_model;
  ProblemChoice choice;
  choice.lenses.resize(space.lenses.size());
  std::optional<ErrorModelChoice> errors;
  constexpr int kMostRounds = 3;
  for (int round = 0; round < kMostRounds; ++round) {
    bool has_other_lens = round == 0;
    for (size_t c = 0; c < space.lenses.size(); ++c) {
      if (space.lenses[c].size() < 2) continue;
      Outcome<LensChoice> of_lens = ChooseLens(comparison, c, model);
      if (!of_lens && !errors) return Failure{of_lens.reason()};
      if (!of_lens) continue;
      const bool is_same = of_lens->solution.cameras[c].model == comparison.problem.cameras[c].camera.model;
      if (round > 0 && is_same) continue;
      has_other_lens = true;
      comparison.problem.cameras[c].camera = of_lens->solution.cameras[c];
      comparison.start = of_lens->solution.poses;
      choice.lenses[c] = std::move(of_lens->alternatives);
    }
    if (!has_other_lens) break;
    std::optional<ErrorModelChoice> next;
    ProblemModel at = largest_model;
    std::vector<ProblemAlternative> alternatives;
    size_t chosen = 0;
    for (const std::vector<PartOptions>& group : groups) {
      std::optional<ErrorModelChoice> of_group = ChooseErrorModel(comparison, CombinationsOf(group, at));
      if (!of_group) break;
      at = of_group->fitted[of_group->chosen].model;
      chosen = alternatives.size() + of_group->chosen;
      alternatives.insert(alternatives.end(), of_group->alternatives.begin(), of_group->alternatives.end());
      next = std::move(of_group);
    }
    if (groups.empty()) next = ChooseErrorModel(comparison, {largest_model});
    if (!next && !errors) return Failure{"no model of the errors could be fitted"};
    if (!next) break;
    errors = std::move(next);
    model = errors->fitted[errors->chosen].model;
    choice.alternatives = groups.empty() ? errors->alternatives : std::move(alternatives);
    choice.chosen = groups.empty() ? errors->chosen : chosen;
    if (!chooses_lens) break;
  }
  const FittedModel& best = errors->fitted[errors->chosen];
  choice.model = model;
  choice.problem = WithModel(problem, model, space);
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    if (best.solution.cameras[c].model != problem.cameras[c].camera.model) {
      choice.problem.cameras[c].camera = best.solution.cameras[c];
    }
  }
  choice.options = best.options;
  choice.options.loss = options_in.loss;
  choice.options.effects_avoid_zero = options_in.effects_avoid_zero;
  choice.solution = best.solution;
  choice.solution.unmodelled_sigma_px = largest->unmodelled_sigma_px;
  AddRejected(*largest, &choice.solution);
  return choice;
}

Outcome<ModelChoice> ChooseModel(const Problem& problem, const HandEye& start, const BundleOptions& options,
                                 const AutoModel& choose) {
  ModelSpace space;
  space.robot_noise = choose.robot_noise;
  space.shapes = {choose.target_shape};
  space.lenses = {choose.lenses};
  BundleOptions with_fixed = options;
  if (!choose.effects.empty()) {
    with_fixed.effects = nullptr;
    RigArmErrors& arm = space.arms.emplace_back();
    arm.models = choose.effects;
    std::vector<std::shared_ptr<const PoseEffect>>& effects = arm.effects_of_captures.emplace_back();
    for (const View& view : problem.views) effects.push_back(view.effect);
  }
  Outcome<ProblemChoice> chosen =
      ChooseModel(HandEyeProblem(problem, with_fixed), HandEyePosesOf(start), AdjustmentOptionsOf(with_fixed), space);
  if (!chosen) return Failure{chosen.reason()};
  const auto model_of = [&](const ProblemModel& model) {
    ErrorModel of_pair = ModelOf(model, 0, 0);
    if (choose.effects.empty()) of_pair.effects = options.effects;
    return of_pair;
  };
  ModelChoice choice;
  const ErrorModel model = model_of(chosen->model);
  choice.options = options;
  choice.options.robot = model.robot;
  choice.options.free_shape = model.shape;
  choice.options.effects = model.effects;
  choice.options.robot_noise_start = chosen->options.robot_noise_start;
  choice.options.robot_noise_prior = chosen->options.robot_noise_prior;
  choice.solution = HandEyeSolution(chosen->solution, choice.options);
  for (ProblemAlternative& one : chosen->alternatives) {
    const ErrorModel of_pair = model_of(one.model);
    choice.alternatives.push_back(
        {of_pair, one.log_likelihood, one.robot_noise.front(), DofOf(of_pair), one.p, one.odds});
  }
  choice.chosen = chosen->chosen;
  if (!chosen->lenses.empty()) choice.lenses = std::move(chosen->lenses.front());
  return choice;
}

}  // namespace heba
