// A board's corners as a lattice that is seen in part: from some corners that lie together to all that can be seen.
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
using CornerLattice = std::map<LatticePlace, Eigen::Vector2d>;  // px

// The map from (column, row) into the image near a place, by the corners around it. Nothing if they are too few.
std::optional<Eigen::Matrix3d> MapNear(const CornerLattice& lattice, const LatticePlace& place);

// The corner at a place, where `image_from_lattice` maps (column, row) near there; nothing if none is seen.
using FindLatticeCorner =
    std::function<std::optional<Eigen::Vector2d>(const LatticePlace& place, const Eigen::Matrix3d& image_from_lattice)>;

// Drops the corners that `find` does not see and adds those that it sees next to others or beyond gaps of two corners,
// to at most `max_side` rows and columns.
CornerLattice GrowLattice(const CornerLattice& start, int max_side, const FindLatticeCorner& find);

// The rows and columns from the first to the last that have two corners at least.
struct LatticeExtent {
  LatticePlace first;
  int rows = 0;
  int columns = 0;
};
LatticeExtent ExtentOf(const CornerLattice& lattice);

}  // namespace heba
