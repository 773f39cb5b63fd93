// Square lattices of dots in an image, bent by perspective and lens distortion.
#pragma once

#include <compare>
#include <map>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "targets/dots/ellipse.h"

namespace heba {

// A cell of a lattice: i and j count along its two directions. In the image, the direction of j is clockwise from
// that of i.
struct LatticeCell {
  int i = 0;
  int j = 0;
  // NOLINTNEXTLINE(modernize-use-nullptr): clang-tidy 14 sees a zero in a defaulted comparison.
  friend auto operator<=>(const LatticeCell&, const LatticeCell&) = default;
};

// Maps each occupied cell to the index of its dot.
using Lattice = std::map<LatticeCell, int>;

struct LatticeOptions {
  // Maximum ratio of the radii of two dots that are neighbours in a lattice.
  double max_size_ratio = 1.45;
  // Lattices of fewer dots are discarded.
  int min_dots = 4;
  int max_lattices = 20;
};

// Grows lattices of neighbouring dots from the most regular neighbourhoods and returns the largest first. Two
// lattices may have dots in common.
std::vector<Lattice> GrowLattices(const std::vector<Ellipse>& dots, const LatticeOptions& options);

struct DotPrediction {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double spacing_px = 0;  // Distance between neighbouring dots there.
};
// Predicts the dot of `cell` from the dots around it, whether or not the cell is occupied. Returns nothing if there
// are too few of them.
std::optional<DotPrediction> PredictDot(const Lattice& lattice, const std::vector<Ellipse>& dots,
                                        const LatticeCell& cell);

// The ways to place a pattern of cells on a lattice so that every cell has a dot.
struct LatticePlacement {
  // placement.orders[k][n] is the dot of pattern[n]. All orders have the same dots, with the pattern rotated by
  // quarter turns.
  std::vector<std::vector<int>> orders;
};
// Places a pattern on a lattice; returns one placement for each set of dots.
std::vector<LatticePlacement> PlacePattern(const Lattice& lattice, const std::vector<LatticeCell>& pattern);

}  // namespace heba
