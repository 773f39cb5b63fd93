#include "heba/io/import_text.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/io/camera_format.h"
#include "heba/io/file_storage.h"
#include "heba/io/pose_formats.h"

namespace heba {
namespace fs = std::filesystem;

namespace {

std::map<int, fs::path> NumberedFilesOfKind(const fs::path& folder, std::string_view prefix, std::string_view suffix) {
  std::map<int, fs::path> files;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (name.size() <= prefix.size() + suffix.size() || !name.starts_with(prefix) || !name.ends_with(suffix)) continue;
    const std::string digits = name.substr(prefix.size(), name.size() - prefix.size() - suffix.size());
    constexpr size_t kMostDigits = 9;
    if (digits.size() > kMostDigits || digits.find_first_not_of("0123456789") != std::string::npos) continue;
    if (!entry.is_regular_file(error)) continue;
    const auto [other, is_new] = files.emplace(std::stoi(digits), entry.path());
    if (!is_new) {
      throw InputError(entry.path().string() + ": has the same number as " + other->second.filename().string());
    }
  }
  return files;
}

}  // namespace

std::vector<double> NumbersOfLine(std::string_view text, const fs::path& name, int line) {
  constexpr std::string_view kBetween = " \t\r,;";
  std::vector<double> numbers;
  size_t at = text.find_first_not_of(kBetween);
  while (at != std::string_view::npos) {
    const size_t end = std::min(text.find_first_of(kBetween, at), text.size());
    double number = 0;
    const std::string_view field = text.substr(at, end - at);
    if (!ParseDouble(field, &number) || !std::isfinite(number)) {
      throw InputError(name.string() + ":" + std::to_string(line) + ": " + Quoted(field) + " is not a finite number");
    }
    numbers.push_back(number);
    at = text.find_first_not_of(kBetween, end);
  }
  return numbers;
}

std::vector<TextLine> LinesOf(const std::string& text) {
  std::vector<TextLine> lines;
  int number = 0;
  for (const std::string& line : Split(text, '\n')) {
    ++number;
    const std::string trimmed = Trim(line.substr(0, line.find('#')));
    if (!trimmed.empty()) lines.push_back({trimmed, number});
  }
  return lines;
}

std::vector<double> NumbersOfFile(const fs::path& file) {
  std::vector<double> numbers;
  for (const TextLine& line : LinesOf(ReadTextFile(file))) {
    for (const double number : NumbersOfLine(line.text, file, line.number)) numbers.push_back(number);
  }
  return numbers;
}

size_t NumbersInFirstLine(const fs::path& file) {
  const std::vector<TextLine> lines = LinesOf(BeginningOf(file));
  if (lines.empty()) return 0;
  try {
    return NumbersOfLine(lines.front().text, file, lines.front().number).size();
  } catch (const InputError&) {
    return 0;
  }
}

std::vector<double> FlatNumbers(const ConfigValue& value) {
  std::vector<double> numbers;
  for (const ConfigValue& item : value.AsList()) {
    for (const ConfigValue& number : item.IsList() ? item.AsList() : std::vector<ConfigValue>{item}) {
      numbers.push_back(number.AsNumber());
    }
  }
  return numbers;
}

Rigid3d PoseOf(std::string_view format, std::span<const double> numbers, const std::string& where) {
  const PoseFormat* known = FindPoseFormat(format);
  CHECK(known != nullptr) << format;
  if (numbers.size() != known->columns.size()) {
    throw InputError(where + ": " + std::to_string(numbers.size()) + " numbers; a pose has " +
                     std::to_string(known->columns.size()) + ": " + Join(known->columns, ", "));
  }
  const Outcome<Rigid3d> pose = PoseFromNumbers(*known, numbers);
  if (!pose) throw InputError(where + ": " + pose.reason());
  return *pose;
}

Rigid3d PoseOfMatrix(std::span<const double> numbers, double m_per_unit, const std::string& where) {
  Rigid3d pose = PoseOf("matrix", numbers, where);
  pose.translation *= m_per_unit;
  return pose;
}

Rigid3d PoseOfMap(const ConfigValue& value) {
  MapReader reader(value);
  std::vector<double> numbers;
  for (const char* key : {"x", "y", "z", "qx", "qy", "qz", "qw"}) numbers.push_back(reader.Number(key));
  const Outcome<Rigid3d> pose = PoseFromNumbers(*FindPoseFormat("ros"), numbers);
  if (!pose) value.Fail(pose.reason());
  return *pose;
}

Rigid3d PoseOfTransform(const ConfigValue& value) {
  MapReader reader(value);
  MapReader translation(reader.Get("translation"));
  MapReader rotation(reader.Get("rotation"));
  std::vector<double> numbers;
  for (const char* key : {"x", "y", "z"}) numbers.push_back(translation.Number(key));
  for (const char* key : {"x", "y", "z", "w"}) numbers.push_back(rotation.Number(key));
  const Outcome<Rigid3d> pose = PoseFromNumbers(*FindPoseFormat("ros"), numbers);
  if (!pose) value.Fail(pose.reason());
  return *pose;
}

std::map<std::string, std::vector<double>> FileStorageNumbers(const fs::path& path) {
  const ConfigValue root = ParseFileStorage(ReadTextFile(path), path);
  const MapReader checked(root);  // Checks that the file is a mapping without duplicate keys.
  std::map<std::string, std::vector<double>> found;
  for (const auto& entry : root.node()) {
    const std::string key = entry.first.Scalar();
    const ConfigValue value(entry.second, path, key);
    if (value.IsMap() || value.IsList()) {
      found[key] = ReadMatrix(value);
    } else if (value.IsText()) {
      double number = 0;
      if (ParseDouble(entry.second.Scalar(), &number)) found[key] = {number};
    }
  }
  return found;
}

std::map<int, fs::path> NumberedFiles(const fs::path& folder, std::initializer_list<std::string_view> prefixes,
                                      std::initializer_list<std::string_view> suffixes) {
  std::map<int, fs::path> files;
  for (const std::string_view prefix : prefixes) {
    for (const std::string_view suffix : suffixes) files.merge(NumberedFilesOfKind(folder, prefix, suffix));
  }
  return files;
}

std::vector<fs::path> ImagesOf(const fs::path& folder) {
  std::vector<fs::path> images;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (entry.is_regular_file(error) && HasImageSuffix(entry.path())) images.push_back(entry.path());
  }
  std::sort(images.begin(), images.end(), [](const fs::path& a, const fs::path& b) {
    return NaturalLess(a.filename().string(), b.filename().string());
  });
  return images;
}

Remarked<std::vector<fs::path>> ImagesForPoses(const std::vector<fs::path>& folders, size_t num_poses) {
  for (const fs::path& folder : folders) {
    std::vector<fs::path> images = ImagesOf(folder);
    if (images.size() == num_poses) return {std::move(images)};
    if (images.empty()) continue;
    return {{},
            {std::to_string(images.size()) + " images are beside the " + std::to_string(num_poses) +
             " poses; the file does not state which belong together"}};
  }
  return {};
}

ImportedCapture CaptureOf(const fs::path& image, size_t number) {
  ImportedCapture capture;
  capture.image = image;
  capture.name = image.empty() ? "pose_" + std::to_string(number) : image.filename().string();
  return capture;
}

ImportedCapture CaptureOf(const std::map<int, fs::path>& images, int number) {
  const auto found = images.find(number);
  return CaptureOf(found == images.end() ? fs::path() : found->second, static_cast<size_t>(number));
}

std::string BeginningOf(const fs::path& path) {
  constexpr size_t kEnough = 8192;
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return "";
  std::ifstream stream(path, std::ios::binary);
  std::string text(kEnough, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<size_t>(std::max<std::streamsize>(0, stream.gcount())));
  return text;
}

std::string ChessboardYaml(int rows, int columns, double square_m) {
  return "type: chessboard\nrows: " + std::to_string(rows) + "\ncolumns: " + std::to_string(columns) +
         "\nsquare: " + RoundTrip(square_m) + " m\n";
}

}  // namespace heba
