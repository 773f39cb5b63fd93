#include "targets/render/target_text.h"

#include <cmath>
#include <vector>

#include "heba/base/text.h"
#include "heba/base/units.h"

namespace heba {
namespace {

std::string ShownValue(const std::string& text) {
  const ParsedQuantity length = ParseQuantity(text, Quantity::kLength);
  if (length.fault.empty()) return RoundTrip(std::round(length.value * 1e9) / 1e6) + " mm";
  double number = 0;
  constexpr int kDigits = 12;
  // Rounded to these digits, and then without zeros at the end.
  if (ParseDouble(text, &number) && ParseDouble(Significant(number, kDigits), &number)) return RoundTrip(number);
  return text;
}

}  // namespace

std::string TargetConfigLine(const YAML::Node& used) {
  std::vector<std::string> entries;
  for (const auto& entry : used) {
    entries.push_back(entry.first.as<std::string>() + ": " + ShownValue(entry.second.as<std::string>()));
  }
  return "{" + Join(entries, ", ") + "}";
}

std::string TargetTitle(const Target& target, const YAML::Node& used) {
  std::string title(target.type());
  if (used["columns"] && used["rows"]) {
    title += " " + used["columns"].as<std::string>() + " x " + used["rows"].as<std::string>();
  }
  const TargetSettings lengths = target.UnitLengths();
  if (!lengths.empty() && used[lengths[0].first]) {
    title += ", " + ShownValue(used[lengths[0].first].as<std::string>());
  }
  return title;
}

}  // namespace heba
