// The positions of a target's points, where a run estimates them (TargetShapeGroup::kPoints).
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "heba/data/point_offsets.h"
#include "heba/evaluation/finding.h"
#include "heba/run_types.h"
#include "solvers/calibration/point_estimation.h"

namespace heba {

// The calibration is repeated with the points where the one before has found them.
inline constexpr int kRoundsOfPoints = 2;

// Returns the targets whose points are to be estimated. Throws InputError if such a target can be read in several
// orders, in which its points would change places.
std::vector<size_t> TargetsWithFreePoints(const Dataset& dataset);

// Returns the groups of a target's shape that a calibration frees by itself: all but the points.
std::vector<TargetShapeGroup> GroupsOfSurface(std::vector<TargetShapeGroup> groups);

// Returns the targets with their points displaced; `offsets` has one entry for each.
std::vector<std::shared_ptr<const Target>> DisplacedTargets(const std::vector<std::shared_ptr<const Target>>& designed,
                                                            const std::vector<PointOffsets>& offsets);

// Returns the finding `points_estimated` for each of these targets.
std::vector<Finding> DescribePoints(const Problem& problem, const std::vector<size_t>& targets,
                                    const EstimatedPoints& points);

}  // namespace heba
