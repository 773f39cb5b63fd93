#include "solvers/calibration/problem_model.h"

#include <algorithm>
#include <iterator>
#include <string>
#include <string_view>
#include <utility>

#include "heba/base/error.h"
#include "heba/data/free_parameters.h"

namespace heba {
namespace {

using Robot = BundleOptions::Robot;
using Shape = std::vector<TargetShapeGroup>;
using Effects = std::shared_ptr<const SharedEffects>;

int NumVariances(Robot robot, const std::vector<Effects>& effects) {
  int num = robot == Robot::kEstimatedNoise ? 2 : 0;
  for (const Effects& of_arm : effects) {
    if (of_arm != nullptr) num += static_cast<int>(of_arm->groups.size()) + of_arm->num_fitted;
  }
  return num;
}

// Returns whether all of `smaller` are among `larger`; null stands for no effects.
bool Contains(const SharedEffects* larger, const SharedEffects* smaller) {
  if (smaller == nullptr) return true;
  return larger != nullptr && larger->num_all == smaller->num_all &&
         std::all_of(smaller->effects.begin(), smaller->effects.end(), [&](const SharedEffect& effect) {
           return std::any_of(larger->effects.begin(), larger->effects.end(),
                              [&](const SharedEffect& other) { return other.index == effect.index; });
         });
}

int NumParamsOf(const Shape& shape) {
  int num = 0;
  for (const TargetShapeGroup group : shape) num += NumParamsOf(group);
  return num;
}

}  // namespace

int NumVariances(const ErrorModel& model) { return NumVariances(model.robot, {model.effects}); }

int DofOf(const ErrorModel& model) { return NumVariances(model) + NumParamsOf(model.shape); }

std::vector<std::vector<TargetShapeGroup>> TargetShapeCombinations() {
  std::vector<std::vector<TargetShapeGroup>> combinations(4);
  combinations[1].push_back(TargetShapeGroup::kScale);
  combinations[2].push_back(TargetShapeGroup::kBend);
  combinations[3].push_back(TargetShapeGroup::kScale);
  combinations[3].push_back(TargetShapeGroup::kBend);
  return combinations;
}

std::vector<TargetShapeGroup> WithGroup(std::vector<TargetShapeGroup> shape, TargetShapeGroup group, bool is_free) {
  const auto place = std::lower_bound(shape.begin(), shape.end(), group);
  const bool was_free = place != shape.end() && *place == group;
  if (is_free && !was_free) shape.insert(place, group);
  if (!is_free && was_free) shape.erase(place);
  return shape;
}

ProblemTarget WithShape(ProblemTarget target, const std::vector<TargetShapeGroup>& free_shape) {
  target.free_shape = free_shape;
  const auto free = FreeShapeOf(free_shape);
  for (size_t i = 0; i < free.size(); ++i) {
    if (!free[i]) target.shape.params[i] = TargetShape().params[i];
  }
  return target;
}

std::string NameOf(const ErrorModel& model) {
  constexpr std::string_view kWords[] = {"scaled", "bent", "twisted", "warped", "with free points"};
  static_assert(std::size(kWords) == kTargetShapeGroupNames.size());
  std::string target = "target ";
  for (size_t i = 0; i < model.shape.size(); ++i) {
    target += (i == 0 ? "" : i + 1 < model.shape.size() ? ", " : " and ");
    target += kWords[static_cast<size_t>(model.shape[i])];
  }
  if (model.shape.empty()) target += "as designed";
  return (model.robot == Robot::kExact ? "exact robot" : "robot noise") +
         (model.effects == nullptr ? std::string() : " and " + model.effects->name) + ", " + target;
}

int NumShapeParams(const ProblemModel& model) {
  int num = 0;
  for (const Shape& shape : model.shapes) num += NumParamsOf(shape);
  return num;
}

int NumVariances(const ProblemModel& model) { return NumVariances(model.robot, model.effects); }

int DofOf(const ProblemModel& model) { return NumVariances(model) + NumShapeParams(model); }

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

// Returns the parts that are chosen. Systematic errors are modelled beside the random ones, never instead of them, so
// that the noise of the arms and the errors of one of them are one part if both are chosen.
std::vector<PartOptions> PartsOf(const Problem& problem, const ModelSpace& space, const AdjustmentOptions& options,
                                 bool has_few_poses) {
  std::vector<PartOptions> parts;
  const bool may_be_exact = space.robot_noise && !has_few_poses;
  bool has_noise_part = false;
  for (size_t r = 0; r < space.arms.size() && !has_few_poses; ++r) {
    if (space.arms[r].models.empty()) continue;
    PartOptions part;
    if (may_be_exact && !has_noise_part) {
      part.emplace_back([r](ProblemModel model) {
        model.robot = Robot::kExact;
        model.effects[r] = nullptr;
        return model;
      });
    }
    has_noise_part = true;
    std::vector<Effects> models = {nullptr};
    models.insert(models.end(), space.arms[r].models.begin(), space.arms[r].models.end());
    for (const Effects& effects : models) {
      const Robot robot = space.robot_noise ? Robot::kEstimatedNoise : options.robot;
      if (effects != nullptr && robot == Robot::kExact) continue;
      part.emplace_back([r, robot, effects](ProblemModel model) {
        model.robot = robot;
        model.effects[r] = effects;
        return model;
      });
    }
    parts.push_back(std::move(part));
  }
  if (may_be_exact && !has_noise_part) {
    PartOptions& part = parts.emplace_back();
    for (const Robot robot : {Robot::kExact, Robot::kEstimatedNoise}) {
      part.emplace_back([robot](ProblemModel model) {
        model.robot = robot;
        return model;
      });
    }
  }
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    if (t >= space.shapes.size() || !space.shapes[t]) continue;
    PartOptions& part = parts.emplace_back();
    for (const Shape& shape : TargetShapeCombinations()) {
      part.emplace_back([t, shape](ProblemModel model) {
        model.shapes[t] = shape;
        return model;
      });
    }
  }
  for (size_t t = 0; t < space.twists.size(); ++t) {
    if (!space.twists[t]) continue;
    PartOptions& twist = parts.emplace_back();
    for (const bool is_free : {false, true}) {
      twist.emplace_back([t, is_free](ProblemModel model) {
        model.shapes[t] = WithGroup(std::move(model.shapes[t]), TargetShapeGroup::kTwist, is_free);
        return model;
      });
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
      for (const auto& with : part) more.push_back(with(one));
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
ProblemModel LargestModel(const Problem& problem, const std::vector<PartOptions>& parts, Robot robot) {
  ProblemModel model;
  model.robot = robot;
  for (const ProblemTarget& target : problem.targets) model.shapes.push_back(target.free_shape);
  model.effects.resize(problem.robots.size());
  for (const PartOptions& part : parts) model = part.back()(std::move(model));
  return model;
}

bool HasModel(const Problem& problem, const AdjustmentOptions& options, const ProblemModel& model) {
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    if (problem.targets[t].free_shape != model.shapes[t]) return false;
  }
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    if (EffectsOf(problem, r) != model.effects[r].get()) return false;
  }
  return options.robot == model.robot;
}

Problem StartingFrom(Problem problem, const Solution& solution) {
  for (size_t c = 0; c < problem.cameras.size(); ++c) problem.cameras[c].camera = solution.cameras[c];
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    ProblemTarget& target = problem.targets[t];
    const auto free = FreeShapeOf(target.free_shape);
    for (size_t i = 0; i < free.size(); ++i) {
      if (free[i]) target.shape.params[i] = solution.shapes[t].params[i];
    }
  }
  for (size_t r = 0; r < problem.effects.size(); ++r) {
    const bool has_same = problem.effects[r] != nullptr && !solution.effects.empty() &&
                          solution.effects[r].size() == problem.effects[r]->size() &&
                          solution.effect_sigmas[r].size() == problem.effects[r]->groups.size();
    if (has_same) problem.effects[r] = StartingFrom(*problem.effects[r], solution.effect_sigmas[r]);
  }
  return problem;
}

Effects StartingFrom(const SharedEffects& effects, const std::vector<double>& sigmas) {
  CHECK_EQ(sigmas.size(), effects.groups.size());
  auto starting = std::make_shared<SharedEffects>(effects);
  for (size_t g = 0; g < sigmas.size(); ++g) {
    // A variance of zero may stay there.
    constexpr double kLeastShare = 0.01;
    double& sigma = starting->groups[g].sigma;
    sigma = std::max(kLeastShare * sigma, sigmas[g]);
  }
  return starting;
}

AdjustmentOptions StartingFromNoise(AdjustmentOptions options, const std::vector<double>& pixel_sigmas_px,
                                    const std::optional<RobotNoise>& robot_noise) {
  options.pixel_noise_start_px = pixel_sigmas_px;
  if (!robot_noise) return options;
  constexpr double kLeast = 1e-5;  // m, rad
  const auto above_zero = [&](double sigma) { return std::max(kLeast, sigma); };
  options.robot_noise_start = {above_zero(robot_noise->translation_m), above_zero(robot_noise->rotation_rad),
                               above_zero(robot_noise->joint_rad)};
  return options;
}

AdjustmentOptions StartingFromNoise(AdjustmentOptions options, const Solution& solution) {
  std::optional<RobotNoise> largest;
  for (const std::optional<RobotNoise>& noise : solution.robot_noise) {
    if (!noise) continue;
    if (!largest) largest = RobotNoise();
    largest->translation_m = std::max(largest->translation_m, noise->translation_m);
    largest->rotation_rad = std::max(largest->rotation_rad, noise->rotation_rad);
    largest->joint_rad = std::max(largest->joint_rad, noise->joint_rad);
  }
  return StartingFromNoise(std::move(options), solution.pixel_sigmas_px, largest);
}

ErrorModel ModelOf(const ProblemModel& model, size_t robot, size_t target) {
  return {model.robot, model.shapes[target], model.effects[robot]};
}

Problem WithEffects(Problem problem, size_t robot, const Effects& model,
                    const std::vector<std::shared_ptr<const PoseEffect>>& effects) {
  std::vector<int> estimated;
  for (size_t k = 0; model != nullptr && k < model->effects.size(); ++k) {
    estimated.push_back(model->effects[k].index);
  }
  problem.effects.resize(problem.robots.size());
  problem.effects[robot] = model;
  for (size_t i = 0; i < problem.captures.size(); ++i) {
    std::vector<std::shared_ptr<const PoseEffect>>& of_capture = problem.captures[i].effects;
    of_capture.resize(problem.robots.size());
    const bool has_effect = model != nullptr && effects[i] != nullptr;
    of_capture[robot] = has_effect ? SelectEffects(effects[i], model->num_all, estimated) : nullptr;
  }
  return problem;
}

Problem WithModel(Problem problem, const ProblemModel& model, const ModelSpace& space) {
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    problem.targets[t] = WithShape(std::move(problem.targets[t]), model.shapes[t]);
  }
  for (size_t r = 0; r < space.arms.size(); ++r) {
    if (space.arms[r].models.empty()) continue;
    problem = WithEffects(std::move(problem), r, model.effects[r], space.arms[r].effects_of_captures.front());
  }
  return problem;
}

}  // namespace heba
