// An estimate in progress: its unknowns, the noise that its residuals are whitened with, one run of Ceres with that
// noise, and the information matrix. Equations: docs/estimation.md.
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include <ceres/solver.h>

#include "heba/refinement.h"
#include "solvers/residuals/capture_loops.h"
#include "solvers/residuals/loss.h"
#include "solvers/uncertainty/information.h"
#include "solvers/uncertainty/linearisation.h"
#include "solvers/uncertainty/variance_components.h"

namespace heba {

// Problems are large: they are shared, and copied only to be modified.
using SharedProblem = std::shared_ptr<const Problem>;

// Wraps a problem that the caller owns.
inline SharedProblem Borrowed(const Problem& problem) { return {SharedProblem(), &problem}; }

// An estimate in progress.
struct Fit {
  SharedProblem problem;  // The points in use, with their weights.
  CaptureGroups groups;
  FitState state;
  FitNoise noise;
  std::vector<RobotNoise> robot_stddev;                  // One per moving arm.
  double dof = std::numeric_limits<double>::infinity();  // See PairSolution::covariance_dof.
  // For each camera, the part of its points' sigma that is not in the detector's covariances. It is equal for all
  // points of the camera and estimated from the residuals. Nothing: its points are weighted equally.
  std::vector<std::optional<double>> unmodelled_sigma_px;
  Convergence convergence;
};
// Returns a fit with the effects of the problem that its state lacks: zero, with the standard deviations that their
// groups start with.
Fit WithStartOfEffects(Fit fit, const Problem& problem);

// Selects how sigma is estimated: from the RMS of the fit, or from the median, which is robust to 50 % outliers. The
// median is used while inliers are searched for; that fit need not converge to the last digits.
enum class NoiseScale { kOfFit, kMedian };

// Returns the state and the noise of a solution, in which no image is weighted yet.
FitState StateOf(const Solution& solution);
FitNoise NoiseOf(const Solution& solution);

// Returns the problem with points that are weighted by the detectors' covariances and the unmodelled sigma of their
// camera; those of a camera without one keep their weights.
Problem WeightPoints(Problem problem, const std::vector<std::optional<double>>& unmodelled_sigma_px);
// Returns the problem with the weights of the solution (Solution::unmodelled_sigma_px).
Problem WeightedAs(const Solution& solution, Problem problem);

// Returns the problem with these weights, which stay the same in all fits that follow.
Problem WithFixedWeights(Problem problem, const Solution& solution);

// The points of each camera.
std::vector<std::vector<const Observations*>> PointsOfCameras(const Problem& problem);

// The squared whitened distances of each image's points; nothing if any of its points cannot be projected.
using ImageDistances = std::vector<std::optional<std::vector<double>>>;
// Returns the distances of the images in the order of ImagesOf.
ImageDistances DistancesAt(const Problem& problem, const CaptureGroups& groups, const FitState& state, int num_threads);
// Returns the joined distances of each camera's points; images that have none are skipped.
std::vector<std::vector<double>> DistancesOfCameras(const Problem& problem, const CaptureGroups& groups,
                                                    const ImageDistances& distances);
// The Failure of an estimate at which a point cannot be projected.
Failure HiddenPoint();

// Returns, for each group, half the sum of rho over its points and of the squared whitened corrections; infinity if a
// point cannot be projected. The cameras are those of the state, which may have other models than those of the problem.
std::vector<double> GroupCosts(const Problem& problem, const CaptureGroups& groups, const FitState& state,
                               const FitNoise& noise, const Loss& loss);
// Returns the sum of the groups' costs, and half that of the squared whitened effects.
double FitCost(const Problem& problem, const CaptureGroups& groups, const FitState& state, const FitNoise& noise,
               const Loss& loss);

// Returns the prior knowledge about cameras and about the scales of targets (ProblemCamera::prior,
// ProblemTarget::scale_sigma), and that of an earlier session (Problem::prior), as rows of views that do not depend on
// effects, scaled to noise of variance `row_variance`; none if there is no such knowledge. `num_effects` is the number
// of columns of LinearisedView::by_effects. The prior of the scales is there even if no scale is free, so that models
// are compared by the same measurements.
std::vector<LinearisedView> PriorViews(const Problem& problem, const FitState& state, double row_variance,
                                       Eigen::Index num_effects);

// Linearises the captures, with one view per group, and the priors of cameras and targets, whose rows have the noise
// variance `prior_row_variance`. Returns nothing if a point cannot be projected.
std::optional<std::vector<LinearisedView>> LineariseFit(const Problem& problem, const CaptureGroups& groups,
                                                        const FitState& state, const FitNoise& noise, const Loss& loss,
                                                        double prior_row_variance);

// Returns the variances of the columns of LinearisedView::by_effects: those of the moving arms' corrections, and those
// of their joints.
Eigen::VectorXd CorrectionVariances(const FitNoise& noise, const std::vector<Eigen::Index>& num_joints);

// How the variances of a fit are estimated.
struct VarianceSetting {
  double pixel_variance = 1;  // See VarianceGroup.
  bool pixel_is_free = true;
  bool robots_are_free = true;
  std::optional<RobotNoisePrior> robot_prior = {};
  bool effects_avoid_zero = true;  // VarianceGroup::avoids_zero.
};
// Returns the groups of the variances: the pixels; translation, rotation and, if they are noisy, joints of each moving
// arm; and the groups of the arms' effects.
std::vector<VarianceGroup> VarianceGroupsOf(const Problem& problem, const FitNoise& noise,
                                            const VarianceSetting& setting);

// Runs Ceres once with the noise held constant.
ceres::Solver::Summary MinimiseOnce(const Loss& loss, NoiseScale scale, const AdjustmentOptions& options, Fit* fit);

// Returns the unknowns' normal matrix at the noise of the fit, marginalised over the corrections, or nothing if a point
// cannot be projected.
std::optional<Information> FitInformation(const Fit& fit, const Loss& loss, int num_threads);
// Likewise from the linearised captures, one view per group, without the priors.
Information InformationOf(const Fit& fit, const std::vector<LinearisedView>& captures, const Loss& loss);

}  // namespace heba
