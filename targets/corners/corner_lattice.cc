#include "targets/corners/corner_lattice.h"

#include <algorithm>
#include <cstdlib>
#include <set>
#include <vector>

#include "heba/geometry/homography.h"

namespace heba {
namespace {

int Distance(const LatticePlace& a, const LatticePlace& b) {
  return std::max(std::abs(a.row - b.row), std::abs(a.column - b.column));
}

// Returns the first and the last line with at least two corners, given the number of corners on each line; (0, -1) if
// there is none.
std::pair<int, int> RangeOf(const std::map<int, int>& counts) {
  int first = 0;
  int last = -1;
  for (const auto& [line, count] : counts) {
    if (count < 2) continue;
    if (last < first) first = line;
    last = line;
  }
  return {first, last};
}

}  // namespace

std::optional<Eigen::Matrix3d> MapNear(const CornerLattice& lattice, const LatticePlace& place) {
  constexpr size_t kEnough = 6;
  constexpr int kFarthest = 6;
  for (int reach = 2; reach <= kFarthest; ++reach) {
    std::vector<Eigen::Vector2d> places;
    std::vector<Eigen::Vector2d> pixels;
    std::set<int> rows;
    std::set<int> columns;
    for (const auto& [other, pixel] : lattice) {
      if (Distance(place, other) > reach) continue;
      places.emplace_back(other.column, other.row);
      pixels.push_back(pixel);
      rows.insert(other.row);
      columns.insert(other.column);
    }
    if (places.size() < kEnough || rows.size() < 2 || columns.size() < 2) continue;
    return FitHomography(places, pixels);
  }
  return std::nullopt;
}

CornerLattice GrowLattice(const CornerLattice& start, int max_side, const FindLatticeCorner& find) {
  CornerLattice lattice;
  const auto try_at = [&](const CornerLattice& known, const LatticePlace& place) {
    const std::optional<Eigen::Matrix3d> map = MapNear(known, place);
    const std::optional<Eigen::Vector2d> pixel = map ? find(place, *map) : std::nullopt;
    if (pixel) lattice[place] = *pixel;
    return pixel.has_value();
  };
  for (const auto& [place, pixel] : start) try_at(start, place);
  constexpr int kMaxStep = 3;
  int step = 1;
  while (step <= kMaxStep && !lattice.empty()) {
    std::set<LatticePlace> candidates;
    const LatticeExtent extent = ExtentOf(lattice);
    for (const auto& [place, pixel] : lattice) {
      for (int row = place.row - step; row <= place.row + step; ++row) {
        for (int column = place.column - step; column <= place.column + step; ++column) {
          const int rows = std::max(extent.first.row + extent.rows - 1, row) - std::min(extent.first.row, row) + 1;
          const int columns =
              std::max(extent.first.column + extent.columns - 1, column) - std::min(extent.first.column, column) + 1;
          if (rows <= max_side && columns <= max_side && lattice.count({row, column}) == 0) {
            candidates.insert({row, column});
          }
        }
      }
    }
    const CornerLattice known = lattice;
    bool is_grown = false;
    for (const LatticePlace& candidate : candidates) is_grown = try_at(known, candidate) || is_grown;
    step = is_grown ? 1 : step + 1;
  }
  return lattice;
}

LatticeExtent ExtentOf(const CornerLattice& lattice) {
  std::map<int, int> in_row;
  std::map<int, int> in_column;
  for (const auto& [place, pixel] : lattice) {
    ++in_row[place.row];
    ++in_column[place.column];
  }
  const auto [first_row, last_row] = RangeOf(in_row);
  const auto [first_column, last_column] = RangeOf(in_column);
  return {{first_row, first_column}, last_row - first_row + 1, last_column - first_column + 1};
}

}  // namespace heba
