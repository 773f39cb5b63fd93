// Square lattices among dots, as a camera sees them: bent by perspective and by the lens.
#pragma once

#include <compare>
#include <map>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "targets/dots/ellipse.h"

namespace heba {

// i and j count along two directions of the lattice; seen in the image, j's is clockwise from i's.
struct LatticeCell {
  int i = 0;
  int j = 0;
  // NOLINTNEXTLINE(modernize-use-nullptr): clang-tidy 14 sees a zero in a defaulted comparison.
  friend auto operator<=>(const LatticeCell&, const LatticeCell&) = default;
};

// The dot at each occupied cell, as an index.
using Lattice = std::map<LatticeCell, int>;

struct LatticeOptions {
  // How many times as large a dot may be as its neighbour in the lattice.
  double max_size_ratio = 1.45;
  // Lattices of fewer dots are not worth a word.
  int min_dots = 4;
  int max_lattices = 20;
};

// Lattices of neighbouring dots, grown from the most regular places, the largest first. Two may have dots in common.
std::vector<Lattice> GrowLattices(const std::vector<Ellipse>& dots, const LatticeOptions& options);

struct DotPrediction {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double spacing_px = 0;  // Between neighbouring dots there.
};
// Where the dot of `cell` should be, from the dots around it, whether it has a dot or not. Nothing if those are too
// few.
std::optional<DotPrediction> PredictDot(const Lattice& lattice, const std::vector<Ellipse>& dots,
                                        const LatticeCell& cell);

// Ways to lay a pattern of cells on a lattice so that every cell has its dot.
struct LatticePlacement {
  // placement.orders[k][n] is the dot of pattern[n]: the same dots in each order, the lattice turned by quarters.
  std::vector<std::vector<int>> orders;
};
// One placement for each set of dots.
std::vector<LatticePlacement> PlacePattern(const Lattice& lattice, const std::vector<LatticeCell>& pattern);

}  // namespace heba
