// The model of a problem: the noise of its arms, their errors, and the shapes of its targets; and the models among
// which is chosen.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "heba/data/problem.h"
#include "heba/data/solution.h"
#include "heba/pair_calibration_types.h"
#include "heba/refinement.h"
#include "heba/robot_errors.h"

namespace heba {

// Fewer robot poses do not determine two variances: a prior for industrial arms is then part of the model.
inline constexpr size_t kMinPosesForVariances = 8;

// Returns ModelAlternative::dof of a model.
int DofOf(const ErrorModel& model);
// Returns the number of variances of a model, and of the figures of its effects that were fitted.
int NumVariances(const ErrorModel& model);

// Returns the combinations of shape parameters that can be unknown: none, the scale, the bend, both, in this order. The
// twist is chosen apart from them (ModelSpace::twists).
std::vector<std::vector<TargetShapeGroup>> TargetShapeCombinations();
// Returns the unknown groups of a shape, ordered as TargetShapeGroup, with one group among them or not.
std::vector<TargetShapeGroup> WithGroup(std::vector<TargetShapeGroup> shape, TargetShapeGroup group, bool is_free);

// Returns a target with these unknown parts of its shape; the others are as designed.
ProblemTarget WithShape(ProblemTarget target, const std::vector<TargetShapeGroup>& free_shape);

// The parts of a problem that are to be chosen; the others are as the problem has them.
struct ModelSpace {
  bool robot_noise = false;  // Whether the arms may be exact; otherwise they are as the options of the adjustment say.
  std::vector<bool> shapes;  // One per target: whether the unknown parts of its shape but the twist are chosen.
  std::vector<bool> twists;  // One per target: whether its twist is chosen.
  // One per arm: the errors among which is chosen, none first, with their effects on the captures, of which there is
  // one choice (ArmErrorModels::effects_of_captures). An arm without models keeps the effects of the problem.
  std::vector<ArmErrorModels> arms;
  // One per camera: the cameras among which is chosen, of which each is an initial guess with another model, the
  // smallest first. With fewer than two the model of the problem's camera holds.
  std::vector<std::vector<Camera>> lenses;
};

// The chosen parts: the error model of a problem.
struct ProblemModel {
  BundleOptions::Robot robot = BundleOptions::Robot::kExact;  // All arms have the same.
  std::vector<std::vector<TargetShapeGroup>> shapes;          // One per target.
  // One per arm; null if its errors are not modelled, or not chosen.
  std::vector<std::shared_ptr<const SharedEffects>> effects;
};
// Returns the error model of one arm and one target.
ErrorModel ModelOf(const ProblemModel& model, size_t robot, size_t target);
// Returns whether a problem that is adjusted with these options has a model.
bool HasModel(const Problem& problem, const AdjustmentOptions& options, const ProblemModel& model);
// Returns the problem with the cameras, the unknown parts of the shapes, and the sigmas of the arms' effects if there
// are as many of them, of a solution as initial guesses.
Problem StartingFrom(Problem problem, const Solution& solution);
// Returns effects with sigmas that were found, one per group, as initial guesses, but none at zero.
std::shared_ptr<const SharedEffects> StartingFrom(const SharedEffects& effects, const std::vector<double>& sigmas);
// Returns options with the noise that was found as the initial guess, none of it at zero, where a variance may stay.
AdjustmentOptions StartingFromNoise(AdjustmentOptions options, const std::vector<double>& pixel_sigmas_px,
                                    const std::optional<RobotNoise>& robot_noise);
// Returns options with the noise of a solution as the initial guess; that of the arms is the largest of all, by its
// parts.
AdjustmentOptions StartingFromNoise(AdjustmentOptions options, const Solution& solution);
// Returns a problem with the errors of an arm; `model` is null for none. `effects` has one entry per capture, a
// function of all effects of the arm, null if the capture has none.
Problem WithEffects(Problem problem, size_t robot, const std::shared_ptr<const SharedEffects>& model,
                    const std::vector<std::shared_ptr<const PoseEffect>>& effects);
// Returns the problem with a model, whose chosen parts are those of `space`.
Problem WithModel(Problem problem, const ProblemModel& model, const ModelSpace& space);

// Returns the number of parameters of all shapes, and that of all variances, as of one arm and one target.
int NumShapeParams(const ProblemModel& model);
int NumVariances(const ProblemModel& model);
int DofOf(const ProblemModel& model);
// Returns whether all parts of `smaller` are among those of `larger`.
bool Contains(const ProblemModel& larger, const ProblemModel& smaller);

// One part of a model that is chosen: what it may be, as functions that return a model with it. The simplest comes
// first.
using PartOptions = std::vector<std::function<ProblemModel(ProblemModel)>>;
// Returns the parts that are chosen. With few poses of the arms (kMinPosesForVariances) these are noisy and have no
// systematic errors.
std::vector<PartOptions> PartsOf(const Problem& problem, const ModelSpace& space, const AdjustmentOptions& options,
                                 bool has_few_poses);
// Returns the model of a problem, with the largest of each part that is chosen.
ProblemModel LargestModel(const Problem& problem, const std::vector<PartOptions>& parts, BundleOptions::Robot robot);
// Returns the combinations of parts, with the others as in `model`, the simplest first.
std::vector<ProblemModel> CombinationsOf(const std::vector<PartOptions>& parts, const ProblemModel& model);

// The most combinations of the parts of a model that are fitted to be compared.
inline constexpr size_t kMostCombinations = 16;

// Returns the parts in groups that are chosen together, each with no more combinations than that.
std::vector<std::vector<PartOptions>> GroupParts(std::vector<PartOptions> parts);

}  // namespace heba
