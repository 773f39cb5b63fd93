#include "tools/doctor/pose_guess.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/io/import_text.h"
#include "heba/io/npy_file.h"
#include "heba/io/pose_folder.h"
#include "heba/io/pose_source.h"
#include "tools/config/capture_section.h"
#include "tools/config/run_config.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

// The fields of some poses, one row each, the file's names of its columns, if it has any, and where they are in it.
struct RawTable {
  std::vector<std::string> names;
  std::vector<std::vector<std::string>> rows;
  RecordPaths paths = {};
  std::string pose_format = {};  // The format of the program that wrote the poses, if it is known.
};

constexpr size_t kMostRows = 1000;

bool IsNumber(const std::string& field) {
  double number = 0;
  return ParseDouble(field, &number);
}

// Splits a line at tabs, semicolons or commas, between which fields may contain blanks, or otherwise at blanks. Numbers
// between other separators than commas may have decimal commas.
std::vector<std::string> FieldsOf(std::string line) {
  line = WithoutBrackets(line);
  std::replace(line.begin(), line.end(), '"', ' ');
  const auto fields_between = [&](std::string_view separators) {
    std::vector<std::string> fields;
    size_t at = line.find_first_not_of(separators);
    while (at != std::string::npos) {
      const size_t end = std::min(line.find_first_of(separators, at), line.size());
      fields.push_back(line.substr(at, end - at));
      at = line.find_first_not_of(separators, end);
    }
    return fields;
  };
  const std::vector<std::string> words = fields_between(" \t\r");
  const bool are_decimals = words.size() >= 3 && std::all_of(words.begin(), words.end(), [](const std::string& word) {
                              return WithDecimalPoint(word) != word;
                            });
  for (const char separator : {'\t', ';', ','}) {
    if (are_decimals && separator == ',') break;
    if (line.find(separator) == std::string::npos) continue;
    std::vector<std::string> fields;
    for (const std::string& field : Split(line, separator)) {
      fields.push_back(separator == ',' ? Trim(field) : WithDecimalPoint(Trim(field)));
    }
    const bool are_whole = std::all_of(fields.begin(), fields.end(), [](const std::string& field) {
      return field.find_first_of(";,\t") == std::string::npos && !field.empty();
    });
    if (are_whole) return fields;
  }
  if (!are_decimals) return fields_between(" \t\r,;");
  std::vector<std::string> fields;
  for (const std::string& word : words) fields.push_back(WithDecimalPoint(word));
  return fields;
}

RawTable TableOfText(const fs::path& file) {
  RawTable table;
  for (const TextLine& line : LinesOf(ReadTextFile(file))) {
    if (table.rows.size() == kMostRows) break;
    std::vector<std::string> fields = FieldsOf(line.text);
    const auto num_numbers = std::count_if(fields.begin(), fields.end(), IsNumber);
    constexpr int kNumbersOfAPlace = 3;
    if (table.names.empty() && table.rows.empty() && num_numbers < kNumbersOfAPlace) {
      table.names = std::move(fields);
    } else {
      table.rows.push_back(std::move(fields));
    }
  }
  return table;
}

RawTable TableOfArray(const fs::path& file) {
  const NumberArray array = ReadNpyFile(file);
  RawTable table;
  const size_t width = array.shape.empty() ? 1 : array.numbers.size() / array.shape[0];
  for (size_t i = 0; i + width <= array.numbers.size() && table.rows.size() < kMostRows; i += width) {
    table.rows.emplace_back();
    for (size_t j = 0; j < width; ++j) table.rows.back().push_back(RoundTrip(array.numbers[i + j]));
  }
  return table;
}

// Returns the numbers of a file in their order, regardless of the text between them.
std::vector<std::string> NumbersIn(const fs::path& file) {
  std::vector<std::string> numbers;
  if (file.extension() == ".npy") {
    for (const double number : ReadNpyFile(file).numbers) numbers.push_back(RoundTrip(number));
    return numbers;
  }
  const std::string suffix = file.extension().string();
  if (suffix == ".json" || suffix == ".yaml" || suffix == ".yml") {
    try {
      for (const double number : PoseNumbersOfYaml(file, *FindPoseFormat("ros"))) numbers.push_back(RoundTrip(number));
      return numbers;
    } catch (const InputError&) {
      numbers.clear();  // The keys are unknown, so the numbers are read in the order of the text.
    }
  }
  for (const TextLine& line : LinesOf(ReadTextFile(file))) {
    std::string text = line.text;
    constexpr std::string_view kMarks = "[](){}:,;\"'";
    std::replace_if(
        text.begin(), text.end(), [&](char c) { return kMarks.find(c) != std::string_view::npos; }, ' ');
    for (const std::string& field : FieldsOf(text)) {
      if (IsNumber(field)) numbers.push_back(field);
    }
  }
  return numbers;
}

// Reads a folder with one file per pose.
RawTable TableOfFolder(const fs::path& folder) {
  RawTable table;
  for (const fs::path& file : PoseFilesOf(folder)) {
    if (table.rows.size() == kMostRows) break;
    table.rows.push_back(NumbersIn(file));
  }
  return table;
}

RawTable ReadRawTable(const fs::path& poses) {
  std::error_code error;
  if (fs::is_directory(poses, error)) return TableOfFolder(poses);
  return poses.extension() == ".npy" ? TableOfArray(poses) : TableOfText(poses);
}

// Returns what the file itself is, a table or a folder of plain files, and what its records are.
std::vector<RawTable> ReadRawTables(const fs::path& poses) {
  std::vector<RawTable> tables;
  try {
    tables.push_back(ReadRawTable(poses));
  } catch (const InputError&) {
    // It may hold records.
  }
  try {
    for (const PoseRecords& place : FindPoseRecords(poses)) {
      RawTable table{place.columns, {}, place.paths, place.pose_format};
      for (const std::vector<double>& numbers : place.rows) {
        if (table.rows.size() == kMostRows) break;
        table.rows.emplace_back();
        for (const double number : numbers) table.rows.back().push_back(RoundTrip(number));
      }
      tables.push_back(std::move(table));
    }
  } catch (const InputError&) {
    // It holds none that can be read.
  }
  return tables;
}

std::vector<double> NumbersOf(const RawTable& table, size_t column) {
  std::vector<double> numbers;
  for (const std::vector<std::string>& row : table.rows) {
    double number = 0;
    ParseDouble(row[column], &number);
    numbers.push_back(number);
  }
  return numbers;
}

double LargestOf(const RawTable& table, const std::vector<size_t>& columns, size_t first, size_t last) {
  double largest = 0;
  for (size_t i = first; i < last; ++i) {
    for (const double number : NumbersOf(table, columns[i])) largest = std::max(largest, std::abs(number));
  }
  return largest;
}

// Returns whether the four columns from `first` on form vectors of length 1.
bool IsQuaternion(const RawTable& table, const std::vector<size_t>& columns, size_t first) {
  Eigen::Vector4d q;
  for (size_t i = 0; i < table.rows.size(); ++i) {
    for (size_t k = 0; k < 4; ++k) ParseDouble(table.rows[i][columns[first + k]], &q[static_cast<Eigen::Index>(k)]);
    constexpr double kRounded = 0.02;
    if (!(std::abs(q.norm() - 1) < kRounded)) return false;
  }
  return true;
}

// Returns whether nine columns form a rotation matrix, stored by rows.
bool IsRotation(const RawTable& table, const std::vector<size_t>& columns, const std::array<size_t, 9>& places) {
  for (const std::vector<std::string>& row : table.rows) {
    Eigen::Matrix3d matrix;
    for (size_t k = 0; k < places.size(); ++k) {
      ParseDouble(row[columns[places[k]]], &matrix(static_cast<Eigen::Index>(k / 3), static_cast<Eigen::Index>(k % 3)));
    }
    constexpr double kRounded = 0.02;
    if (!((matrix.transpose() * matrix - Eigen::Matrix3d::Identity()).norm() < kRounded)) return false;
  }
  return true;
}

// Returns the columns in the order of a pose, x, y, z first, for every order that the numbers allow, the most likely
// first.
std::vector<std::vector<size_t>> OrdersOf(const RawTable& table, const std::vector<size_t>& columns) {
  const auto picked = [&](const std::vector<size_t>& places) {
    std::vector<size_t> order;
    for (const size_t place : places) order.push_back(columns[place]);
    return order;
  };
  switch (columns.size()) {
    case 6: {
      std::vector<std::vector<size_t>> orders = {columns, picked({3, 4, 5, 0, 1, 2})};
      // No controller reports an angle beyond a full turn.
      constexpr double kFullTurnDeg = 360.5;
      std::erase_if(orders,
                    [&](const std::vector<size_t>& order) { return LargestOf(table, order, 3, 6) > kFullTurnDeg; });
      return orders;
    }
    case 7:
      if (IsQuaternion(table, columns, 3)) return {columns};
      if (IsQuaternion(table, columns, 0)) return {picked({4, 5, 6, 0, 1, 2, 3})};
      return {};
    case 12:
      if (IsRotation(table, columns, {3, 4, 5, 6, 7, 8, 9, 10, 11})) return {columns};
      // These are the upper three rows of a 4 x 4 matrix.
      if (IsRotation(table, columns, {0, 1, 2, 4, 5, 6, 8, 9, 10})) {
        return {picked({3, 7, 11, 0, 1, 2, 4, 5, 6, 8, 9, 10})};
      }
      return {};
    case 16:
      return {columns};
    default:
      return {};
  }
}

// Returns the columns with those that the header names x, y and z first; nothing if it does not name them.
std::optional<std::vector<size_t>> OrderByNames(const RawTable& table, const std::vector<size_t>& columns) {
  if (table.names.empty() || columns.size() == 16) return std::nullopt;
  std::vector<size_t> order;
  for (const char* const axis : {"x", "y", "z"}) {
    const auto found = std::find_if(columns.begin(), columns.end(), [&](size_t column) {
      // ROS names the fields of messages as field.pose.position.x.
      const std::string& name = table.names[column];
      return BareColumnName(name.substr(name.find_last_of("./") + 1)) == axis;
    });
    if (found == columns.end()) return std::nullopt;
    order.push_back(*found);
  }
  for (const size_t column : columns) {
    if (std::find(order.begin(), order.end(), column) == order.end()) order.push_back(column);
  }
  return order;
}

bool NamesJoints(const RawTable& table) {
  return std::any_of(table.names.begin(), table.names.end(), [](const std::string& name) {
    const std::string bare = BareColumnName(name);
    return bare.starts_with("joint") ||
           (bare.size() == 2 && (bare[0] == 'j' || bare[0] == 'q') && bare[1] >= '0' && bare[1] <= '9');
  });
}

// Returns a format with guessed units and rotation, without columns. `order`: the table's columns of the pose, x, y, z
// first.
PoseFormat GuessedUnits(const RawTable& table, const std::vector<size_t>& order) {
  PoseFormat format;
  // No arm reaches 20 m, and hardly any position is within 20 mm of the base.
  constexpr double kLongestInMetres = 20;
  constexpr size_t kEuler = 6;
  const bool is_whole_matrix = order.size() == 16;
  double longest = LargestOf(table, order, 0, 3);
  if (is_whole_matrix) {
    longest = std::max({LargestOf(table, order, 3, 4), LargestOf(table, order, 7, 8), LargestOf(table, order, 11, 12)});
  }
  format.translation_unit = longest > kLongestInMetres ? "mm" : "m";
  if (order.size() == kEuler) {
    const bool is_deg = LargestOf(table, order, 3, kEuler) > 2 * M_PI + 0.01;
    format.rotation = is_deg ? "euler_zyx" : "rotation_vector";
    format.angle_unit = is_deg ? "deg" : "rad";
  } else {
    format.rotation = order.size() == 7 ? "quaternion_xyzw" : "matrix";
  }
  return format;
}

PoseFormat FormatOf(const RawTable& table, const std::vector<size_t>& order, const std::optional<size_t>& image) {
  PoseFormat format = GuessedUnits(table, order);
  const size_t width = table.rows.front().size();
  const auto name_of = [&](size_t number) -> std::string {
    if (!table.names.empty()) return table.names[order[number]];
    return number < 3 && order.size() != 16 ? std::string(1, "xyz"[number]) : "r" + std::to_string(number + 1);
  };
  for (size_t number = 0; number < order.size(); ++number) format.columns.push_back(name_of(number));
  // The columns are listed in the file's order; ReadPoseFormat finds x, y and z by their names.
  for (size_t column = 0; column < width; ++column) {
    const auto place = std::find(order.begin(), order.end(), column);
    format.file_columns.push_back(place != order.end() ? name_of(static_cast<size_t>(place - order.begin()))
                                                       : std::string(image == column ? kImageColumn : kNoColumn));
  }
  return format;
}

// Reads the config with `format`, or returns nothing if that fails; the caller reports faults of the pose file.
std::optional<RunConfig> ReadWith(const fs::path& config, std::vector<std::string> settings, const PoseFormat& format) {
  settings.push_back(PoseFormatSetting(format));
  try {
    return ReadShortRunConfig(config, settings);
  } catch (const InputError&) {
    return std::nullopt;
  }
}

// Guesses the formats of one table.
GuessedTable GuessOf(const RawTable& table) {
  constexpr size_t kFewestRows = 3;
  if (table.rows.size() < kFewestRows || NamesJoints(table)) return {};
  const size_t width = table.rows.front().size();
  const bool is_even = std::all_of(table.rows.begin(), table.rows.end(),
                                   [&](const std::vector<std::string>& row) { return row.size() == width; });
  if (!is_even || (!table.names.empty() && table.names.size() != width)) return {};
  std::vector<size_t> numeric;
  std::optional<size_t> image;
  for (size_t column = 0; column < width; ++column) {
    const auto count_of = [&](const auto& is) {
      return static_cast<size_t>(
          std::count_if(table.rows.begin(), table.rows.end(), [&](const auto& row) { return is(row[column]); }));
    };
    const size_t num_numbers = count_of(IsNumber);
    if (num_numbers == table.rows.size()) numeric.push_back(column);
    // A column with mostly numbers has a misspelt one, which is a fault of its line.
    if (num_numbers < table.rows.size() && 2 * num_numbers > table.rows.size()) return {};
    const bool is_image = count_of([](const std::string& field) { return HasImageSuffix(field); }) == table.rows.size();
    if (!image && is_image) image = column;
  }
  if (!table.pose_format.empty()) return {{*FindPoseFormat(table.pose_format)}, table.rows.size()};
  // An index or times may precede the pose.
  for (const size_t before : {0, 1, 2, 3}) {
    if (numeric.size() <= before) break;
    const std::vector<size_t> columns(numeric.begin() + static_cast<std::ptrdiff_t>(before), numeric.end());
    std::vector<std::vector<size_t>> orders = OrdersOf(table, columns);
    if (orders.empty()) continue;
    const std::optional<std::vector<size_t>> named = OrderByNames(table, columns);
    if (named) orders = {*named};
    // The last six of many numbers are a pose only if the names say so.
    if (before > 1 && columns.size() == 6 && !named) continue;
    GuessedTable guessed{{}, table.rows.size()};
    for (const std::vector<size_t>& order : orders) guessed.formats.push_back(FormatOf(table, order, image));
    return guessed;
  }
  return {};
}

// Returns how little the place of some poses in a file sounds like poses of a robot: 0 if its name says so, 2 if it
// says that they are those of something else.
int OddnessOf(const std::string& place) {
  const std::string name = Lower(place);
  const auto names_any = [&](std::initializer_list<std::string_view> words) {
    return std::any_of(words.begin(), words.end(),
                       [&](std::string_view word) { return name.find(word) != std::string::npos; });
  };
  if (names_any({"robot", "gripper", "tcp", "flange", "hand", "tool", "end_eff", "eef", "ee_", "base"})) return 0;
  return names_any({"target", "board", "cam", "marker", "tag", "object", "rvec", "tvec"}) ? 2 : 1;
}

}  // namespace

std::vector<GuessedTable> GuessTables(const fs::path& poses) {
  std::vector<GuessedTable> tables;
  for (const RawTable& table : ReadRawTables(poses)) {
    GuessedTable guessed = GuessOf(table);
    if (guessed.formats.empty()) continue;
    guessed.paths = table.paths;
    tables.push_back(std::move(guessed));
  }
  std::stable_sort(tables.begin(), tables.end(), [](const GuessedTable& a, const GuessedTable& b) {
    return OddnessOf(a.paths.pose) < OddnessOf(b.paths.pose);
  });
  return tables;
}

GuessedTable GuessPoseFormats(const fs::path& poses, const std::string& place) {
  for (GuessedTable& table : GuessTables(poses)) {
    if (place.empty() || table.paths.pose == place) return std::move(table);
  }
  return {};
}

std::string PoseFormatSetting(const PoseFormat& format) { return "captures.pose_format=" + PoseFormatText(format); }

std::optional<GuessedReading> GuessReading(const fs::path& config, const std::vector<std::string>& settings,
                                           int num_threads, Verbosity verbosity, Examine examine) {
  std::vector<PoseFormat> formats;
  try {
    const ConfigValue file = ReadYamlFileOverBases(config, {"name", "output"});
    MapReader reader(settings.empty() ? file : ConfigValue::Stack({ParseSettings(settings), file}));
    MapReader captures(reader.Get("captures"));
    if (!captures.Has("poses")) return std::nullopt;
    const PoseSource source = ReadPoseSource(captures, "poses");
    formats = GuessPoseFormats(source.path, source.paths.pose).formats;
  } catch (const InputError&) {
    return std::nullopt;
  }
  std::optional<GuessedReading> first;
  for (const PoseFormat& format : formats) {
    GuessedReading guessed;
    guessed.format = format;
    // The images determine what the size of the numbers does not; the second round shows the other checks the correct
    // poses.
    for (int round = 0; round < 2; ++round) {
      const std::optional<RunConfig> read = ReadWith(config, settings, guessed.format);
      if (!read) return first;
      guessed.diagnosis = DiagnosePair(*read, num_threads, verbosity, examine);
      const std::optional<PoseFit>& fit = guessed.diagnosis.pose_fit;
      guessed.fits = fit && fit->fits;
      if (!fit || PoseFormatText(fit->format) == PoseFormatText(guessed.format)) break;
      guessed.format = fit->format;
    }
    if (guessed.fits) return guessed;
    if (!first) first = std::move(guessed);
  }
  return first;
}

std::string ReadingInWords(const PoseFormat& format) {
  return std::to_string(format.columns.size()) + " numbers per pose: " +
         (format.columns.size() == 16 ? "a 4 x 4 matrix row by row, in " + format.translation_unit
                                      : "x, y, z in " + format.translation_unit + " and " + format.rotation +
                                            (format.angle_unit.empty() ? "" : " in " + format.angle_unit));
}

}  // namespace heba
