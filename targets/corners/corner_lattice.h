// A target's corners as a lattice, which is grown from a few neighbouring corners to all that are visible.
#pragma once

#include <compare>
#include <functional>
#include <map>
#include <optional>

#include <Eigen/Core>

namespace heba {

struct LatticePlace {
  int row = 0;
  int column = 0;
  friend bool operator<(const LatticePlace& a, const LatticePlace& b) {
    return a.row != b.row ? a.row < b.row : a.column < b.column;
  }
};
using CornerLattice = std::map<LatticePlace, Eigen::Vector2d>;  // Pixels.

// Estimates the homography from (column, row) to pixels near a lattice position. Needs six corners, in at least two
// rows and two columns, within six steps of the position; returns nothing otherwise.
std::optional<Eigen::Matrix3d> MapNear(const CornerLattice& lattice, const LatticePlace& place);

// Finds the corner at a lattice position; `image_from_lattice` maps (column, row) to pixels near it. Returns nothing
// if no corner is seen there.
using FindLatticeCorner =
    std::function<std::optional<Eigen::Vector2d>(const LatticePlace& place, const Eigen::Matrix3d& image_from_lattice)>;

// Drops the corners that `find` does not confirm, and adds those that it sees next to known corners or beyond gaps of
// up to two corners, up to `max_side` rows and columns.
CornerLattice GrowLattice(const CornerLattice& start, int max_side, const FindLatticeCorner& find);

// The range of rows and columns from the first to the last that have at least two corners.
struct LatticeExtent {
  LatticePlace first;
  int rows = 0;
  int columns = 0;
};
LatticeExtent ExtentOf(const CornerLattice& lattice);

}  // namespace heba
