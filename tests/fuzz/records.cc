// Fuzzes records and robots' programs; the first byte selects the kind of file.
#include <unistd.h>

#include <array>
#include <filesystem>
#include <fstream>

#include "heba/io/pose_records.h"
#include "tests/fuzz/target.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  static constexpr std::array<const char*, 6> kNames = {"a.json", "a.yaml", "a.xml", "a.txt", "a.npz", "a.jsonl"};
  static const std::filesystem::path folder = [] {
    std::filesystem::path made =
        std::filesystem::temp_directory_path() / ("heba_fuzz_records_" + std::to_string(getpid()));
    std::filesystem::create_directories(made);
    return made;
  }();
  const std::filesystem::path file = folder / kNames[data[0] % kNames.size()];
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(data) + 1, static_cast<std::streamsize>(size - 1));
  heba::Expect([&] {
    for (const heba::PoseRecords& place : heba::FindPoseRecords(file, 1)) {
      for (const std::vector<double>& row : place.rows) {
        CHECK(row.size() == 6 || row.size() == 7 || row.size() == 12 || row.size() == 16);
      }
      CHECK(place.images.empty() || place.images.size() == place.rows.size());
    }
  });
  return 0;
}
