// Locates recorded data sets that are not part of the repository.
#pragma once

#include <cstdlib>
#include <filesystem>

namespace heba {

// Returns the folder of the recorded sets: HEBA_DATA_DIR, or shared/data next to the checkout. If it does not exist,
// a test is skipped with a message.
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
