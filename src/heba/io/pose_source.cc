#include "heba/io/pose_source.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <optional>

#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/config/yaml_reader.h"
#include "heba/io/import_text.h"
#include "heba/io/npy_file.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

constexpr size_t kMatrixNumbers = 16;

std::string SuffixOf(const fs::path& file) {
  std::string suffix = file.extension().string();
  std::transform(suffix.begin(), suffix.end(), suffix.begin(), [](unsigned char c) { return std::tolower(c); });
  return suffix;
}

bool IsYaml(const std::string& suffix) { return suffix == ".yaml" || suffix == ".yml" || suffix == ".json"; }

PoseRow RowOf(const PoseFormat& format, std::vector<double> numbers, const std::string& where) {
  if (numbers.size() != format.columns.size()) {
    throw InputError(where + ": " + std::to_string(numbers.size()) + " numbers; a pose has " +
                     std::to_string(format.columns.size()) + ": " + Join(format.columns, ", "));
  }
  const Outcome<Rigid3d> pose = PoseFromNumbers(format, numbers);
  if (!pose) throw InputError(where + ": " + pose.reason());
  PoseRow row;
  row.pose = *pose;
  row.numbers = std::move(numbers);
  return row;
}

// All numbers within, in their order.
void AppendNumbers(const ConfigValue& value, std::vector<double>* numbers) {
  if (value.IsText()) {
    numbers->push_back(value.AsNumber());
  } else if (value.IsList()) {
    for (const ConfigValue& item : value.AsList()) AppendNumbers(item, numbers);
  } else if (value.IsMap()) {
    for (const auto& entry : value.node()) {
      AppendNumbers(ConfigValue(entry.second, value.file(), entry.first.Scalar()), numbers);
    }
  }
}

std::vector<double> NumbersOfYaml(const fs::path& file, const PoseFormat& format) {
  const std::string text = ReadTextFile(file);
  if (text.starts_with("%YAML:")) {
    for (auto& [name, numbers] : FileStorageNumbers(file)) {
      if (numbers.size() == format.columns.size()) return numbers;
    }
    throw InputError(file.string() + ": holds no matrix of " + std::to_string(format.columns.size()) + " numbers");
  }
  const ConfigValue value = ParseYaml(text, file);
  std::vector<double> numbers;
  if (value.IsMap()) {
    MapReader reader(value);
    const bool has_all = std::all_of(format.columns.begin(), format.columns.end(),
                                     [&](const std::string& column) { return reader.Has(column); });
    if (has_all) {
      for (const std::string& column : format.columns) numbers.push_back(reader.Get(column).AsNumber());
      return numbers;
    }
  }
  AppendNumbers(value, &numbers);
  return numbers;
}

// A table of one row, or nothing but numbers.
std::vector<double> NumbersOfText(const fs::path& file, const PoseFormat& format) {
  const std::string text = ReadTextFile(file);
  const std::vector<TextLine> lines = LinesOf(text);
  const bool names_columns =
      !lines.empty() && std::any_of(format.columns.begin(), format.columns.end(), [&](const std::string& column) {
        const std::vector<std::string> names = Split(lines.front().text, ',');
        return std::find(names.begin(), names.end(), column) != names.end();
      });
  if (!names_columns) return NumbersOfFile(file);
  const std::vector<PoseRow> rows = ParsePoses(text, file, format);
  if (rows.size() != 1) throw InputError(file.string() + ": holds " + std::to_string(rows.size()) + " poses, not one");
  return rows.front().numbers;
}

PoseRow ReadOnePose(const fs::path& file, const PoseFormat& format) {
  const std::string suffix = SuffixOf(file);
  std::vector<double> numbers;
  if (suffix == ".npy") {
    numbers = ReadNpyFile(file).numbers;
  } else if (IsYaml(suffix)) {
    numbers = NumbersOfYaml(file, format);
  } else {
    numbers = NumbersOfText(file, format);
  }
  PoseRow row = RowOf(format, std::move(numbers), file.string());
  row.image = file.stem().string();
  return row;
}

std::vector<PoseRow> ReadPoseArray(const fs::path& file, const PoseFormat& format) {
  const NumberArray array = ReadNpyFile(file);
  const size_t num_columns = format.columns.size();
  const bool is_table = array.shape.size() == 2 && array.shape[1] == num_columns;
  const bool is_matrices = array.shape.size() == 3 && array.shape[1] == 4 && array.shape[2] == 4;
  if (!is_table && !(is_matrices && num_columns == kMatrixNumbers)) {
    std::vector<std::string> sizes;
    for (const size_t size : array.shape) sizes.push_back(std::to_string(size));
    throw InputError(file.string() + ": is an array of " + Join(sizes, " x ") + "; N x " + std::to_string(num_columns) +
                     " is needed" +
                     (num_columns == kMatrixNumbers ? ", or N x 4 x 4" : ": " + Join(format.columns, ", ")));
  }
  std::vector<PoseRow> rows;
  for (size_t i = 0; i < array.shape[0]; ++i) {
    const auto first = array.numbers.begin() + static_cast<std::ptrdiff_t>(i * num_columns);
    rows.push_back(RowOf(format, {first, first + static_cast<std::ptrdiff_t>(num_columns)},
                         file.string() + ": row " + std::to_string(i + 1)));
  }
  return rows;
}

}  // namespace

std::vector<fs::path> PoseFilesOf(const fs::path& folder) {
  constexpr std::array<std::string_view, 6> kSuffixes = {".txt", ".csv", ".yaml", ".yml", ".json", ".npy"};
  std::vector<fs::path> files;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    const bool is_known = std::find(kSuffixes.begin(), kSuffixes.end(), SuffixOf(entry.path())) != kSuffixes.end();
    if (is_known && entry.is_regular_file(error) && NumberInName(entry.path().stem().string())) {
      files.push_back(entry.path());
    }
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
  constexpr size_t kMostDigits = 15;
  if (last - first >= kMostDigits) return std::nullopt;
  return std::stol(stem.substr(first, last - first + 1));
}

std::vector<PoseRow> ReadPoses(const fs::path& path, const PoseFormat& format) {
  std::error_code error;
  if (!fs::is_directory(path, error)) {
    return SuffixOf(path) == ".npy" ? ReadPoseArray(path, format) : ReadPoseFile(path, format);
  }
  std::vector<PoseRow> rows;
  for (const fs::path& file : PoseFilesOf(path)) rows.push_back(ReadOnePose(file, format));
  if (rows.empty()) {
    throw InputError(path.string() +
                     ": the folder holds no poses; files are needed whose names have a number, .txt, .csv, .yaml, "
                     ".json or .npy");
  }
  return rows;
}

}  // namespace heba
