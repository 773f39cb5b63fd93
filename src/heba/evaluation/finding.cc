#include "heba/evaluation/finding.h"

#include <algorithm>

namespace heba {
namespace {

template <typename T>
std::optional<T> FirstUnder(std::string_view key, const std::vector<std::pair<std::string, T>>& entries) {
  const auto found =
      std::find_if(entries.begin(), entries.end(), [&](const auto& entry) { return entry.first == key; });
  return found == entries.end() ? std::nullopt : std::optional<T>(found->second);
}

}  // namespace

std::optional<double> Finding::Number(std::string_view key) const { return FirstUnder(key, numbers); }

std::optional<std::string> Finding::Name(std::string_view key) const { return FirstUnder(key, names); }

}  // namespace heba
