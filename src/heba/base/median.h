// The middle of a list.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "heba/base/error.h"

namespace heba {

// The element with half of the others below it; of an even number the upper one of the middle two. `values` must not be
// empty.
inline double Median(std::vector<double> values) {
  CHECK(!values.empty());
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace heba
