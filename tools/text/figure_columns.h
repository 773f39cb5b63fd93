// Columns of figures in a table for the terminal.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "heba/base/text.h"
#include "tools/text/result_text.h"

namespace heba {

// A column with one figure of each row. A title may reach to the left over a column that has none.
template <class Row>
struct FigureColumn {
  std::string title;
  std::string unit;
  size_t width = 0;
  int digits = 3;
  std::function<std::optional<double>(const Row&)> figure;
};

// Returns the line of the titles and, unless there are no units, that of the units. `begin` and `below` stand before
// the columns, and have the same length.
template <class Row>
std::string ColumnHeads(const std::string& begin, const std::string& below,
                        const std::vector<FigureColumn<Row>>& columns) {
  std::string titles = begin;
  std::string units = below;
  size_t end = begin.size();
  for (const FigureColumn<Row>& column : columns) {
    end += column.width;
    titles.resize(end - column.title.size(), ' ');
    titles += column.title;
    units.resize(end - column.unit.size(), ' ');
    units += column.unit;
  }
  units.erase(units.find_last_not_of(' ') + 1);
  return titles + "\n" + (units.empty() ? "" : units + "\n");
}

// Returns the figures of one row, without the end of the line.
template <class Row>
std::string FigureCells(const std::vector<FigureColumn<Row>>& columns, const Row& row) {
  std::string cells;
  for (const FigureColumn<Row>& column : columns) {
    cells += PadLeft(FigureCell(column.figure(row), column.digits, column.width), column.width);
  }
  return cells;
}

}  // namespace heba
