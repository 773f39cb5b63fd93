#include "tools/pose_guess.h"

#include <algorithm>
#include <cmath>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/io/import_text.h"
#include "heba/io/npy_file.h"
#include "heba/io/pose_source.h"
#include "tools/run_config.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

// The fields of some poses, a row each, and the names that the file gives to its columns, if it does.
struct RawTable {
  std::vector<std::string> names;
  std::vector<std::vector<std::string>> rows;
};

constexpr size_t kMostRows = 1000;

bool IsNumber(const std::string& field) {
  double number = 0;
  return ParseDouble(field, &number);
}

std::vector<std::string> FieldsOf(std::string line) {
  line = WithoutBrackets(line);
  std::replace(line.begin(), line.end(), '"', ' ');
  constexpr std::string_view kBetween = " \t\r,;";
  std::vector<std::string> fields;
  size_t at = line.find_first_not_of(kBetween);
  while (at != std::string::npos) {
    const size_t end = std::min(line.find_first_of(kBetween, at), line.size());
    fields.push_back(line.substr(at, end - at));
    at = line.find_first_not_of(kBetween, end);
  }
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

// One file a pose: its numbers in their order, whatever stands around them.
RawTable TableOfFolder(const fs::path& folder) {
  RawTable table;
  for (const fs::path& file : PoseFilesOf(folder)) {
    if (table.rows.size() == kMostRows) break;
    RawTable one = file.extension() == ".npy" ? TableOfArray(file) : TableOfText(file);
    std::vector<std::string> numbers;
    for (const std::vector<std::string>& row : one.rows) {
      std::copy_if(row.begin(), row.end(), std::back_inserter(numbers), IsNumber);
    }
    table.rows.push_back(std::move(numbers));
  }
  return table;
}

RawTable ReadRawTable(const fs::path& poses) {
  std::error_code error;
  if (fs::is_directory(poses, error)) return TableOfFolder(poses);
  return poses.extension() == ".npy" ? TableOfArray(poses) : TableOfText(poses);
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

// Whether the four columns from `first` on are of length 1 together.
bool IsQuaternion(const RawTable& table, const std::vector<size_t>& columns, size_t first) {
  Eigen::Vector4d q;
  for (size_t i = 0; i < table.rows.size(); ++i) {
    for (size_t k = 0; k < 4; ++k) ParseDouble(table.rows[i][columns[first + k]], &q[static_cast<Eigen::Index>(k)]);
    constexpr double kRounded = 0.02;
    if (!(std::abs(q.norm() - 1) < kRounded)) return false;
  }
  return true;
}

// How many of the numbers at the front are an index or a time: what is left are 6, 7, 12 or 16; nothing if it is not.
std::optional<size_t> NumbersBeforeThePose(const RawTable& table, const std::vector<size_t>& columns) {
  constexpr size_t kEuler = 6;
  constexpr size_t kQuaternion = 7;
  const auto is_pose = [&](size_t first) {
    const size_t count = columns.size() - first;
    if (count == kQuaternion) return IsQuaternion(table, columns, first + 3);
    return count == kEuler || count == 12 || count == 16;
  };
  for (const size_t first : {0, 1}) {
    if (columns.size() > first && is_pose(first)) return first;
  }
  return std::nullopt;
}

void GuessUnits(const RawTable& table, const std::vector<size_t>& columns, PoseFormat* format) {
  // No arm reaches 20 m, few places are within 20 mm of the base.
  constexpr double kLongestInMetres = 20;
  constexpr size_t kEuler = 6;
  const bool is_whole_matrix = columns.size() == 16;
  double longest = LargestOf(table, columns, 0, 3);
  if (is_whole_matrix) longest = std::max({LargestOf(table, columns, 3, 4), LargestOf(table, columns, 7, 8)});
  format->translation_unit = longest > kLongestInMetres ? "mm" : "m";
  if (columns.size() == kEuler) {
    const bool is_deg = LargestOf(table, columns, 3, kEuler) > 2 * M_PI + 0.01;
    format->rotation = is_deg ? "euler_zyx" : "rotation_vector";
    format->angle_unit = is_deg ? "deg" : "rad";
  } else {
    format->rotation = columns.size() == 7 ? "quaternion_xyzw" : "matrix";
  }
}

// A pose file's own faults are the caller's to report.
std::optional<RunConfig> ReadWith(const fs::path& config, std::vector<std::string> settings, const PoseFormat& format) {
  settings.push_back(PoseFormatSetting(format));
  try {
    return ReadRunConfig(config, settings);
  } catch (const InputError&) {
    return std::nullopt;
  }
}

}  // namespace

std::optional<PoseFormat> GuessPoseFormat(const fs::path& poses) {
  RawTable table;
  try {
    table = ReadRawTable(poses);
  } catch (const InputError&) {
    return std::nullopt;
  }
  constexpr size_t kFewestRows = 3;
  if (table.rows.size() < kFewestRows) return std::nullopt;
  const size_t width = table.rows.front().size();
  const bool is_even = std::all_of(table.rows.begin(), table.rows.end(),
                                   [&](const std::vector<std::string>& row) { return row.size() == width; });
  if (!is_even || (!table.names.empty() && table.names.size() != width)) return std::nullopt;
  std::vector<size_t> numeric;
  std::optional<size_t> image;
  for (size_t column = 0; column < width; ++column) {
    const auto all = [&](const auto& is) {
      return std::all_of(table.rows.begin(), table.rows.end(), [&](const auto& row) { return is(row[column]); });
    };
    if (all(IsNumber)) numeric.push_back(column);
    if (!image && all([](const std::string& field) { return HasImageSuffix(field); })) image = column;
  }
  const std::optional<size_t> before = NumbersBeforeThePose(table, numeric);
  if (!before) return std::nullopt;
  numeric.erase(numeric.begin(), numeric.begin() + static_cast<std::ptrdiff_t>(*before));
  PoseFormat format;
  for (size_t column = 0; column < width; ++column) {
    const auto place = std::find(numeric.begin(), numeric.end(), column);
    if (place != numeric.end()) {
      const auto number = static_cast<size_t>(place - numeric.begin());
      const std::string made_up =
          number < 3 && numeric.size() != 16 ? std::string(1, "xyz"[number]) : "r" + std::to_string(number + 1);
      format.columns.push_back(table.names.empty() ? made_up : table.names[column]);
      format.file_columns.push_back(format.columns.back());
    } else {
      format.file_columns.emplace_back(image == column ? kImageColumn : kNoColumn);
    }
  }
  GuessUnits(table, numeric, &format);
  return format;
}

std::string PoseFormatSetting(const PoseFormat& format) { return "captures.pose_format=" + PoseFormatText(format); }

std::optional<GuessedReading> GuessReading(const fs::path& config, const std::vector<std::string>& settings,
                                           int num_threads, Verbosity verbosity) {
  std::optional<PoseFormat> format;
  try {
    const ConfigValue file = ReadYamlFileOverBases(config, {"name", "output"});
    MapReader reader(settings.empty() ? file : ConfigValue::Stack({ParseSettings(settings), file}));
    MapReader captures(reader.Get("captures"));
    if (!captures.Has("poses")) return std::nullopt;
    format = GuessPoseFormat(captures.Path("poses"));
  } catch (const InputError&) {
    return std::nullopt;
  }
  if (!format) return std::nullopt;
  GuessedReading guessed;
  guessed.format = *format;
  // The pictures say what the numbers' sizes do not; with that, the other checks see the poses as they are.
  for (int round = 0; round < 2; ++round) {
    const std::optional<RunConfig> read = ReadWith(config, settings, guessed.format);
    if (!read) return std::nullopt;
    guessed.diagnosis = Diagnose(*read, num_threads, verbosity);
    const std::optional<PoseFit>& fit = guessed.diagnosis.pose_fit;
    guessed.fits = fit && std::none_of(guessed.diagnosis.symptoms.begin(), guessed.diagnosis.symptoms.end(),
                                       [](const Symptom& symptom) { return symptom.code == "poses_unexplained"; });
    if (!fit || PoseFormatText(fit->format) == PoseFormatText(guessed.format)) break;
    guessed.format = fit->format;
  }
  return guessed;
}

std::string ReadingInWords(const PoseFormat& format) {
  return std::to_string(format.columns.size()) + " numbers a pose: " +
         (format.columns.size() == 16 ? "a 4 x 4 matrix row by row, in " + format.translation_unit
                                      : "x, y, z in " + format.translation_unit + " and " + format.rotation +
                                            (format.angle_unit.empty() ? "" : " in " + format.angle_unit));
}

}  // namespace heba
