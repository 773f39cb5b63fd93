// A. Tabb's RWHEC: robot_cali.txt (a count, then 4 x 4 matrices), calibration_object.txt (chess_mm_height,
// chess_mm_width, chess_height, chess_width: the sides of a square and the numbers of inner corners; later data sets
// contain only a line such as "tile size: 28.5 mm"), and images in images/camera0, in images or beside the poses. The
// matrices are the inverse of the usual ones, gripper_from_base, in the unit of the object (mm).
#include <cmath>
#include <map>

#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/io/import.h"
#include "heba/io/import_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

bool Matches(const fs::path& source) {
  std::error_code error;
  return fs::is_directory(source, error) && fs::exists(source / "robot_cali.txt", error);
}

// Returns the target file. It is empty, and a remark says so, if the file states only the size of the squares.
Remarked<std::string> TargetOf(const fs::path& file) {
  std::map<std::string, double> values;
  for (const TextLine& line : LinesOf(ReadTextFile(file))) {
    if (line.text.starts_with("tile size:")) {
      return {"", {"calibration_object.txt states '" + line.text + "', not the number of the chessboard's corners"}};
    }
    const size_t blank = line.text.find_first_of(" \t");
    if (blank == std::string::npos) continue;
    const std::vector<double> numbers = NumbersOfLine(line.text.substr(blank), file, line.number);
    if (numbers.size() == 1) values[line.text.substr(0, blank)] = numbers[0];
  }
  for (const char* key : {"chess_mm_height", "chess_mm_width", "chess_height", "chess_width"}) {
    if (values.count(key) == 0) throw InputError(file.string() + ": '" + key + "' is missing");
  }
  if (values["chess_mm_height"] != values["chess_mm_width"]) {
    throw InputError(file.string() +
                     ": chess_mm_height differs from chess_mm_width; a chessboard of squares is needed");
  }
  const auto count = [&](const char* key) {
    constexpr int kLeast = 2;
    constexpr int kMost = 1000;
    const double value = values[key];
    if (!(value >= kLeast && value <= kMost && value == std::floor(value))) {
      throw InputError(file.string() + ": " + key + ": a whole number from " + std::to_string(kLeast) + " to " +
                       std::to_string(kMost) + " is needed");
    }
    return static_cast<int>(value);
  };
  return {ChessboardYaml(count("chess_height"), count("chess_width"), 1e-3 * values["chess_mm_height"])};
}

ImportedSet Read(const fs::path& source) {
  ImportedSet set;
  const fs::path robot = source / "robot_cali.txt";
  set.files.push_back(robot);
  const std::vector<double> numbers = NumbersOfFile(robot);
  constexpr size_t kMatrix = 16;
  const bool has_count =
      numbers.size() % kMatrix == 1 && numbers[0] * kMatrix == static_cast<double>(numbers.size() - 1);
  if (!has_count) throw InputError(robot.string() + ": a count and as many 4 x 4 matrices are needed");
  const fs::path object = source / "calibration_object.txt";
  if (fs::exists(object)) {
    const auto [target, remarks] = TargetOf(object);
    set.target = target;
    set.remarks = remarks;
    set.files.push_back(object);
  }
  std::vector<fs::path> images = ImagesOf(source / "images" / "camera0");
  if (images.empty()) images = ImagesOf(source / "images");
  if (images.empty()) images = ImagesOf(source);
  const size_t num_poses = (numbers.size() - 1) / kMatrix;
  if (!images.empty() && images.size() != num_poses) {
    throw InputError(robot.string() + ": has " + std::to_string(num_poses) + " poses for " +
                     std::to_string(images.size()) + " images");
  }
  for (size_t i = 0; i < num_poses; ++i) {
    const std::span<const double> matrix(numbers.data() + 1 + kMatrix * i, kMatrix);
    ImportedCapture capture = CaptureOf(images.empty() ? fs::path() : images[i], i);
    capture.base_from_gripper =
        Inverse(PoseOfMatrix(matrix, 1e-3, robot.string() + ": matrix " + std::to_string(i + 1)));
    set.captures.push_back(std::move(capture));
  }
  set.setup = Setup::kEyeInHand;
  return set;
}

}  // namespace

ImportReader ImportReader_tabb() { return {Matches, Read}; }

}  // namespace heba
