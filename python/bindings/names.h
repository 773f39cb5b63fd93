// Names of a run's parts.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"

namespace heba {

// Returns the place of a name. Throws InputError, which begins with `what`, if it is none of the names, of which the
// only one of a run without names is empty.
inline size_t IndexOf(const std::string& what, const std::string& name, const std::vector<std::string>& names) {
  if (names == std::vector<std::string>{""} && !name.empty()) {
    throw InputError(what + ": the run has only one, without a name; no dictionary is needed");
  }
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) throw InputError(what + ": " + UnknownName(name, names));
  return static_cast<size_t>(found - names.begin());
}

// Returns the place of an arm; an empty name is that of the only one. Throws InputError, too, which says that `needed`
// tells several arms apart.
inline size_t IndexOfArm(const std::string& what, const std::string& name, const std::vector<std::string>& robots,
                         const std::string& needed = "a dictionary by their names") {
  if (!name.empty()) return IndexOf(what, name, robots);
  if (robots.size() > 1) {
    throw InputError(what + ": the rig has several arms; " + needed + " is needed: " + Join(robots, ", "));
  }
  return 0;
}

}  // namespace heba
