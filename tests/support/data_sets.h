// Recorded data sets that are not part of the project.
#pragma once

#include <cstdlib>
#include <filesystem>

namespace heba {

// The folder with the recorded sets: HEBA_DATA_DIR, or shared/data beside the checkout. It may not be there: a test
// then skips and says so.
inline std::filesystem::path DataDir() {
  const char* dir = std::getenv("HEBA_DATA_DIR");
  if (dir != nullptr) return dir;
  return std::filesystem::path(HEBA_SOURCE_DIR) / ".." / "shared" / "data";
}

}  // namespace heba

#define HEBA_SKIP_WITHOUT(path)                                                               \
  if (!std::filesystem::exists(path)) {                                                       \
    GTEST_SKIP() << "recorded data not here: " << (path) << " (set HEBA_DATA_DIR to use it)"; \
  }                                                                                           \
  static_assert(true)
