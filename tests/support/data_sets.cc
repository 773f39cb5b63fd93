#include "tests/support/data_sets.h"

#include <cstdlib>
#include <fstream>

#include "heba/base/text.h"

namespace heba {

std::filesystem::path DataDir() {
  const char* dir = std::getenv("HEBA_DATA_DIR");
  if (dir != nullptr) return dir;
  return std::filesystem::path(HEBA_SOURCE_DIR) / ".." / "shared" / "data";
}

std::vector<std::vector<double>> ReadRecordedNumbers(const std::filesystem::path& path) {
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
