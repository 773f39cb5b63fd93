#include "heba/data/pair_problem.h"

namespace heba {

std::vector<View> ApplyShape(const std::vector<View>& views, const TargetShape& shape) {
  std::vector<View> shaped = views;
  for (View& view : shaped) view.observations = ApplyShape(view.observations, shape);
  return shaped;
}

}  // namespace heba
