// Selection of evenly spread elements of a list.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace heba {

// Returns at most `most` of the indices 0 .. count - 1, evenly spread. The first index is always included.
inline std::vector<size_t> EvenIndices(size_t count, size_t most) {
  std::vector<size_t> indices;
  const size_t num = std::min(count, most);
  for (size_t i = 0; i < num; ++i) indices.push_back(i * count / num);
  return indices;
}

}  // namespace heba
