// Single images, linearised at an estimate, and the posterior of a capture's corrections given its images. Tests of
// single images and the noise of single cameras are based on them.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "solvers/residuals/capture_loops.h"
#include "solvers/residuals/loss.h"
#include "solvers/uncertainty/linearisation.h"

namespace heba {

// The linearised images (LinearisedView, one per image in the order of ImagesOf), and the groups of those that share
// their corrections.
struct LinearisedImages {
  std::vector<ImageIndex> images;
  std::vector<LinearisedView> views;
  PoseGroups groups;
};
// Returns nothing if a point cannot be projected.
std::optional<LinearisedImages> LineariseImages(const Problem& problem, const CaptureGroups& groups,
                                                const FitState& state, const FitNoise& noise, const Loss& loss);

// Linearises each of the captures with points (CapturesWithPoints) by itself, with corrections of the moving arms. The
// offsets are those at the state's effects and without its corrections. Returns nothing if a point cannot be projected.
std::optional<std::vector<LinearisedView>> LineariseEachCapture(const Problem& problem, const FitState& state,
                                                                const FitNoise& noise, const Loss& loss);

// Returns an orthonormal basis of the part of an image's rows that another pose of the target would explain; the view
// must have at least six rows.
Eigen::MatrixXd PosePartOf(const Problem& problem, const ProblemImage& image, const LinearisedView& view);
// Returns the tangents of a capture's corrections of the moving arms, joined; zero for exact arms.
Eigen::VectorXd CorrectionTangents(const FitState& state, size_t capture, const std::vector<size_t>& moving);
// Returns the whitened residuals of an image at the state's effects and at these tangents of its corrections.
Eigen::VectorXd ResidualOf(const Problem& problem, const FitState& state, const LinearisedView& view,
                           const Eigen::VectorXd& corrections);

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

}  // namespace heba
