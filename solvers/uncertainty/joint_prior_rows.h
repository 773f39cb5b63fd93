// The rows of a joint prior: its whitened residuals and their derivatives, in the forms that the adjustment, the
// variances and the covariance take. Equation (19) of docs/estimation.md.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heba/data/joint_prior.h"
#include "heba/data/unknowns.h"
#include "solvers/residuals/loop_problem.h"
#include "solvers/uncertainty/linearisation.h"

namespace heba {

// The residuals L^-1 (x - mean), where the covariance is L L^T; the difference of two poses is LocalCoordinates(mean,
// x). There is a row for each unknown of the prior, free or not, so that models with different unknowns are compared by
// the same measurements.
struct JointPriorRows {
  Eigen::VectorXd residuals;
  Eigen::MatrixXd by_unknowns;  // Columns as in the layout.
};

// Returns the places of the prior's unknowns whose owner is one of the layout, known or not.
std::vector<Eigen::Index> PlacesIn(const UnknownLayout& layout, const JointPrior& prior);

// The differences of all unknowns of a prior from their means, in the order of its covariance, and their derivatives by
// the unknowns of a layout; zero for an unknown without a place.
struct PriorDifferences {
  Eigen::VectorXd values;
  Eigen::MatrixXd by_unknowns;
};
PriorDifferences DifferencesFrom(const JointPrior& prior, const UnknownLayout& layout, const LoopValues& values);

// Returns the rows at these values: one for each of PlacesIn. Of the other unknowns nothing is known.
JointPriorRows RowsOf(const JointPrior& prior, const UnknownLayout& layout, const LoopValues& values);

// Returns the rows as those of a view that do not depend on effects, scaled to noise of variance `row_variance`.
// `num_effects` is the number of columns of LinearisedView::by_effects.
LinearisedView AsView(const JointPriorRows& rows, double row_variance, Eigen::Index num_effects);

}  // namespace heba
