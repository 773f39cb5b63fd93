// A JSON reader whose error messages name the position in the file.
#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "heba/base/error.h"
#include "heba/base/files.h"

namespace heba {

// A JSON value with its position in the file. All faults are InputErrors that begin with the position.
class JsonReader {
 public:
  JsonReader(const nlohmann::ordered_json& json, std::string where) : json_(json), where_(std::move(where)) {}
  [[noreturn]] void Fail(const std::string& fault) const { throw InputError(where_ + ": " + fault); }
  bool Has(const char* key) const { return json_.is_object() && json_.contains(key) && !json_.at(key).is_null(); }
  JsonReader Get(const char* key) const {
    if (!json_.is_object()) Fail("an object is needed");
    if (!Has(key)) Fail(std::string("'") + key + "' is missing");
    return {json_.at(key), where_ + ": " + key};
  }
  std::string Text() const {
    if (!json_.is_string()) Fail("a text is needed");
    return json_.get<std::string>();
  }
  bool Bool() const {
    if (!json_.is_boolean()) Fail("true or false is needed");
    return json_.get<bool>();
  }
  std::vector<JsonReader> List() const {
    if (!json_.is_array()) Fail("a list is needed");
    std::vector<JsonReader> items;
    for (size_t i = 0; i < json_.size(); ++i) items.emplace_back(json_[i], where_ + "[" + std::to_string(i) + "]");
    return items;
  }
  // Returns the members of an object. The value is empty for members that are null.
  std::vector<std::pair<std::string, std::optional<JsonReader>>> Members() const {
    if (!json_.is_object()) Fail("an object is needed");
    std::vector<std::pair<std::string, std::optional<JsonReader>>> members;
    for (const auto& [name, value] : json_.items()) {
      members.emplace_back(name, std::nullopt);
      if (!value.is_null()) members.back().second.emplace(value, where_ + ": " + name);
    }
    return members;
  }
  double Number() const {
    if (!json_.is_number()) Fail("a number is needed");
    return json_.get<double>();
  }
  // Returns an integer in [min, max].
  int Int(int min, int max) const {
    const double number = Number();
    if (!(number >= min && number <= max) || number != std::floor(number)) {
      Fail("a whole number from " + std::to_string(min) + " to " + std::to_string(max) + " is needed");
    }
    return static_cast<int>(number);
  }
  std::vector<double> Numbers() const {
    if (!json_.is_array()) Fail("a list of numbers is needed");
    std::vector<double> numbers;
    for (const nlohmann::ordered_json& item : json_) numbers.push_back(JsonReader(item, where_).Number());
    return numbers;
  }
  std::vector<double> Numbers(size_t count) const {
    const std::vector<double> numbers = Numbers();
    if (numbers.size() != count)
      Fail(std::to_string(count) + " numbers are needed, not " + std::to_string(numbers.size()));
    return numbers;
  }

 private:
  const nlohmann::ordered_json& json_;
  std::string where_;
};

// Reads a whole file. Throws InputError if it is not JSON, or if it contains more than 20 million values: a run has far
// fewer, and parsing them would take gigabytes.
inline nlohmann::ordered_json ReadJsonFile(const std::filesystem::path& path, size_t max_bytes) {
  const std::string text = ReadTextFile(path, max_bytes);
  if (text.find('\0') != std::string::npos) throw InputError(path.string() + ": contains NUL characters");
  constexpr std::ptrdiff_t kMostValues = 20'000'000;
  if (std::count_if(text.begin(), text.end(), [](char c) { return c == ',' || c == '[' || c == '{'; }) > kMostValues) {
    throw InputError(path.string() + ": contains more than 20 million values");
  }
  try {
    return nlohmann::ordered_json::parse(text);
  } catch (const nlohmann::ordered_json::parse_error& error) {
    throw InputError(path.string() + ": not valid JSON at byte " + std::to_string(error.byte));
  } catch (const nlohmann::ordered_json::exception&) {
    throw InputError(path.string() + ": not valid JSON: a number is too large");
  }
}

}  // namespace heba
