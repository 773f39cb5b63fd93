// Prior knowledge of unknowns, in the forms that the adjustment, the variances and the covariance take.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heba/data/camera_prior.h"
#include "heba/data/unknowns.h"
#include "solvers/residuals/loop_problem.h"
#include "solvers/uncertainty/information.h"
#include "solvers/uncertainty/linearisation.h"

namespace heba {

// Independent measurements of the numbers in one block of an owner: residuals weights * (x - mean).
struct BlockPrior {
  UnknownOwner owner = UnknownOwner::kCamera;
  Eigen::VectorXd weights;  // 1 / sigma, or 0 if nothing is known about a number.
  Eigen::VectorXd mean;
  size_t index = 0;  // Among the blocks of its kind of owner.
};

// Returns the prior of a camera. `is_free` has a flag for each of its parameters, and may have more flags after them;
// what is known about parameters that are not free does not matter, and has the weight 0.
BlockPrior PriorOfCamera(const CameraPrior& prior, const std::vector<bool>& is_free, size_t index);
// Returns the prior of effects about zero, with the weights 1 / sigma.
BlockPrior PriorOfEffects(Eigen::VectorXd weights, size_t index);
// Returns the prior of the scales of a target, about those of the design.
BlockPrior PriorOfScales(double sigma, size_t index);

// Returns the prior as the rows of a view that do not depend on effects, scaled to noise of variance `row_variance`:
// a row for each number that is known, free or not, so that models with different unknowns are compared by the same
// measurements. `num_effects` is the number of columns of LinearisedView::by_effects. The owner must be a camera or a
// target.
LinearisedView PriorView(const BlockPrior& prior, const UnknownLayout& layout, const LoopValues& values,
                         double row_variance, Eigen::Index num_effects);

// Returns the information with that of a prior.
Information WithPrior(Information information, const BlockPrior& prior);

}  // namespace heba
