#include "heba/io/pose_folder.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <map>
#include <string_view>
#include <system_error>

#include "heba/base/text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

std::string SuffixOf(const fs::path& file) { return Lower(file.extension().string()); }

}  // namespace

std::vector<fs::path> PoseFilesOf(const fs::path& folder) {
  constexpr std::array<std::string_view, 6> kSuffixes = {".txt", ".csv", ".yaml", ".yml", ".json", ".npy"};
  std::vector<fs::path> files;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    const bool is_known = std::find(kSuffixes.begin(), kSuffixes.end(), SuffixOf(entry.path())) != kSuffixes.end();
    const bool has_digit = entry.path().stem().string().find_first_of("0123456789") != std::string::npos;
    if (is_known && has_digit && entry.is_regular_file(error)) files.push_back(entry.path());
  }
  // If several files have one name, such as 007.json and 007.txt, the files with the most frequent suffix are the
  // poses.
  std::map<std::string, size_t> num_of_suffix;
  std::map<std::string, size_t> num_of_stem;
  for (const fs::path& file : files) {
    ++num_of_suffix[SuffixOf(file)];
    ++num_of_stem[file.stem().string()];
  }
  if (num_of_stem.size() < files.size()) {
    const auto commonest = std::max_element(num_of_suffix.begin(), num_of_suffix.end(),
                                            [](const auto& a, const auto& b) { return a.second < b.second; });
    std::erase_if(files, [&](const fs::path& file) { return SuffixOf(file) != commonest->first; });
  }
  std::sort(files.begin(), files.end(), [](const fs::path& a, const fs::path& b) {
    return NaturalLess(a.filename().string(), b.filename().string());
  });
  return files;
}

std::optional<long> NumberInName(const std::string& stem) {
  constexpr std::string_view kDigits = "0123456789";
  const size_t last = stem.find_last_of(kDigits);
  if (last == std::string::npos) return std::nullopt;
  const size_t before = stem.find_last_not_of(kDigits, last);
  const size_t first = before == std::string::npos ? 0 : before + 1;
  long number = 0;
  const auto [end, error] = std::from_chars(stem.data() + first, stem.data() + last + 1, number);
  return error == std::errc() ? std::optional(number) : std::nullopt;
}

}  // namespace heba
