// Mistakes that people make with more than one type of target, for Target::LikelyMisconfigurations.
#pragma once

#include <algorithm>
#include <array>
#include <iterator>
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

// Where the numbers of a board's `num` tags (markers, dots) may begin instead of at `first`, by all those `seen` in a
// picture: so that as many of them as can be belong to the board. Of a board that is partly in view several starts do,
// all of them if they are few, else the ends of what is possible.
inline std::vector<TargetSettings> OtherFirstIds(const std::string& key, std::vector<int> seen, int first, int num) {
  std::sort(seen.begin(), seen.end());
  seen.erase(std::unique(seen.begin(), seen.end()), seen.end());
  if (seen.empty()) return {};
  const auto count_from = [&](int begin) {
    return std::count_if(seen.begin(), seen.end(), [&](int id) { return id >= begin && id < begin + num; });
  };
  const int highest_start =
      *std::max_element(seen.begin(), seen.end(), [&](int a, int b) { return count_from(a) < count_from(b); });
  const int last = *std::prev(std::lower_bound(seen.begin(), seen.end(), highest_start + num));
  const int lowest_start = std::max(0, last - num + 1);
  constexpr int kFew = 8;
  const int range = highest_start - lowest_start;
  std::vector<TargetSettings> confusions;
  for (int start = highest_start; start >= lowest_start; start -= range <= kFew ? 1 : range) {
    if (start != first) confusions.push_back({{key, std::to_string(start)}});
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
