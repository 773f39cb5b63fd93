#include "heba/io/pixel_records.h"

#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/io/record_tree.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

// A value that a path leads to, and the key that a `*` of the path stands for.
struct ReachedRecord {
  std::string key;
  const RecordTree* value = nullptr;
};

// Splits a path into its steps: keys, `*`, `[]` and `[2]`.
std::vector<std::string> StepsOf(const std::string& path) {
  std::vector<std::string> steps(1);
  for (const char letter : path) {
    if (letter == '.' || letter == '[') {
      if (!steps.back().empty()) steps.emplace_back();
      if (letter == '.') continue;
    }
    steps.back() += letter;
  }
  if (steps.back().empty()) steps.pop_back();
  return steps;
}

std::vector<ReachedRecord> AfterStep(const ReachedRecord& from, const std::string& step) {
  const RecordTree& value = *from.value;
  std::vector<ReachedRecord> reached;
  if (step == "[]") {
    if (!value.is_array()) return {};
    for (const RecordTree& item : value) reached.push_back({from.key, &item});
  } else if (step == "*") {
    if (!value.is_object()) return {};
    for (const auto& [key, member] : value.items()) reached.push_back({key, &member});
  } else if (step.front() == '[') {
    size_t index = 0;
    const auto [end, error] = std::from_chars(step.data() + 1, step.data() + step.size(), index);
    const bool is_index = error == std::errc() && end + 1 == step.data() + step.size() && *end == ']';
    if (is_index && value.is_array() && index < value.size()) reached.push_back({from.key, &value[index]});
  } else if (value.is_object() && value.contains(step)) {
    reached.push_back({from.key, &value.at(step)});
  }
  return reached;
}

// Returns all values that a path leads to, in the order of the file. Throws InputError if there are none.
std::vector<ReachedRecord> ValuesAt(const RecordTree& tree, const std::string& path, const fs::path& file) {
  std::vector<ReachedRecord> values = {{"", &tree}};
  for (const std::string& step : StepsOf(path)) {
    std::vector<ReachedRecord> next;
    for (const ReachedRecord& from : values) {
      const std::vector<ReachedRecord> reached = AfterStep(from, step);
      next.insert(next.end(), reached.begin(), reached.end());
    }
    values = std::move(next);
    if (values.empty()) {
      throw InputError(file.string() + ": the path " + Quoted(path) + " leads to nothing at " + Quoted(step));
    }
  }
  return values;
}

// Returns all numbers of a value; nothing if it contains anything else.
std::optional<std::vector<double>> NumbersOf(const RecordTree& value) {
  if (value.is_number()) {
    const auto number = value.get<double>();
    return std::isfinite(number) ? std::optional(std::vector{number}) : std::nullopt;
  }
  if (!value.is_array()) return std::nullopt;
  std::vector<double> numbers;
  for (const RecordTree& item : value) {
    const std::optional<std::vector<double>> more = NumbersOf(item);
    if (!more) return std::nullopt;
    numbers.insert(numbers.end(), more->begin(), more->end());
  }
  return numbers;
}

}  // namespace

std::vector<PixelRecord> ReadPixelRecords(const fs::path& file, const std::string& pixel_path,
                                          const std::string& image_path) {
  const std::optional<RecordTree> tree = ReadRecordTree(file);
  if (!tree) throw InputError(file.string() + ": contains no records");
  std::vector<PixelRecord> records;
  for (const ReachedRecord& reached : ValuesAt(*tree, pixel_path, file)) {
    const std::optional<std::vector<double>> numbers =
        reached.value->is_null() ? std::vector<double>() : NumbersOf(*reached.value);
    if (!numbers || numbers->size() % 2 != 0) {
      throw InputError(file.string() + ": item " + std::to_string(records.size() + 1) + " at " + Quoted(pixel_path) +
                       " is not a list of points with two numbers each");
    }
    PixelRecord& record = records.emplace_back();
    record.image = fs::path(reached.key).filename().string();
    for (size_t i = 0; i < numbers->size(); i += 2) record.pixels.emplace_back((*numbers)[i], (*numbers)[i + 1]);
  }
  if (image_path.empty()) return records;
  const std::vector<ReachedRecord> names = ValuesAt(*tree, image_path, file);
  if (names.size() != records.size()) {
    throw InputError(file.string() + ": " + std::to_string(records.size()) + " lists of points at " +
                     Quoted(pixel_path) + ", but " + std::to_string(names.size()) + " images at " + Quoted(image_path));
  }
  for (size_t i = 0; i < names.size(); ++i) {
    if (!names[i].value->is_string()) {
      throw InputError(file.string() + ": item " + std::to_string(i + 1) + " at " + Quoted(image_path) +
                       " is not the name of an image");
    }
    records[i].image = fs::path(names[i].value->get<std::string>()).filename().string();
  }
  return records;
}

}  // namespace heba
