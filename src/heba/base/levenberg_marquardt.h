// The Levenberg-Marquardt method for small dense problems, such as the pose of one view or the outline of one dot.
// Ceres is used for the large ones.
#pragma once

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

#include <Eigen/Core>

#include "heba/base/factorisation.h"

namespace heba {

struct LevenbergMarquardtOptions {
  int max_iterations = 50;  // Number of steps that decrease the cost.
  // Number of steps that are tried, which bounds the time where many steps do not decrease the cost.
  int max_tries = std::numeric_limits<int>::max();
  // The damping is relative to the diagonal of the normal matrix (Marquardt 1963). It is divided by 10 after a step
  // that decreases the cost, and multiplied by 10 otherwise.
  double initial_damping = 1e-4;
  double least_damping = 1e-12;
  double least_raised_damping = 1e-6;  // The least damping after a step that does not decrease the cost.
  double most_damping = 1e8;           // The iteration ends beyond.
  // The iteration ends if a step promises to decrease the cost by less than this share, or decreases it by less. At the
  // minimum, rounding would decide whether the cost decreases.
  double small_drop = 1e-12;
  // The promise of a step is trusted at lower damping only: strong damping shortens every step.
  double trusted_damping = std::numeric_limits<double>::infinity();
  // False if only a small promise ends the iteration. A caller that then takes the remaining step needs this: its error
  // is quadratic in that step, which is unknown after a step that decreased the cost by little.
  bool ends_after_small_drop = true;
};

// The end of an iteration.
template <class Step>
struct LevenbergMarquardtEnd {
  bool is_finite = true;  // False if a step was not finite.
  // The step that promised less than small_drop, and was not taken; nothing if the iteration ended otherwise.
  std::optional<Step> remaining_step;
};

// Ends an iteration only when it has converged.
struct NeverStop {
  template <class Point>
  bool operator()(const Point& /*point*/) const {
    return false;
  }
};

// Minimises a cost from *point on, which becomes the best point that was found.
//
// A Point has the members `cost` (the sum of squares), `normal` (J^T J, of which the lower triangle is used) and
// `gradient` (J^T r). try_step(point, step) returns the point after a step, or nothing if it is not allowed or cannot
// be evaluated; the step is then shortened. stops_at(point) ends the iteration after a step that decreases the cost.
template <class Point, class TryStep, class StopsAt = NeverStop>
auto MinimiseSquares(const LevenbergMarquardtOptions& options, const TryStep& try_step, Point* point,
                     const StopsAt& stops_at = {}) -> LevenbergMarquardtEnd<std::decay_t<decltype(point->gradient)>> {
  using Step = std::decay_t<decltype(point->gradient)>;
  double damping = options.initial_damping;
  int num_iterations = 0;
  for (int num_tries = 0; num_iterations < options.max_iterations && num_tries < options.max_tries; ++num_tries) {
    auto damped = point->normal;
    damped.diagonal() *= 1 + damping;
    const Step step = -SolveSymmetric(damped, point->gradient);
    if (!step.allFinite()) return {false, std::nullopt};
    const double least_drop = options.small_drop * point->cost;
    if (damping < options.trusted_damping && -step.dot(point->gradient) <= least_drop) return {true, step};
    std::optional<Point> next = try_step(*point, step);
    if (next && next->cost <= point->cost) {
      const double drop = point->cost - next->cost;
      *point = std::move(*next);
      damping = std::max(options.least_damping, 0.1 * damping);
      ++num_iterations;
      if ((options.ends_after_small_drop && drop < least_drop) || stops_at(*point)) break;
    } else {
      damping = std::max(options.least_raised_damping, 10 * damping);
      if (damping > options.most_damping) break;
    }
  }
  return {};
}

}  // namespace heba
