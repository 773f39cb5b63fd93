// Which sources of error the measurements show beside the pixels' noise: the robot's, and a target that differs from
// its design.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "solvers/refine/bundle_adjustment.h"

namespace heba {

// Fewer poses of the robot do not carry two variances: a prior of industrial arms is then part of the model.
inline constexpr size_t kMinPosesForVariances = 8;

// A model is rejected if data as far from it would be seen less often than this.
inline constexpr double kModelRejected = 0.01;

struct ErrorModel {
  BundleOptions::Robot robot = BundleOptions::Robot::kExact;
  std::vector<TargetShapeGroup> shape;  // In the order of TargetShapeGroup.
};

// The parts of the target's shape that can be unknown: nothing, the scale, the bend, both. In this order.
std::vector<std::vector<TargetShapeGroup>> TargetShapeCombinations();

// "exact robot, target as designed", "robot noise, target scaled and bent"
std::string NameOf(const ErrorModel& model);

struct ModelAlternative {
  ErrorModel model;
  double log_likelihood = 0;  // LogLikelihoodOf at the model's own optimum; all alternatives share its constant.
  int dof = 0;                // How many variances and shape parameters the model has.
  // The chance of a likelihood ratio as large against the largest model, if this model is right. Nothing for the
  // largest.
  std::optional<double> p;
};

// The parts of the model that are to be chosen; the others are as the options say.
struct AutoModel {
  bool robot_noise = false;
  bool target_shape = false;
};

struct ModelChoice {
  BundleOptions options;                       // The given ones with the chosen model in them.
  Solution solution;                           // The chosen model's.
  std::vector<ModelAlternative> alternatives;  // The simplest first.
  size_t chosen = 0;                           // The index of the chosen alternative.
};

// Fits every combination of {exact robot, robot noise} and {as designed, scale, bend, scale and bend} that is to be
// chosen from and that the captures determine, and takes the one with the fewest parameters that is not rejected; of
// equally many, the most likely. Each is fitted at its own optimum: a model that comes out less likely than one that it
// contains starts again from that one. Models that differ in the shape alone are compared by F (restricted likelihood
// ratio, with the largest model's degrees of freedom), those that differ in the robot's noise by the mixture of
// chi-squares of variances at their bound (Self and Liang 1987; its upper bound is used). The same points count, with
// the same weights, in all models: with the loss `truncated` those that the largest model does not leave out. With
// fewer poses than kMinPosesForVariances the robot is noisy in every model, with IndustrialArmPrior as its prior. Where
// there is one model only, it is fitted as RefineHandEye does, and there are no alternatives. A Failure if no model
// could be fitted.
Outcome<ModelChoice> ChooseModel(const Problem& problem, const HandEye& start, const BundleOptions& options,
                                 const AutoModel& choose);

}  // namespace heba
