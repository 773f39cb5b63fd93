// The adjustment of kinematic loops as a textbook writes it: one residual per point, automatic derivatives, and the
// elimination of the captures' nuisance poses by Ceres. It shares no code with the cost, the elimination and the
// linearisation that it is compared with.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "solvers/residuals/loop_problem.h"

namespace heba {

// Values of all unknowns: those that captures share, and the nuisance poses of each capture.
struct TextbookValues {
  LoopValues shared;
  std::vector<std::vector<Rigid3d>> nuisance_poses;
};

struct TextbookOptions {
  double pixel_sigma_px = 1;
  // One sigma of each owner of effects, whose prior mean is 0; nothing: no prior.
  std::vector<std::optional<double>> effect_sigmas;
  // Prior of the first camera: its parameters and 1 / sigma of each; empty: no prior.
  std::vector<double> camera_prior;
  std::vector<double> camera_prior_weights;
};

struct TextbookEvaluation {
  double cost = 0;               // The sum of all squared residuals.
  Eigen::VectorXd gradient;      // Half the gradient with respect to LoopProblem::layout.
  Eigen::VectorXd own_gradient;  // Half the gradient with respect to the tangents of all nuisance poses.
  Eigen::MatrixXd covariance;    // Covariance of the unknowns of the layout, marginalised over the nuisance poses.
};

// The lenses are brown5 and kannala_brandt4. `with_covariance`: the problem must determine all unknowns.
TextbookEvaluation EvaluateTextbook(const LoopProblem& problem, const TextbookValues& values,
                                    const TextbookOptions& options, bool with_covariance);

// Minimises the cost from `start`.
TextbookValues SolveTextbook(const LoopProblem& problem, const TextbookValues& start, const TextbookOptions& options);

}  // namespace heba
