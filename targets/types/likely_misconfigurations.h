// Frequent mistakes in the configuration of several types of targets, for Target::LikelyMisconfigurations.
#pragma once

#include <algorithm>
#include <array>
#include <iterator>
#include <string>
#include <vector>

#include "heba/target.h"

namespace heba {

inline TargetSettings RowsAndColumns(int rows, int columns) {
  return {{"rows", std::to_string(rows)}, {"columns", std::to_string(columns)}};
}

// Returns grids with rows and columns exchanged, with squares counted instead of the corners between them (or the
// reverse), and with one row or column too many or too few.
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

// Returns other values of `key`, the number of a target's first tag (marker, dot), which is now `first`. The target
// has `num` tags; with the returned values it includes as many as possible of those `seen` in an image. If the target
// is partly in view, several values do: all are returned if they are few, else the two ends of their range.
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

// Returns a setting of `key` for every other name in a table.
template <class Table>
std::vector<TargetSettings> OtherNames(const std::string& key, const Table& table, const std::string& name) {
  std::vector<TargetSettings> confusions;
  for (const auto& entry : table) {
    if (entry.name != name) confusions.push_back({{key, entry.name}});
  }
  return confusions;
}

}  // namespace heba
