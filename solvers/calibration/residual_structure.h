// Residuals have a mean in common at a point of a target where the print lies beside its design, and in a region of an
// image where the lens has a part that its model lacks. This header finds both.
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "heba/data/problem.h"
#include "heba/data/solution.h"
#include "heba/evaluation/evaluation.h"
#include "heba/evaluation/finding.h"

namespace heba {

// The mean residual in one region of a camera's image.
struct RegionDeviation {
  size_t camera = 0;
  Eigen::Vector2d middle_px = Eigen::Vector2d::Zero();
  Eigen::Vector2d mean_px = Eigen::Vector2d::Zero();  // Observed minus predicted.
  double p_value = 1;                                 // Likewise, for all regions.
};

struct ResidualStructure {
  std::vector<PointDeviation> points;    // In the order of the targets and of the ids.
  std::vector<RegionDeviation> regions;  // Regions with too few points are left out.
  // `target_points` and `image_regions`, if some deviate (kDeviates).
  std::vector<Finding> findings;
};

inline constexpr double kDeviates = 1e-3;

// Returns the structure of the residuals at the corrected poses of the arms. A point's deviation d is that of the least
// squares of all its residuals r, r = J d; its chi-square has 3 degrees of freedom, that of the mean of a region 2, in
// units of the estimated sigma. What the poses of single images take up makes both smaller than they are, not larger.
// `problem` holds the points that the solution used. Images with a point that cannot be projected are passed over.
ResidualStructure FindResidualStructure(const Problem& problem, const Solution& solution);

}  // namespace heba
