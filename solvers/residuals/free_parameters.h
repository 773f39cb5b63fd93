// Which parameters are unknowns.
#pragma once

#include <algorithm>
#include <vector>

#include "heba/camera/camera_model.h"
#include "heba/data/target_shape.h"

namespace heba {

// Which parameters beside the poses are unknowns: one entry for each of the camera's and, only if one of them is free,
// one for each of the target's shape behind them.
using FreeParameters = std::vector<bool>;
FreeParameters FreeOf(const CameraModel& model, const std::vector<ParameterGroup>& free_intrinsics,
                      const std::vector<TargetShapeGroup>& free_shape = {});
inline bool HasShape(const FreeParameters& free, const CameraModel& model) {
  return free.size() > static_cast<size_t>(NumParams(model));
}
inline Eigen::Index NumFree(const FreeParameters& free) { return std::count(free.begin(), free.end(), true); }

}  // namespace heba
