// Configuration values that name the entry of a table.
#pragma once

#include <string>

#include "heba/base/registry.h"
#include "heba/config/yaml_reader.h"

namespace heba {

// Returns the entry of the table that the value of `key` names. Throws InputError, which lists the valid names, if
// there is none.
template <class Table>
const auto* ReadChoice(MapReader& reader, const std::string& key, const Table& table) {
  return FindEntry(table, reader.Choice(key, NamesOf(table)));
}

}  // namespace heba
