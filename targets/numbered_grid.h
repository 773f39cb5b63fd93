// How a pattern is arranged whose parts are numbered row by row, from where some of the numbers are in an image.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace heba {

// A number that was read in an image.
struct SeenNumber {
  int number = 0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
};

struct NumberedGrid {
  int columns = 0;
  int first = 0;                                                  // The number of the first part.
  Eigen::Matrix3d pixel_from_cell = Eigen::Matrix3d::Identity();  // Cells count from the first one.
};

// Returns the column and the row, as (x, y), of the part with an index from 0 in a pattern of so many columns.
using CellOfIndex = std::function<Eigen::Vector2d(int index, int columns)>;

// Returns the number of columns, 1 to `most_columns`, and the first number, 0 or the lowest that is seen, with which a
// homography fits the seen numbers best. Returns nothing for fewer than four numbers, for numbers on one line, and if
// the homography misses a number by more than a fifth of a cell in the median.
std::optional<NumberedGrid> FindNumberedGrid(const std::vector<SeenNumber>& seen, int most_columns,
                                             const CellOfIndex& cell_of);

// Returns the size of a cell at a pixel: the square root of its area.
double CellSizePx(const Eigen::Matrix3d& pixel_from_cell, const Eigen::Vector2d& pixel);

}  // namespace heba
