// An estimate in progress: its unknowns, the noise that its residuals are whitened with, one run of Ceres with that
// noise, and the information matrix. Equations: docs/estimation.md.
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include <ceres/solver.h>

#include "heba/bundle_adjustment.h"
#include "heba/data/solution.h"
#include "solvers/refine/captures_cost.h"
#include "solvers/residuals/loss.h"
#include "solvers/uncertainty/information.h"
#include "solvers/uncertainty/linearisation.h"
#include "solvers/uncertainty/repeated_poses.h"

namespace heba {

// An estimate of all unknowns.
struct FitState {
  HandEye hand_eye;
  Camera camera;
  TargetShape shape;
  Eigen::VectorXd effects;  // The free effects; empty if there are none.
  // The correction of each view's robot pose, identical for views at one pose; empty if the robot is exact.
  std::vector<Rigid3d> corrections;
};

// The noise that residuals are whitened with.
struct FitNoise {
  double pixel_px = 0;
  std::optional<RobotNoise> robot;
  std::vector<double> effect_sigmas;  // Standard deviation of each group of effects.
};

// Problems are large: they are shared, and copied only to be modified.
using SharedProblem = std::shared_ptr<const Problem>;

// Wraps a problem that the caller owns.
inline SharedProblem Borrowed(const Problem& problem) { return {SharedProblem(), &problem}; }

// Cached normal equations of the captures, with the problem, loss and noise for which they were computed.
struct KnownProducts {
  SharedProblem problem;
  const Loss* loss;
  FitNoise noise;
  NormalEquations products;
};

// An estimate in progress.
struct Fit {
  SharedProblem problem;                     // The points in use, with their weights.
  std::shared_ptr<const PoseGroups> groups;  // The problem's views, grouped by robot pose.
  FitState state;
  FitNoise noise;
  RobotNoise robot_stddev;
  double dof = std::numeric_limits<double>::infinity();  // See Solution::covariance_dof.
  // The part of the points' sigma that is not in the detectors' covariances. It is equal for all points and estimated
  // from the residuals. Nothing: all points are weighted equally.
  std::optional<double> unmodelled_sigma_px;
  Convergence convergence;
  std::optional<KnownProducts> known;
};

// Selects how sigma is estimated: from the RMS of the fit, or from the median, which is robust to 50 % outliers. The
// median is used while inliers are searched for; that fit need not converge to the last digits.
enum class NoiseScale { kOfFit, kMedian };

// The squared whitened distances of each view's points; nothing if any of its points cannot be projected.
using ViewDistances = std::vector<std::optional<std::vector<double>>>;
ViewDistances SquaredDistances(const Problem& problem, const FreeUnknowns& free, const FitState& state,
                               int num_threads);
// Returns the distances of all points in the order of the views, skipping views that have none.
std::vector<double> JoinDistances(const ViewDistances& distances);
// Returns the distances at a state, such as that of a refinement; nothing if a point cannot be projected there.
std::optional<ViewDistances> DistancesAt(const Problem& problem, const FreeUnknowns& free, const FitState& state,
                                         int num_threads);
// The Failure of an estimate at which a point cannot be projected.
Failure HiddenPoint();

// Returns half the sum of rho over all points and of the squared whitened corrections and effects.
double FitCost(const Problem& problem, const ViewDistances& squared_distances, const FitState& state,
               const PoseGroups& groups, const FreeUnknowns& free, const FitNoise& noise, const Loss& loss);

// Returns the inverse standard deviations of the free effects.
Eigen::VectorXd EffectWeights(const FreeUnknowns& free, const FitNoise& noise);
// Likewise for effects whose groups have these standard deviations.
Eigen::VectorXd EffectWeights(const SharedEffects& effects, const std::vector<double>& sigmas);

// Returns camera_from_target of a view: its robot pose with its effect and its correction.
Rigid3d PredictedPose(const Problem& problem, const FreeUnknowns& free, const FitState& state, size_t view);

// Returns the priors of camera and target as rows of views that do not depend on effects (PriorView); the
// list is empty if there are no priors.
std::vector<LinearisedView> PriorViews(const BundleOptions& options, const FreeUnknowns& free, const Camera& camera,
                                       const TargetShape& shape, double row_variance, Eigen::Index num_effects);

// Linearises all observations: the captures, with one view per robot pose, and the priors of camera and target if there
// are any, whose rows have the noise variance `prior_row_variance`.
std::optional<std::vector<LinearisedView>> LineariseFit(const Problem& problem, const FitState& state,
                                                        const PoseGroups& groups, const FreeUnknowns& free,
                                                        const FitNoise& noise, const Loss& loss,
                                                        double prior_row_variance, const BundleOptions& options);

// Runs Ceres once with the noise held constant.
ceres::Solver::Summary MinimiseOnce(const FreeUnknowns& free, const Loss& loss, NoiseScale scale,
                                    const BundleOptions& bundle_options, Fit* fit);

// Returns the unknowns' normal matrix at the noise of the fit, or nothing if a point cannot be projected.
std::optional<Information> FitInformation(const FreeUnknowns& free, const Loss& loss,
                                          const BundleOptions& bundle_options, Fit* fit);

}  // namespace heba
