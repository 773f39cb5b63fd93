#include "heba/data/free_parameters.h"

namespace heba {

namespace {

template <class Group>
bool Contains(const std::vector<Group>& groups, Group group) {
  return std::find(groups.begin(), groups.end(), group) != groups.end();
}

}  // namespace

std::array<bool, TargetShape::kNumParams> FreeShapeOf(const std::vector<TargetShapeGroup>& free_shape) {
  std::array<bool, TargetShape::kNumParams> free{};
  for (size_t i = 0; i < free.size(); ++i) free[i] = Contains(free_shape, ShapeGroupOf(static_cast<int>(i)));
  return free;
}

FreeParameters FreeOf(const CameraModel& model, const std::vector<ParameterGroup>& free_intrinsics) {
  FreeParameters free;
  for (int i = 0; i < NumParams(model); ++i) free.push_back(Contains(free_intrinsics, GroupOf(i)));
  return free;
}

}  // namespace heba
