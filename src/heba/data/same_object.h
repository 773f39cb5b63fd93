// Cameras, targets and other named objects that two problems of one cell have in common.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace heba {

// Returns the place of the object of this name among `all`, or nothing. Where each of two problems has a single one, it
// is the same whatever its name is; `num_objects` is the number of objects that the name is one of.
template <class Object>
std::optional<size_t> PlaceOfSame(const std::string& name, size_t num_objects, const std::vector<Object>& all) {
  if (num_objects == 1 && all.size() == 1) return 0;
  for (size_t i = 0; i < all.size(); ++i) {
    if (all[i].name == name) return i;
  }
  return std::nullopt;
}

}  // namespace heba
