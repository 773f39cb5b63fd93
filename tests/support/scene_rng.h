// SceneRng draws the tests' scenes. A test's seed is one scene of many: HEBA_SCENES=1, 2, ... draws others from
// the same seeds. What fails with some of them claims too much, or stands for a fault that its own scene does not show.
#pragma once

#include <cstdint>
#include <cstdlib>

#include "heba/base/rng.h"

namespace heba {

inline Rng SceneRng(uint64_t seed) {
  const char* const scenes = std::getenv("HEBA_SCENES");
  return scenes == nullptr ? Rng(seed) : Rng(seed, std::strtoull(scenes, nullptr, 10));
}

}  // namespace heba
