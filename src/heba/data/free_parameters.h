// Selects which parameters besides the poses are estimated.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "heba/camera/camera_model.h"
#include "heba/data/target_shape.h"

namespace heba {

// One flag per camera parameter and, only if any parameter of the target's shape is free, one per shape parameter
// after them; true if the parameter is unknown.
using FreeParameters = std::vector<bool>;
// Returns those of a camera.
FreeParameters FreeOf(const CameraModel& model, const std::vector<ParameterGroup>& free_intrinsics);
// Returns one flag per parameter of a target's shape.
std::array<bool, TargetShape::kNumParams> FreeShapeOf(const std::vector<TargetShapeGroup>& free_shape);
inline Eigen::Index NumFree(const FreeParameters& free) { return std::count(free.begin(), free.end(), true); }

}  // namespace heba
