#include "heba/data/free_parameters.h"

namespace heba {

FreeParameters FreeOf(const CameraModel& model, const std::vector<ParameterGroup>& free_intrinsics,
                      const std::vector<TargetShapeGroup>& free_shape) {
  const auto contains = [](const auto& groups, auto group) {
    return std::find(groups.begin(), groups.end(), group) != groups.end();
  };
  FreeParameters free;
  for (int i = 0; i < NumParams(model); ++i) free.push_back(contains(free_intrinsics, GroupOf(i)));
  if (free_shape.empty()) return free;
  for (int i = 0; i < TargetShape::kNumParams; ++i) free.push_back(contains(free_shape, ShapeGroupOf(i)));
  return free;
}

}  // namespace heba
