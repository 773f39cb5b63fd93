// The positions of a target's points as unknowns of a calibration, with a variance that the images determine.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "heba/data/point_offsets.h"
#include "heba/data/problem.h"
#include "heba/data/solution.h"

namespace heba {

// Targets with more points have fewer unknowns than points: neighbours move alike.
inline constexpr size_t kMostFreePoints = 120;

struct EstimatedPoints {
  std::vector<PointOffsets> offsets;  // One per target of the problem.
  double sigma_m = 0;                 // One sigma of each coordinate of the points, about their design.
  double p_value = 1;                 // The probability of so large a likelihood ratio if the points are as designed.
  // The changes of the estimate by what the offsets leave open, as the columns that WithChanges takes.
  std::vector<Eigen::VectorXd> changes;
};

// Estimates the offsets of the points of these targets beside all unknowns of a solution, which has the covariance C.
// `problem` has the points that the solution used, at the places designed_i + known_i; `known` has one entry for each
// target. With the columns A of the unknowns and D of the points, whitened with the noise of the solution, and the
// residuals r,
//   S = D^T D - D^T A C A^T D,  g = D^T r + S known,  offsets = (S + 1 / t^2)^-1 g,
// where t, the sigma of a coordinate, maximises the restricted likelihood of g and of the other residuals, with the
// scale of the noise. Offsets have no part that is a motion of their target: it belongs to the pose of that.
// Returns nothing if a point cannot be projected.
std::optional<EstimatedPoints> EstimatePoints(const Problem& problem, const Solution& solution,
                                              const std::vector<size_t>& targets,
                                              const std::vector<PointOffsets>& known);

}  // namespace heba
