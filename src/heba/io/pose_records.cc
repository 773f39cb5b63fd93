#include "heba/io/pose_records.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <string_view>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/io/pose_folder.h"
#include "heba/io/pose_syntax.h"
#include "heba/io/record_tree.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

constexpr int kDeepest = 8;
// The precision of numbers that were rounded to three decimals.
constexpr double kRounded = 0.02;

// The numbers of one pose, and the names of the numbers if they have any.
struct PoseValue {
  std::vector<double> numbers;
  std::vector<std::string> columns = {};
};

// Returns the numbers of a list that holds nothing else.
std::optional<std::vector<double>> NumbersOf(const RecordTree& list) {
  if (!list.is_array() || list.empty()) return std::nullopt;
  std::vector<double> numbers;
  for (const RecordTree& item : list) {
    if (!item.is_number()) return std::nullopt;
    numbers.push_back(item.get<double>());
  }
  return numbers;
}

// Returns the numbers of a matrix by rows; nothing unless it is a list of lists with `num_columns` numbers each.
std::optional<std::vector<double>> MatrixOf(const RecordTree& rows, size_t num_rows, size_t num_columns) {
  if (!rows.is_array() || rows.size() != num_rows) return std::nullopt;
  std::vector<double> numbers;
  for (const RecordTree& row : rows) {
    const std::optional<std::vector<double>> of_row = NumbersOf(row);
    if (!of_row || of_row->size() != num_columns) return std::nullopt;
    numbers.insert(numbers.end(), of_row->begin(), of_row->end());
  }
  return numbers;
}

// Returns whether nine numbers, `stride` apart by rows, are a rotation.
bool IsRotation(const std::vector<double>& numbers, size_t first, size_t stride) {
  for (size_t i = 0; i < 3; ++i) {
    for (size_t j = i; j < 3; ++j) {
      double product = 0;
      for (size_t k = 0; k < 3; ++k) product += numbers[first + i * stride + k] * numbers[first + j * stride + k];
      if (!(std::abs(product - (i == j ? 1.0 : 0.0)) < kRounded)) return false;
    }
  }
  return true;
}

// Returns 12 or 16 numbers as they are, or as a 4 x 4 matrix by rows if they are one in another order; nothing if they
// hold no rotation.
std::optional<std::vector<double>> AsMatrix(std::vector<double> numbers) {
  constexpr size_t kWhole = 16;
  const std::array<double, 4> last = {0, 0, 0, 1};
  if (numbers.size() == kWhole) {
    const auto is_last = [&](size_t first, size_t step) {
      for (size_t i = 0; i < last.size(); ++i) {
        if (!(std::abs(numbers[first + i * step] - last[i]) < 1e-6)) return false;
      }
      return true;
    };
    if (!IsRotation(numbers, 0, 4)) return std::nullopt;
    if (is_last(12, 1)) return numbers;
    if (!is_last(3, 4)) return std::nullopt;
    std::vector<double> transposed(kWhole);
    for (size_t i = 0; i < kWhole; ++i) transposed[4 * (i % 4) + i / 4] = numbers[i];
    return transposed;
  }
  if (IsRotation(numbers, 3, 3)) return numbers;
  if (!IsRotation(numbers, 0, 4)) return std::nullopt;
  numbers.insert(numbers.end(), last.begin(), last.end());
  return numbers;
}

// Returns the numbers of an object with these keys, in their order and in whichever case; nothing if it lacks one.
std::optional<std::vector<double>> Members(const RecordTree& object, const std::vector<std::string>& keys) {
  if (!object.is_object()) return std::nullopt;
  std::vector<double> numbers;
  for (const std::string& key : keys) {
    const auto found = std::find_if(object.items().begin(), object.items().end(),
                                    [&](const auto& item) { return Lower(item.key()) == key; });
    if (found == object.items().end() || !found.value().is_number()) return std::nullopt;
    numbers.push_back(found.value().get<double>());
  }
  return numbers;
}

const std::vector<std::string> kPlaceKeys = {"x", "y", "z"};
// The keys of rotations: quaternions, angles and rotation vectors.
const std::vector<std::vector<std::string>> kRotationKeys = {
    {"qx", "qy", "qz", "qw"}, {"x", "y", "z", "w"}, {"q1", "q2", "q3", "q4"},
    {"roll", "pitch", "yaw"}, {"rx", "ry", "rz"},   {"a", "b", "c"},
    {"w", "p", "r"},          {"o", "a", "t"},      {"x", "y", "z"}};

std::optional<std::vector<double>> PlaceOf(const RecordTree& value) {
  if (std::optional<std::vector<double>> members = Members(value, kPlaceKeys); members && value.size() == 3)
    return members;
  std::optional<std::vector<double>> numbers = NumbersOf(value);
  if (!numbers && value.is_array() && value.size() == 3) numbers = MatrixOf(value, 3, 1);
  return numbers && numbers->size() == 3 ? numbers : std::nullopt;
}

// Returns the numbers of a rotation: a matrix of 3 x 3, a quaternion, or three angles or a vector.
std::optional<PoseValue> RotationOf(const RecordTree& value) {
  if (value.is_object()) {
    for (const std::vector<std::string>& keys : kRotationKeys) {
      if (value.size() != keys.size()) continue;
      if (const auto members = Members(value, keys)) {
        const bool is_quaternion = keys.size() == 4;
        return PoseValue{*members, is_quaternion && keys[0] == "x" ? kRotationKeys[0]
                                   : keys == kPlaceKeys            ? kRotationKeys[4]
                                                                   : keys};
      }
    }
    return std::nullopt;
  }
  if (auto matrix = MatrixOf(value, 3, 3)) {
    if (IsRotation(*matrix, 0, 3)) return PoseValue{*matrix};
    return std::nullopt;
  }
  if (auto column = MatrixOf(value, 3, 1)) return PoseValue{*column};
  const std::optional<std::vector<double>> numbers = NumbersOf(value);
  if (!numbers) return std::nullopt;
  const bool is_matrix = numbers->size() == 9 && IsRotation(*numbers, 0, 3);
  if (numbers->size() == 3 || numbers->size() == 4 || is_matrix) return PoseValue{*numbers};
  return std::nullopt;
}

std::optional<PoseValue> Joined(const std::vector<double>& place, const PoseValue& rotation) {
  PoseValue pose{place};
  pose.numbers.insert(pose.numbers.end(), rotation.numbers.begin(), rotation.numbers.end());
  if (!rotation.columns.empty()) {
    pose.columns = kPlaceKeys;
    pose.columns.insert(pose.columns.end(), rotation.columns.begin(), rotation.columns.end());
  }
  return pose;
}

// Returns whether a key names a position, or a rotation.
bool NamesPlace(const std::string& key) {
  const std::string name = Lower(key);
  for (const std::string_view word : {"pos", "trans", "place", "xyz", "tvec", "point", "location"}) {
    if (name.find(word) != std::string::npos) return true;
  }
  return name == "t" || name == "p" || name.starts_with("t_") || name.ends_with("_t");
}
bool NamesRotation(const std::string& key) {
  const std::string name = Lower(key);
  for (const std::string_view word : {"rot", "quat", "orient", "euler", "rpy", "rvec", "angle", "axis"}) {
    if (name.find(word) != std::string::npos) return true;
  }
  return name == "r" || name == "q" || name.starts_with("r_") || name.ends_with("_r") || name.starts_with("q_");
}

// Returns the pose of an object that holds its numbers under their names, or a position and a rotation.
std::optional<PoseValue> PoseOfObject(const RecordTree& object) {
  if (const auto place = Members(object, kPlaceKeys)) {
    for (const std::vector<std::string>& keys : kRotationKeys) {
      if (keys[0] == "x") continue;
      if (const auto rotation = Members(object, keys)) return Joined(*place, {*rotation, keys});
    }
  }
  std::optional<std::vector<double>> place;
  std::optional<PoseValue> rotation;
  for (const auto& [key, value] : object.items()) {
    // A quaternion takes precedence over angles that stand beside it.
    if (!place && NamesPlace(key) && !NamesRotation(key)) place = PlaceOf(value);
    if (!NamesRotation(key)) continue;
    const std::optional<PoseValue> found = RotationOf(value);
    if (found && (!rotation || found->numbers.size() > rotation->numbers.size())) rotation = found;
  }
  if (!place || !rotation) return std::nullopt;
  return Joined(*place, *rotation);
}

// Returns the pose that a value holds.
std::optional<PoseValue> PoseOf(const RecordTree& value) {
  if (value.is_object()) return PoseOfObject(value);
  if (!value.is_array()) return std::nullopt;
  std::optional<std::vector<double>> numbers = NumbersOf(value);
  if (!numbers) numbers = MatrixOf(value, 4, 4);
  if (!numbers) numbers = MatrixOf(value, 3, 4);
  if (numbers && (numbers->size() == 6 || numbers->size() == 7)) return PoseValue{*numbers};
  if (numbers && (numbers->size() == 12 || numbers->size() == 16)) {
    if (auto matrix = AsMatrix(*numbers)) return PoseValue{*matrix};
    return std::nullopt;
  }
  // A list of a position and a rotation, in either order.
  if (value.size() != 2) return std::nullopt;
  for (const size_t first : {0, 1}) {
    const auto place = PlaceOf(value[first]);
    const auto rotation = RotationOf(value[1 - first]);
    const bool is_decided = rotation && (rotation->numbers.size() != 3 || first == 0);
    if (place && is_decided) return Joined(*place, *rotation);
  }
  return std::nullopt;
}

// The items of a collection: those of a list, or the members of an object with their keys.
struct Items {
  std::vector<const RecordTree*> values;
  std::vector<std::string> keys = {};
  bool are_files = false;  // The keys are the names of files without suffix.
};

// Returns what a path of keys leads to; null if there is nothing.
const RecordTree* At(const RecordTree& value, const std::vector<std::string>& path) {
  const RecordTree* at = &value;
  for (const std::string& key : path) {
    if (!at->is_object() || !at->contains(key)) return nullptr;
    at = &at->at(key);
  }
  return at;
}

std::string PathText(const std::string& before, const std::vector<std::string>& path) {
  std::string text = before;
  for (const std::string& key : path) text += (text.empty() ? "" : ".") + key;
  return text;
}

// Returns every path of keys within an object, itself included.
std::vector<std::vector<std::string>> PathsIn(const RecordTree& value, const std::vector<std::string>& before = {}) {
  std::vector<std::vector<std::string>> paths = {before};
  if (!value.is_object() || before.size() >= kDeepest) return paths;
  for (const auto& [key, member] : value.items()) {
    std::vector<std::string> to_member = before;
    to_member.push_back(key);
    const std::vector<std::vector<std::string>> more = PathsIn(member, to_member);
    paths.insert(paths.end(), more.begin(), more.end());
  }
  return paths;
}

// The names of images, and the path that leads to them.
struct ImageNames {
  std::vector<std::string> names;
  std::string path = {};
};

// Returns the texts at a path if all items have there the name of an image; nothing otherwise.
std::optional<std::vector<std::string>> ImagesAt(const Items& items, const std::vector<std::string>& path) {
  std::vector<std::string> names;
  for (const RecordTree* item : items.values) {
    const RecordTree* value = At(*item, path);
    if (value == nullptr || !value->is_string()) return std::nullopt;
    const fs::path name = value->get<std::string>();
    if (!HasImageSuffix(name)) return std::nullopt;
    names.push_back(name.filename().string());
  }
  return names;
}

// Returns the names of images beside the poses: a text at one path in all items, or the items' keys; none if there are
// neither.
ImageNames FindImages(const Items& items, const std::string& before) {
  for (const std::vector<std::string>& path : PathsIn(*items.values.front())) {
    if (const auto names = ImagesAt(items, path)) return {*names, PathText(before, path)};
  }
  const bool are_images =
      std::all_of(items.keys.begin(), items.keys.end(), [](const std::string& key) { return HasImageSuffix(key); });
  return {are_images || items.are_files ? items.keys : std::vector<std::string>()};
}

// Returns every place at which all items have a pose. Items that lack it, such as a record that failed, are an
// exception of few.
std::vector<PoseRecords> FindInItems(const Items& items, const std::string& before, size_t fewest) {
  std::vector<PoseRecords> found;
  for (const std::vector<std::string>& at : PathsIn(*items.values.front())) {
    const std::optional<PoseValue> shape = PoseOf(*At(*items.values.front(), at));
    if (!shape) continue;
    PoseRecords records;
    records.paths.pose = PathText(before, at);
    records.columns = shape->columns;
    Items with_pose;
    with_pose.are_files = items.are_files;
    for (size_t i = 0; i < items.values.size(); ++i) {
      const RecordTree* value = At(*items.values[i], at);
      const std::optional<PoseValue> pose = value == nullptr ? std::nullopt : PoseOf(*value);
      if (!pose || pose->numbers.size() != shape->numbers.size() || pose->columns != shape->columns) continue;
      records.rows.push_back(pose->numbers);
      with_pose.values.push_back(items.values[i]);
      if (!items.keys.empty()) with_pose.keys.push_back(items.keys[i]);
    }
    const bool are_most = 5 * records.rows.size() >= 4 * items.values.size();
    if (records.rows.size() < fewest || !are_most) continue;
    ImageNames images = FindImages(with_pose, before);
    records.images = std::move(images.names);
    records.paths.image = std::move(images.path);
    found.push_back(std::move(records));
  }
  return found;
}

// Returns the poses in all collections of a tree.
std::vector<PoseRecords> FindInTree(const RecordTree& value, const std::string& before, int depth, size_t fewest) {
  if (!value.is_structured() || depth > kDeepest) return {};
  // A pose is a list or an object itself.
  const bool is_pose = PoseOf(value).has_value();
  if (value.size() >= fewest && !is_pose) {
    Items items;
    for (const auto& [key, member] : value.items()) {
      items.values.push_back(&member);
      if (value.is_object()) items.keys.push_back(key);
    }
    const std::string each = value.is_array() ? before + "[]" : before + (before.empty() ? "*" : ".*");
    std::vector<PoseRecords> found = FindInItems(items, each, fewest);
    if (!found.empty()) return found;
  }
  std::vector<PoseRecords> found;
  const auto find_in = [&](const RecordTree& member, const std::string& path) {
    for (PoseRecords& records : FindInTree(member, path, depth + 1, fewest)) found.push_back(std::move(records));
  };
  if (value.is_array()) {
    // The few items of a short list, such as the cameras of a session, are places of their own.
    constexpr size_t kShort = 8;
    for (size_t i = 0; i < value.size() && value.size() <= kShort; ++i) {
      find_in(value[i], before + "[" + std::to_string(i) + "]");
    }
    return found;
  }
  for (const auto& [key, member] : value.items()) find_in(member, before + (before.empty() ? "" : ".") + key);
  return found;
}

// Returns the poses in the text of a robot's program; nothing if it is none.
std::optional<PoseRecords> FindInProgram(const fs::path& file, size_t fewest) {
  constexpr std::array<std::string_view, 6> kNoText = {".json", ".jsonl", ".npy", ".npz", ".yaml", ".yml"};
  const std::string suffix = Lower(file.extension().string());
  if (std::find(kNoText.begin(), kNoText.end(), suffix) != kNoText.end()) return std::nullopt;
  WrittenPoses written = FindWrittenPoses(ReadTextFile(file));
  if (written.rows.size() < fewest) return std::nullopt;
  if (written.broken_line > 0) {
    throw InputError(file.string() + ":" + std::to_string(written.broken_line) +
                     ": the pose breaks off: a number is missing or is not a number");
  }
  PoseRecords records;
  records.pose_format = written.pose_format;
  records.rows = std::move(written.rows);
  records.lines = std::move(written.lines);
  return records;
}

std::vector<PoseRecords> FindInFile(const fs::path& file, size_t fewest) {
  if (std::optional<PoseRecords> program = FindInProgram(file, fewest)) return {*program};
  const std::optional<RecordTree> tree = ReadRecordTree(file);
  return tree ? FindInTree(*tree, "", 0, fewest) : std::vector<PoseRecords>();
}

// Reads a folder with one file per pose.
std::vector<PoseRecords> FindInFolder(const fs::path& folder, size_t fewest) {
  std::vector<RecordTree> trees;
  Items items;
  const std::vector<fs::path> files = PoseFilesOf(folder);
  for (const fs::path& file : files) {
    std::optional<RecordTree> tree = ReadRecordTree(file);
    trees.push_back(tree ? std::move(*tree) : RecordTree());
  }
  for (size_t i = 0; i < trees.size(); ++i) {
    items.values.push_back(&trees[i]);
    items.keys.push_back(files[i].stem().string());
  }
  items.are_files = true;
  return items.values.size() < fewest ? std::vector<PoseRecords>() : FindInItems(items, "", fewest);
}

}  // namespace

std::vector<PoseRecords> FindPoseRecords(const fs::path& source, size_t fewest) {
  std::error_code error;
  return fs::is_directory(source, error) ? FindInFolder(source, fewest) : FindInFile(source, fewest);
}

}  // namespace heba
