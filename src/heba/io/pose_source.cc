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
#include "heba/io/pose_folder.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

constexpr size_t kMatrixNumbers = 16;

std::string SuffixOf(const fs::path& file) { return Lower(file.extension().string()); }

bool IsYaml(const std::string& suffix) { return suffix == ".yaml" || suffix == ".yml" || suffix == ".json"; }

// Returns the numbers of a row without a header in the order of the format's columns. They are returned unchanged if
// their number does not match.
std::vector<double> InOrder(const PoseFormat& format, const std::vector<double>& numbers) {
  // Files with one pose may omit the columns that are ignored.
  std::vector<std::string> listed = format.file_columns;
  if (numbers.size() == format.columns.size()) {
    std::erase_if(listed, [&](const std::string& column) {
      return std::find(format.columns.begin(), format.columns.end(), column) == format.columns.end();
    });
  }
  if (numbers.size() != listed.size()) return numbers;
  std::vector<double> ordered;
  for (const std::string& column : format.columns) {
    ordered.push_back(numbers[static_cast<size_t>(std::find(listed.begin(), listed.end(), column) - listed.begin())]);
  }
  return ordered;
}

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

// Returns the numbers of a mapping x, y, z, or of a mapping x, y, z, w in the order of the format's quaternion; nothing
// if it is neither.
std::optional<std::vector<double>> NumbersOfAxes(const ConfigValue& map, const PoseFormat& format) {
  MapReader reader(map);
  const bool has_w = reader.Has("w");
  std::vector<std::string> keys = {"x", "y", "z"};
  if (has_w) keys.insert(format.rotation == "quaternion_wxyz" ? keys.begin() : keys.end(), "w");
  std::vector<double> numbers;
  if (map.node().size() != keys.size()) return std::nullopt;
  for (const std::string& key : keys) {
    if (!reader.Has(key)) return std::nullopt;
    numbers.push_back(reader.Get(key).AsNumber());
  }
  return numbers;
}

// Returns all numbers of a value, those of the position before those of the rotation. Throws InputError for a mapping
// that does not identify them, because the order of its keys has no meaning.
std::vector<double> NumbersOf(const ConfigValue& value, const PoseFormat& format) {
  if (value.IsText()) return {value.AsNumber()};
  std::vector<double> numbers;
  const auto append = [&](const ConfigValue& part) {
    const std::vector<double> more = NumbersOf(part, format);
    numbers.insert(numbers.end(), more.begin(), more.end());
  };
  if (value.IsList()) {
    for (const ConfigValue& item : value.AsList()) append(item);
  }
  if (!value.IsMap()) return numbers;
  if (const std::optional<std::vector<double>> axes = NumbersOfAxes(value, format)) return *axes;
  // A file may contain a time or a name beside the pose.
  for (const char* const name : {"pose", "transform", "matrix", "base_from_gripper", "tcp", "T"}) {
    MapReader reader(value);
    if (value.node().size() > 1 && reader.Has(name)) return NumbersOf(reader.Get(name), format);
  }
  std::vector<ConfigValue> entries;
  std::vector<bool> are_places;
  for (const auto& entry : value.node()) {
    const std::string key = entry.first.Scalar();
    entries.emplace_back(entry.second, value.file(), key);
    are_places.push_back(key.starts_with("pos") || key.starts_with("trans") || key.starts_with("place") || key == "t" ||
                         key == "xyz");
  }
  const bool are_told = entries.size() == 2 && are_places[0] != are_places[1];
  if (entries.size() != 1 && !are_told) {
    value.Fail("these numbers cannot be identified; either the keys " + Join(format.columns, ", ") +
               " are needed, or position and orientation, or a list");
  }
  // The position comes first. (YAML::Nodes must not be swapped, because copies of a node share its data.)
  const size_t first = are_told && are_places[1] ? 1 : 0;
  for (size_t i = 0; i < entries.size(); ++i) append(entries[(first + i) % entries.size()]);
  return numbers;
}

// Reads a table of one row, or a text of numbers only.
std::vector<double> NumbersOfText(const fs::path& file, const PoseFormat& format) {
  const std::string text = ReadTextFile(file);
  const std::vector<TextLine> lines = LinesOf(text);
  const bool names_columns =
      !lines.empty() && std::any_of(format.columns.begin(), format.columns.end(), [&](const std::string& column) {
        const std::vector<std::string> names = Split(lines.front().text, ',');
        return std::find(names.begin(), names.end(), column) != names.end();
      });
  if (!names_columns) return InOrder(format, NumbersOfFile(file));
  const std::vector<PoseRow> rows = ParsePoses(text, file, format);
  if (rows.size() != 1)
    throw InputError(file.string() + ": contains " + std::to_string(rows.size()) + " poses, not one");
  return rows.front().numbers;
}

PoseRow ReadOnePose(const fs::path& file, const PoseFormat& format) {
  const std::string suffix = SuffixOf(file);
  std::vector<double> numbers;
  if (suffix == ".npy") {
    numbers = InOrder(format, ReadNpyFile(file).numbers);
  } else if (IsYaml(suffix)) {
    numbers = PoseNumbersOfYaml(file, format);
  } else {
    numbers = NumbersOfText(file, format);
  }
  PoseRow row = RowOf(format, std::move(numbers), file.string());
  row.image = file.stem().string();
  return row;
}

std::vector<PoseRow> ReadPoseArray(const fs::path& file, const PoseFormat& format) {
  const NumberArray array = ReadNpyFile(file);
  // An array may contain the ignored columns or omit them.
  const bool has_all = array.shape.size() == 2 && array.shape[1] == format.file_columns.size();
  const size_t num_columns = has_all ? format.file_columns.size() : format.columns.size();
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
    rows.push_back(RowOf(format, InOrder(format, {first, first + static_cast<std::ptrdiff_t>(num_columns)}),
                         file.string() + ": row " + std::to_string(i + 1)));
  }
  return rows;
}

// Reads poses from anything but records and programs.
std::vector<PoseRow> ReadPlainPoses(const fs::path& path, const PoseFormat& format,
                                    const std::vector<std::string>& cameras) {
  std::error_code error;
  if (!fs::is_directory(path, error)) {
    return SuffixOf(path) == ".npy" ? ReadPoseArray(path, format) : ReadPoseFile(path, format, {}, cameras);
  }
  std::vector<PoseRow> rows;
  for (const fs::path& file : PoseFilesOf(path)) rows.push_back(ReadOnePose(file, format));
  if (rows.empty()) {
    throw InputError(path.string() +
                     ": the folder contains no poses; it needs files with a number in their names, .txt, .csv, .yaml, "
                     ".json or .npy");
  }
  return rows;
}

// Returns whether a place has the numbers of the format, under its names if they have any.
bool HasNumbersOf(const PoseRecords& place, const PoseFormat& format) {
  return place.rows.front().size() == format.columns.size() &&
         (place.columns.empty() || place.columns == format.columns);
}

// Returns the poses in the records or in the robot's program of a source that could not be read otherwise; none if it
// is no such source. A fault of its own, such as a pose that breaks off, is reported in place of the other one. An
// array has one place only, so that the fault of its shape says more.
std::vector<PoseRecords> RecordsInstead(const fs::path& path, const PoseFormat& format) {
  std::error_code error;
  if (!fs::exists(path, error)) return {};
  std::vector<PoseRecords> places = FindPoseRecords(path, 1);
  const bool has_any =
      std::any_of(places.begin(), places.end(), [&](const PoseRecords& place) { return HasNumbersOf(place, format); });
  if (SuffixOf(path) == ".npy" && !has_any) return {};
  return places;
}

// Returns the places of records as "records[].a (7 numbers), records[].b (16 numbers)", or what a program writes as
// "poses of the format ur (6 numbers)".
std::string PlacesText(const std::vector<PoseRecords>& places) {
  std::vector<std::string> texts;
  for (const PoseRecords& place : places) {
    const std::string kind = place.pose_format.empty() ? "poses" : "poses of the format " + place.pose_format;
    const std::string names = place.columns.empty() ? "" : ": " + Join(place.columns, ", ");
    texts.push_back((place.paths.pose.empty() ? kind : place.paths.pose) + " (" +
                    std::to_string(place.rows.front().size()) + " numbers" + names + ")");
  }
  return Join(texts, ", ");
}

// Returns the place that `paths` names, or else the only one whose poses have as many numbers as the format.
const PoseRecords& ChoosePlace(const std::vector<PoseRecords>& places, const fs::path& path, const PoseFormat& format,
                               const RecordPaths& paths) {
  if (!paths.pose.empty()) {
    const auto named = std::find_if(places.begin(), places.end(),
                                    [&](const PoseRecords& place) { return place.paths.pose == paths.pose; });
    if (named != places.end()) return *named;
    throw InputError(path.string() + ": there are no poses at " + Quoted(paths.pose) +
                     (places.empty() ? "" : "; poses are at " + PlacesText(places)));
  }
  std::vector<PoseRecords> fitting;
  const PoseRecords* chosen = nullptr;
  for (const PoseRecords& place : places) {
    if (!HasNumbersOf(place, format)) continue;
    fitting.push_back(place);
    chosen = &place;
  }
  if (fitting.size() == 1) return *chosen;
  if (fitting.empty()) {
    throw InputError(path.string() + ": no poses of " + std::to_string(format.columns.size()) + " numbers (" +
                     Join(format.columns, ", ") + ") are in it, but " + PlacesText(places) + "; set pose_format");
  }
  throw InputError(path.string() + ": poses are at " + PlacesText(fitting) +
                   "; name one of them: poses: {file: ..., pose: " + fitting.front().paths.pose + "}");
}

std::vector<PoseRow> RowsOfRecords(const std::vector<PoseRecords>& places, const fs::path& path,
                                   const PoseFormat& format, const RecordPaths& paths) {
  const PoseRecords& place = ChoosePlace(places, path, format, paths);
  if (!paths.image.empty() && paths.image != place.paths.image) {
    throw InputError(path.string() + ": the images of " + Quoted(place.paths.pose) + " are not named at " +
                     Quoted(paths.image) +
                     (place.paths.image.empty() ? "; leave it out: the images are paired in their order"
                                                : ", but at " + Quoted(place.paths.image)));
  }
  std::vector<PoseRow> rows;
  for (size_t i = 0; i < place.rows.size(); ++i) {
    const std::string where = path.string() + (place.lines.empty() ? ": pose " + std::to_string(i + 1)
                                                                   : ":" + std::to_string(place.lines[i]));
    rows.push_back(RowOf(format, InOrder(format, place.rows[i]), where));
    if (!place.images.empty()) rows.back().image = place.images[i];
    if (!place.lines.empty()) rows.back().line = place.lines[i];
  }
  return rows;
}

}  // namespace

std::vector<double> PoseNumbersOfYaml(const fs::path& file, const PoseFormat& format) {
  const std::string text = ReadTextFile(file);
  if (text.starts_with("%YAML:")) {
    for (auto& [name, numbers] : FileStorageNumbers(file)) {
      if (numbers.size() == format.columns.size()) return numbers;
    }
    throw InputError(file.string() + ": contains no matrix of " + std::to_string(format.columns.size()) + " numbers");
  }
  const ConfigValue value = ParseYaml(text, file);
  if (value.IsMap()) {
    MapReader reader(value);
    const bool has_all = std::all_of(format.columns.begin(), format.columns.end(),
                                     [&](const std::string& column) { return reader.Has(column); });
    if (has_all) {
      std::vector<double> numbers;
      for (const std::string& column : format.columns) numbers.push_back(reader.Get(column).AsNumber());
      return numbers;
    }
  }
  const std::vector<double> numbers = NumbersOf(value, format);
  return value.IsList() ? InOrder(format, numbers) : numbers;
}

std::vector<PoseRow> ReadPoses(const fs::path& path, const PoseFormat& format, const std::vector<std::string>& cameras,
                               const RecordPaths& paths) {
  if (!paths.pose.empty()) return RowsOfRecords(FindPoseRecords(path, 1), path, format, paths);
  try {
    return ReadPlainPoses(path, format, cameras);
  } catch (const InputError&) {
    const std::vector<PoseRecords> places = RecordsInstead(path, format);
    if (places.empty()) throw;
    return RowsOfRecords(places, path, format, paths);
  }
}

}  // namespace heba
