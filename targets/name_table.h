// Selects table entries by name.
#pragma once

#include <algorithm>
#include <iterator>
#include <string>
#include <vector>

#include "heba/config/yaml_reader.h"

namespace heba {

template <class Table>
std::vector<std::string> NamesOf(const Table& table) {
  std::vector<std::string> names;
  for (const auto& entry : table) names.emplace_back(entry.name);
  return names;
}

// Returns the entry of a table of structs with this `name`, which must exist.
template <class Table>
const auto& EntryNamed(const Table& table, const std::string& name) {
  return *std::find_if(std::begin(table), std::end(table), [&](const auto& entry) { return entry.name == name; });
}

// Returns the entry that the value of `key` names. Throws InputError, which lists the valid names, if there is none.
template <class Table>
const auto& ReadChoice(MapReader& reader, const std::string& key, const Table& table) {
  return EntryNamed(table, reader.Choice(key, NamesOf(table)));
}

}  // namespace heba
