// Fuzzes imported data sets that consist of several files. The input is a sequence of files below one folder, each
// preceded by a line `=== path`.
#include <algorithm>

#include "heba/base/text.h"
#include "heba/io/import.h"
#include "tests/fuzz/imported.h"
#include "tests/fuzz/target.h"

namespace {
namespace fs = std::filesystem;

// Returns true if the path cannot lead out of the folder and is short.
bool IsHarmless(const std::string& path) {
  constexpr size_t kMost = 60;
  constexpr std::string_view kLetters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./";
  return !path.empty() && path.size() < kMost && path.front() != '/' && path.back() != '/' &&
         path.find_first_not_of(kLetters) == std::string::npos && path.find("..") == std::string::npos &&
         path.find("/./") == std::string::npos && std::count(path.begin(), path.end(), '/') <= 2;
}

void WriteFiles(const std::string& text, const fs::path& folder) {
  constexpr int kMostFiles = 12;
  std::ofstream file;
  int num_files = 0;
  for (const std::string& line : heba::Split(text, '\n')) {
    if (!line.starts_with("=== ")) {
      if (file.is_open()) file << line << '\n';
      continue;
    }
    file.close();
    const std::string path = line.substr(4);
    if (!IsHarmless(path) || ++num_files > kMostFiles) continue;
    std::error_code error;
    fs::create_directories((folder / path).parent_path(), error);
    file.open(folder / path, std::ios::binary | std::ios::trunc);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const fs::path folder = heba::AsFile("", "").parent_path() / "set";
  fs::remove_all(folder);
  fs::create_directories(folder);
  WriteFiles({reinterpret_cast<const char*>(data), size}, folder);
  heba::Expect([&] { heba::CheckImported(heba::ImportDataSet(folder, "")); });
  for (const heba::ImportFormat& format : heba::ImportFormats()) {
    heba::Expect([&] { heba::CheckImported(heba::ImportDataSet(folder, format.name)); });
    heba::Expect([&] { heba::CheckImported(heba::ImportCell(folder, format.name)); });
  }
  return 0;
}
