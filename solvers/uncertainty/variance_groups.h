// Groups of random numbers of which each has one variance: the pixel noise, effects that each capture draws anew, and
// unknowns with a prior.
#pragma once

#include <limits>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace heba {

// Prior knowledge of a standard deviation: a log-normal density.
struct SigmaPrior {
  double median = 1;
  double log_sigma = 1;  // Standard deviation of the logarithm.
};

// Random numbers with one variance.
struct VarianceGroup {
  enum class Kind {
    kPixels,    // The pixel noise. The variance is relative to the views' unit.
    kEffects,   // `columns` of LinearisedView::by_effects: drawn anew for each capture.
    kUnknowns,  // `columns` of LinearisedView::by_unknowns: unknowns with the prior N(0, variance).
  };
  Kind kind = Kind::kPixels;
  std::vector<Eigen::Index> columns;
  double variance = 1;  // The value, or the initial guess.
  bool is_free = true;
  std::optional<SigmaPrior> prior = {};  // Prior of the square root of the variance.
  // Whether the square root has a prior density that is proportional to itself: the limit of the gamma densities of
  // Chung et al., "A nondegenerate penalized likelihood estimator for variance parameters in multilevel models", 2013.
  // The variance of a few effects that is found to be zero by chance would be taken for certain; with this prior it is
  // about one standard deviation away from zero instead.
  bool avoids_zero = false;
  double most = std::numeric_limits<double>::infinity();  // The largest value that is estimated.
  // The scale of a half-Cauchy prior density of the square root (Gelman, "Prior distributions for variance parameters
  // in hierarchical models", 2006); infinite without one. Where the data hardly tell a variance, its likelihood may be
  // flat up to values that nothing has.
  double half_cauchy = std::numeric_limits<double>::infinity();
};

}  // namespace heba
