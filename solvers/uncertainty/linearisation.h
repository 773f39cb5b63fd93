// Linearised captures: what all images of a capture say about the unknowns and about the effects of the capture alone,
// in a few rows. They are the input of the variances, the covariance and the tests. Equations (10) and (12) of
// docs/estimation.md.
#pragma once

#include <map>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "heba/data/pair_solution.h"
#include "heba/kernels/small_matrix.h"
#include "solvers/residuals/loop_problem.h"
#include "solvers/residuals/loss.h"

namespace heba {

// One capture, linearised: offset = by_unknowns * step + by_effects * xi + noise, where the noise has unit variance
// (pixel sigma and loss applied).
struct LinearisedView {
  Eigen::MatrixXd by_unknowns;  // For the columns see Information::layout.
  // Derivatives by the tangents xi of the capture's nuisance poses (m, rad), six columns each, and then by the random
  // effects along NuisancePose::directions.
  Eigen::MatrixXd by_effects;
  // Number of columns at the end of by_effects that are combinations of those before them.
  Eigen::Index num_combined_effects = 0;
  Eigen::VectorXd offset;
  // Number of rows at the end that do not depend on the effects.
  Eigen::Index num_rows_without_effects = 0;
  // Pixel residuals that are independent of the rows above: their sum of squares and their number.
  double residual_sum_of_squares = 0;
  int num_residual_dof = 0;
};

// Linearises the captures of a problem at these values and at the nuisance poses of the captures. The images of a
// capture are joined. The offsets are those without the nuisance poses and without the shared effects: a step is a step
// of the other unknowns, but the value of effects. Returns nothing if a point cannot be projected.
std::optional<std::vector<LinearisedView>> LineariseCaptures(const LoopProblem& problem, const LoopValues& values,
                                                             double pixel_sigma_px, const Loss& loss);

// The positions of a target's points as further unknowns. A point is moved by its matrix (3 x size) times the
// coefficients.
struct PointUnknowns {
  std::map<int, Eigen::MatrixXd> by_id;
  Eigen::Index first = 0;  // Place of the first coefficient among those of all targets.
  Eigen::Index size = 0;   // 0 if the points are not unknown.
};

// Linearises the captures likewise, at a pixel sigma of 1 and without a loss, with columns for the coefficients of the
// points (`points` has one entry per target) after those of the unknowns.
std::optional<std::vector<LinearisedView>> LineariseWithPoints(const LoopProblem& problem, const LoopValues& values,
                                                               const std::vector<PointUnknowns>& points);

// Returns one view per group, with the rows of its views, which share their effects, in no more rows than columns.
// Views after those of the groups, such as a prior of the camera, are kept at the end.
std::vector<LinearisedView> StackGroups(const std::vector<LinearisedView>& views, const PoseGroups& groups);

}  // namespace heba
