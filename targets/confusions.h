// Mistakes that people make with more than one type of target, for Target::Confusions.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "targets/target.h"

namespace heba {

inline TargetSettings RowsAndColumns(int rows, int columns) {
  return {{"rows", std::to_string(rows)}, {"columns", std::to_string(columns)}};
}

// Rows for columns, squares for the corners between them (or the reverse), one too many or too few of one of them.
inline std::vector<TargetSettings> ConfusedGrids(int rows, int columns) {
  std::vector<TargetSettings> confusions;
  if (rows != columns) confusions.push_back(RowsAndColumns(columns, rows));
  constexpr std::array<std::array<int, 2>, 8> kSteps = {
      {{-1, -1}, {1, 1}, {0, -1}, {-1, 0}, {0, 1}, {1, 0}, {-1, 1}, {1, -1}}};
  for (const auto& [more_rows, more_columns] : kSteps) {
    if (rows + more_rows < 1 || columns + more_columns < 1) continue;
    confusions.push_back(RowsAndColumns(rows + more_rows, columns + more_columns));
    if (rows != columns) confusions.push_back(RowsAndColumns(columns + more_columns, rows + more_rows));
  }
  return confusions;
}

// Every other name of a table for `key`.
template <class Table>
void AddOtherNames(const std::string& key, const Table& table, const std::string& name,
                   std::vector<TargetSettings>* confusions) {
  for (const auto& entry : table) {
    if (entry.name != name) confusions->push_back({{key, entry.name}});
  }
}

}  // namespace heba
