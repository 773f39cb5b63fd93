// The adjustment of a rig in progress, and what its images and captures tell at an estimate.
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "heba/rig_adjustment.h"
#include "solvers/refine/fit.h"
#include "solvers/residuals/loss.h"
#include "solvers/rig/rig_loops.h"
#include "solvers/uncertainty/information.h"
#include "solvers/uncertainty/linearisation.h"
#include "solvers/uncertainty/variance_components.h"

namespace heba {

// Flags of the points in use: for each capture, for each image, one per point.
using RigPointFlags = std::vector<std::vector<std::vector<bool>>>;

// An estimate in progress.
struct RigFit {
  std::shared_ptr<const RigProblem> problem;  // The points in use, with their weights.
  CaptureGroups groups;
  RigState state;
  RigNoise noise;
  std::vector<RobotNoise> robot_stddev;  // One per moving arm.
  double dof = std::numeric_limits<double>::infinity();
  // For each camera, the part of its points' sigma that is not in the detector's covariances; nothing if it has none.
  std::vector<std::optional<double>> unmodelled_sigma_px;
  Convergence convergence;
};

// Returns the problem with points that are weighted by the detectors' covariances and the unmodelled sigma of their
// camera; those of a camera without one keep their weights.
RigProblem WeightPoints(RigProblem problem, const std::vector<std::optional<double>>& unmodelled_sigma_px);

// Adds the effects of the problem that the state lacks: zero, with the standard deviations that their groups start
// with.
void AddEffects(const RigProblem& problem, RigState* state, RigNoise* noise);

// The linearised images (LinearisedView, one per image in the order of ImagesOf), and the groups of those that share
// their corrections.
struct LinearisedImages {
  std::vector<ImageIndex> images;
  std::vector<LinearisedView> views;
  PoseGroups groups;
};
// Returns nothing if a point cannot be projected.
std::optional<LinearisedImages> LineariseImages(const RigProblem& problem, const CaptureGroups& groups,
                                                const RigState& state, const RigNoise& noise, const Loss& loss);

// Returns the prior knowledge about cameras and about the scales of targets (RigCamera::prior, RigTarget::scale_sigma)
// as rows of views that do not depend on effects, scaled to noise of variance `row_variance`; none if there is no such
// knowledge. `num_effects` is the number of columns of LinearisedView::by_effects.
std::vector<LinearisedView> PriorViews(const RigProblem& problem, const RigState& state, double row_variance,
                                       Eigen::Index num_effects);

// Returns the variances of the columns of LinearisedView::by_effects: those of the moving arms' corrections.
Eigen::VectorXd CorrectionVariances(const RigNoise& noise, size_t num_moving);

// Returns the squared whitened distances of the points of each image, in the order of ImagesOf; nothing for an image of
// which a point cannot be projected.
ViewDistances ImageDistances(const RigProblem& problem, const CaptureGroups& groups, const RigState& state,
                             int num_threads);

// Returns an orthonormal basis of the part of an image's rows that another pose of the target would explain; the view
// must have at least six rows.
Eigen::MatrixXd PosePartOf(const RigProblem& problem, const RigImage& image, const LinearisedView& view);
// Returns the tangents of a capture's corrections of the moving arms, joined; zero for exact arms.
Eigen::VectorXd CorrectionTangents(const RigState& state, size_t capture, const std::vector<size_t>& moving);
// Returns the whitened residuals of an image at the state's effects and at these tangents of its corrections.
Eigen::VectorXd ResidualOf(const RigProblem& problem, const RigState& state, const LinearisedView& view,
                           const Eigen::VectorXd& corrections);
// Returns the groups of the variances: the pixels, translation and rotation of each moving arm, and the groups of the
// arms' effects. `pixel_variance`: see VarianceGroup.
std::vector<VarianceGroup> RigVarianceGroups(const RigProblem& problem, const RigNoise& noise, double pixel_variance,
                                             bool pixel_is_free, bool robots_are_free,
                                             const std::optional<RobotNoisePrior>& robot_prior);

// The knowledge about a capture's corrections xi and the unknowns, from all images of a group: the posterior of xi is
// normal with covariance inverse_normal given the unknowns, and moves with them by -by_unknowns * step.
struct CorrectionPosterior {
  Eigen::MatrixXd inverse_normal;
  Eigen::MatrixXd by_unknowns;
};
// `views` are those of one group; there may be none, which leaves the prior.
CorrectionPosterior PosteriorOf(const std::vector<const LinearisedView*>& views, const Eigen::VectorXd& variances,
                                Eigen::Index num_unknowns);
// Returns the covariance of an image's rows that the uncertainty of the unknowns and of the capture's corrections
// causes.
Eigen::MatrixXd PredictionCovariance(const LinearisedView& view, const CorrectionPosterior& posterior,
                                     const Eigen::MatrixXd& covariance);

// Returns the normal matrix of the unknowns, marginalised over the corrections; nothing if a point cannot be projected.
std::optional<Information> RigInformation(const RigFit& fit, const Loss& loss);

// Iterates fit and noise until both converge. `scale` is that of the pixel noise: kMedian while outliers are searched
// for.
Outcome<RigFit> IterateRig(RigFit fit, const Loss& loss, NoiseScale scale, const RigOptions& options);

}  // namespace heba
