// Locates recorded data sets that are not part of the repository.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "heba/base/text.h"

namespace heba {

// Returns the folder of the recorded sets: HEBA_DATA_DIR, or shared/data next to the checkout. If it does not exist,
// a test is skipped with a message.
inline std::filesystem::path DataDir() {
  const char* dir = std::getenv("HEBA_DATA_DIR");
  if (dir != nullptr) return dir;
  return std::filesystem::path(HEBA_SOURCE_DIR) / ".." / "shared" / "data";
}

// Reads the numbers of a file with a header and a first column that names the capture.
inline std::vector<std::vector<double>> ReadRecordedNumbers(const std::filesystem::path& path) {
  std::ifstream stream(path);
  std::string line;
  std::getline(stream, line);
  std::vector<std::vector<double>> rows;
  while (std::getline(stream, line)) {
    const std::vector<std::string> fields = Split(Trim(line), ',');
    std::vector<double>& row = rows.emplace_back();
    for (size_t i = 1; i < fields.size(); ++i) row.push_back(std::stod(fields[i]));
  }
  return rows;
}

}  // namespace heba

#define HEBA_SKIP_WITHOUT(path)                                                               \
  if (!std::filesystem::exists(path)) {                                                       \
    GTEST_SKIP() << "recorded data not here: " << (path) << " (set HEBA_DATA_DIR to use it)"; \
  }                                                                                           \
  static_assert(true)
