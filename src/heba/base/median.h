// The median of a list of numbers.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "heba/base/error.h"

namespace heba {

// Returns the median of `values`, which must not be empty. For an even number of values it is the larger one of the two
// middle values.
inline double Median(std::vector<double> values) {
  CHECK(!values.empty());
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace heba
