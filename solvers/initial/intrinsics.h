// A camera from the captures alone, when no calibration of it is given.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/data/problem.h"

namespace heba {

// Zhang's closed form (Z. Zhang, "A flexible new technique for camera calibration", PAMI 22(11), 2000, section 3.1,
// without skew) or, where noise leaves it without a solution, guesses of the focal length; then a refinement of the
// intrinsics with one free target pose a view, by the same costs as the bundle adjustment. The robot's poses are not
// used. Views with fewer than 4 points are passed over. Failure if fewer than 3 views are usable or if they do not
// determine a camera. With a `start`, of the same model and size, the refinement begins there.
Outcome<Camera> EstimateIntrinsics(const std::vector<View>& views, const std::string& model, int width_px,
                                   int height_px, const std::optional<Camera>& start = std::nullopt);

}  // namespace heba
