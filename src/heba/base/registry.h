// Tables of named entries, such as formats, models and methods: which names there are, and the entry of a name. An
// entry is a struct with the member `name`, or points to a class with the method `name()`.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "heba/base/text.h"

namespace heba {

template <class Entry>
std::string_view EntryName(const Entry& entry) {
  if constexpr (requires { entry.name; }) {
    return entry.name;
  } else {
    return entry->name();
  }
}

// Returns the names of all entries in the order of the table.
template <class Table>
std::vector<std::string> NamesOf(const Table& table) {
  std::vector<std::string> names;
  for (const auto& entry : table) names.emplace_back(EntryName(entry));
  return names;
}

// Returns the first entry with this name, or null if there is none. The table must outlive the result.
template <class Table>
auto FindEntry(const Table& table, std::string_view name) -> decltype(&*std::begin(table)) {
  const auto found =
      std::find_if(std::begin(table), std::end(table), [&](const auto& entry) { return EntryName(entry) == name; });
  return found == std::end(table) ? nullptr : &*found;
}

// Returns "'x' is unknown; one of: a, b, c", with the nearest of these names before the list if one is similar.
inline std::string UnknownName(std::string_view unknown, const std::vector<std::string>& known) {
  const std::string meant = DidYouMean(unknown, known);
  return Quoted(unknown) + " is unknown" + meant + (meant.empty() ? "; one of: " : " One of: ") + Join(known, ", ");
}

// Returns the value of an enum with this name, given the names of all values in their order; nothing if there is none.
template <class Enum, size_t kNumNames>
std::optional<Enum> FindValue(const std::array<std::string_view, kNumNames>& names, std::string_view name) {
  const auto found = std::find(names.begin(), names.end(), name);
  return found == names.end() ? std::nullopt : std::optional<Enum>(static_cast<Enum>(found - names.begin()));
}

}  // namespace heba
