// Estimates the camera from the captures alone, if no calibration of it is given.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/data/pair_problem.h"

namespace heba {

// Estimates the intrinsics with Zhang's closed form (Z. Zhang, "A flexible new technique for camera calibration",
// PAMI 22(11), 2000, section 3.1, without skew) or, if noise leaves it without a solution, from guesses of the focal
// length, and then refines them with one free target pose per view, using the cost functions of the bundle
// adjustment. The robot poses are not used. Views with fewer than 4 points or with collinear points are skipped.
// Returns a Failure if fewer than 3 views are usable or if they do not determine a camera. `start` must have the same
// model and size; it replaces the initial guess, unless the views have too few points to estimate distortion.
Outcome<Camera> EstimateIntrinsics(const std::vector<View>& views, const std::string& model, int width_px,
                                   int height_px, const std::optional<Camera>& start = std::nullopt);

}  // namespace heba
