// Chooses which sources of error to model besides the pixel noise: random and systematic errors of the robot, and a
// target that differs from its design.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "heba/pair_calibration_types.h"
#include "solvers/calibration/choice_levels.h"
#include "solvers/calibration/problem_model.h"

namespace heba {

// The numbers of parameters by which two nested models differ.
struct ModelDifference {
  int num_shape = 0;      // Parameters of the target's shape.
  int num_variances = 0;  // Variances, and figures of a model of effects that were fitted.
};
// Returns the probability of a likelihood ratio at least as large if the smaller of two nested models is right.
// `covariance_dof` is PairSolution::covariance_dof of the larger one.
double PValueOfRatio(double smaller_log_likelihood, double larger_log_likelihood, const ModelDifference& difference,
                     double covariance_dof);

// Returns whether a model can be taken beside `largest`, the largest of the models that contain it.
bool IsAcceptable(const ModelAlternative& smaller, const ErrorModel& largest);

// Returns ModelAlternative::odds; nothing if p rejects the model already, so that they decide nothing.
// `log_likelihood_at_least` is LogLikelihoodAtLeast, or ChainLogLikelihoodAtLeast, at the solution of `largest`.
std::optional<double> OddsAgainst(
    const ErrorModel& largest, const ModelAlternative& smaller,
    const std::function<std::optional<double>(const SharedEffects& smaller)>& log_likelihood_at_least);

// One of the models that were compared; see ModelAlternative.
struct ProblemAlternative {
  ProblemModel model;
  double log_likelihood = 0;
  std::vector<std::optional<RobotNoise>> robot_noise;  // One per arm.
  std::optional<double> p;
  std::optional<double> odds;
};

// Returns an alternative as one of an arm and the first target. `effects` are those that the model has if none of the
// arm were chosen from; they may be null.
ModelAlternative AlternativeOf(const ProblemAlternative& one, size_t robot,
                               const std::shared_ptr<const SharedEffects>& effects);

struct ProblemChoice {
  Problem problem;            // The given problem with the chosen model and lenses.
  AdjustmentOptions options;  // The given options with the chosen noise of the arms.
  ProblemModel model;
  Solution solution;                             // The solution of the chosen model.
  std::vector<ProblemAlternative> alternatives;  // The simplest first; empty if there was only one.
  size_t chosen = 0;                             // Index of the chosen alternative.
  // One list per camera: the camera models that were compared; empty if none were.
  std::vector<std::vector<CameraAlternative>> lenses;
};

// Fits the combinations of {exact arms, noise of the arms}, the errors of each arm, {as designed, scale, bend, scale
// and bend} and {flat, twisted} of each target that are to be chosen from and that the captures determine. Chooses the
// one with the fewest parameters that is acceptable (IsAcceptable); among equally many parameters, the most likely.
// Beside the largest model, those with more parameters than the chosen one are not fitted. If there are many
// combinations (kMostCombinations), the parts are chosen one after the other, as many at a time as have fewer, each
// beside the largest model of those that come after it.
//
// The lenses are chosen with them: under the largest error model that can be fitted, all lenses of a camera are fitted
// with the noise of the largest one, and the smallest that no larger one rejects (LensComparison) is taken; a lens that
// cannot be fitted, because the captures do not determine it, has lost. The error models are then compared with that
// lens, and the lenses once more under the error model that was chosen, until both stand.
//
// Each model is fitted to its own optimum: one that is less likely than a model that it contains is refined again from
// that model's solution. Models that differ in shapes alone are compared by an F-test (restricted likelihood ratio,
// with the degrees of freedom of the largest model). Models that differ in the arms' errors are compared by the
// mixture of chi-squares for variances at their bound (Self and Liang 1987; its upper bound is used). All models use
// the same points with the same weights; with the loss `truncated`, the inliers of the largest model.
//
// If exact arms are among the models and there are fewer poses of the arms than kMinPosesForVariances, every model has
// noise of the arms, with IndustrialArmPrior as its prior, and none has systematic errors. If there is only one model,
// it is fitted as RefineProblem does, and `alternatives` is empty. Returns a Failure if no model could be fitted.
//
// `at_largest` may be a solution of the problem as it is; if that has the largest model, it is not fitted again.
Outcome<ProblemChoice> ChooseModel(const Problem& problem, const CellPoses& start, const AdjustmentOptions& options,
                                   const ModelSpace& space, const Solution* at_largest = nullptr);

struct ModelChoice {
  BundleOptions options;                       // The given options with the chosen model.
  PairSolution solution;                       // The solution of the chosen model.
  std::vector<ModelAlternative> alternatives;  // The simplest first.
  size_t chosen = 0;                           // Index of the chosen alternative.
  std::vector<CameraAlternative> lenses = {};  // The camera models that were compared; empty if none were.
};
// Likewise for one camera, one target and one arm.
Outcome<ModelChoice> ChooseModel(const PairProblem& problem, const HandEye& start, const BundleOptions& options,
                                 const AutoModel& choose);

// How well one of several possible effects of the captures explains them.
struct EffectsFit {
  double log_likelihood = 0;  // LogLikelihoodOf, up to a constant common to all that were fitted to one problem.
  RobotNoise robot_noise;     // The noise of the poses that remains.
};

// Fits the problem once with each of several possible effects of the captures (View::effect, by the index
// View::capture), such as those of the configurations of an arm, with the effects of `options` free. `start` is a
// solution of the problem without effects. All fits use the same points with the same weights. Returns one entry per
// element of `effects_of_captures`; nothing for those that cannot be fitted.
// `joints_of_captures`, if it is given, holds View::gripper_by_joints in the same order: the noise of the joints is
// then part of each model.
std::vector<std::optional<EffectsFit>> FitEffects(
    const PairProblem& problem, const PairSolution& start, const BundleOptions& options,
    const std::vector<std::vector<std::shared_ptr<const PoseEffect>>>& effects_of_captures,
    const std::vector<std::vector<Matrix6X>>& joints_of_captures = {});

}  // namespace heba
