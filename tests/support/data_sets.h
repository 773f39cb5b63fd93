// Locates recorded data sets that are not part of the repository.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace heba {

// Returns the folder of the recorded sets: HEBA_DATA_DIR, or shared/data next to the checkout. If it does not exist,
// a test is skipped with a message.
std::filesystem::path DataDir();

// Reads the numbers of a file with a header and a first column that names the capture.
std::vector<std::vector<double>> ReadRecordedNumbers(const std::filesystem::path& path);

}  // namespace heba

#define HEBA_SKIP_WITHOUT(path)                                                               \
  if (!std::filesystem::exists(path)) {                                                       \
    GTEST_SKIP() << "recorded data not here: " << (path) << " (set HEBA_DATA_DIR to use it)"; \
  }                                                                                           \
  static_assert(true)
