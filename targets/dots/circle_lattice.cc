#include "targets/dots/circle_lattice.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <limits>
#include <optional>
#include <set>

#include <Eigen/Dense>

#include "heba/base/factorisation.h"

namespace heba {
namespace {

constexpr std::array<LatticeCell, 4> kSteps = {LatticeCell{1, 0}, LatticeCell{0, 1}, LatticeCell{-1, 0},
                                               LatticeCell{0, -1}};

LatticeCell operator+(const LatticeCell& a, const LatticeCell& b) { return {a.i + b.i, a.j + b.j}; }
LatticeCell operator-(const LatticeCell& a, const LatticeCell& b) { return {a.i - b.i, a.j - b.j}; }

// A spatial index of dots.
class DotIndex {
 public:
  explicit DotIndex(const std::vector<Ellipse>& dots) : dots_(dots) {
    for (size_t n = 0; n < dots.size(); ++n) cells_[CellOf(dots[n].centre_px)].push_back(static_cast<int>(n));
  }
  // Returns the dots within `reach_px` of a pixel.
  std::vector<int> Near(const Eigen::Vector2d& pixel, double reach_px) const {
    std::vector<int> near;
    const auto first = CellOf(pixel.array() - reach_px);
    const auto last = CellOf(pixel.array() + reach_px);
    for (int row = first.second; row <= last.second; ++row) {
      for (int column = first.first; column <= last.first; ++column) {
        const auto cell = cells_.find({column, row});
        if (cell == cells_.end()) continue;
        for (const int n : cell->second) {
          if ((dots_[n].centre_px - pixel).norm() <= reach_px) near.push_back(n);
        }
      }
    }
    return near;
  }

 private:
  static std::pair<int, int> CellOf(const Eigen::Vector2d& pixel) {
    constexpr double kCellPx = 32;
    return {static_cast<int>(std::floor(pixel.x() / kCellPx)), static_cast<int>(std::floor(pixel.y() / kCellPx))};
  }
  const std::vector<Ellipse>& dots_;
  std::map<std::pair<int, int>, std::vector<int>> cells_;
};

double Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

// Returns whether two dots have similar radii, given that outlines of candidates are accurate to some tenths of a
// pixel.
bool AreAlike(const Ellipse& a, const Ellipse& b, double max_size_ratio) {
  const double radius_a = a.RadiusPx();
  const double radius_b = b.RadiusPx();
  return std::max(radius_a, radius_b) < max_size_ratio * std::min(radius_a, radius_b) + 0.7;
}

struct Seed {
  int dot;
  Eigen::Vector2d i_px;  // Offsets to the neighbours along i and j.
  Eigen::Vector2d j_px;
  int num_agreeing;  // Number of the eight predicted neighbours that were found.
  double spread;     // Sum of their distances from the prediction, relative to the spacing.
};

// The limits of the search for the two directions of the lattice at a dot. Lengths in units of the dot's outline make
// the limits independent of tilt; perspective and lens distortion account for the tolerances.
struct LatticeSeedLimits {
  double reach = 9;               // Neighbours are looked for up to this many major semi-axes away.
  double min_distance = 1.5;      // Ring marks and reflections are closer to the dot than another dot can be.
  size_t num_neighbours = 12;     // More than the eight around a dot, because marks of other objects may be among them.
  size_t num_first = 4;           // The first direction leads to one of this many nearest neighbours.
  double min_length_ratio = 0.7;  // Lengths of the two directions, in units of the outline.
  double max_length_ratio = 1.45;
  double min_sine = 0.8;    // Sine of the angle between them.
  double agreement = 0.25;  // Distance from an expected dot within which one agrees, in spacings.
  double centre = 0.2;      // Distance from the centre of a mesh within which a dot shows that it has one.
};
constexpr LatticeSeedLimits kSeedLimits;

// Another dot near one, relative to that.
struct Neighbour {
  Eigen::Vector2d offset_px;
  Eigen::Vector2d offset;  // In units of the dot's outline.
  double distance;         // Length of `offset`.
};

// Returns the dots of similar size near a dot, nearest first.
std::vector<Neighbour> NeighboursOf(const std::vector<Ellipse>& dots, const DotIndex& index, double max_size_ratio,
                                    int dot) {
  const Ellipse& ellipse = dots[dot];
  const double reach_px = kSeedLimits.reach * ellipse.SemiAxesPx().x();
  const Eigen::Matrix2d units_from_px = EigenOfSymmetric(ellipse.shape).Root();
  std::vector<Neighbour> neighbours;
  for (const int other : index.Near(ellipse.centre_px, reach_px)) {
    if (other == dot) continue;
    if (!AreAlike(ellipse, dots[other], max_size_ratio)) continue;
    const Eigen::Vector2d offset_px = dots[other].centre_px - ellipse.centre_px;
    const Eigen::Vector2d offset = units_from_px * offset_px;
    if (offset.norm() < kSeedLimits.min_distance) continue;
    neighbours.push_back({offset_px, offset, offset.norm()});
  }
  std::sort(neighbours.begin(), neighbours.end(),
            [](const Neighbour& a, const Neighbour& b) { return a.distance < b.distance; });
  if (neighbours.size() > kSeedLimits.num_neighbours) neighbours.resize(kSeedLimits.num_neighbours);
  return neighbours;
}

// Returns the seed with two directions, and how well the neighbours agree with it.
Seed SeedOf(int dot, const Eigen::Vector2d& i_px, const Eigen::Vector2d& j_px,
            const std::vector<Neighbour>& neighbours) {
  Seed seed{dot, i_px, j_px, 0, 0};
  const double spacing_px = std::min(i_px.norm(), j_px.norm());
  for (int i = -1; i <= 1; ++i) {
    for (int j = -1; j <= 1; ++j) {
      if (i == 0 && j == 0) continue;
      const Eigen::Vector2d expected = i * i_px + j * j_px;
      double nearest = kSeedLimits.agreement * spacing_px;
      for (const Neighbour& neighbour : neighbours) {
        nearest = std::min(nearest, (neighbour.offset_px - expected).norm());
      }
      seed.num_agreeing += nearest < kSeedLimits.agreement * spacing_px ? 1 : 0;
      seed.spread += nearest / spacing_px;
    }
  }
  return seed;
}

// Returns whether a dot is in the middle of the mesh, which shows that the two directions are diagonals.
bool HasDotInMesh(const Seed& seed, const std::vector<Neighbour>& neighbours) {
  const double spacing_px = std::min(seed.i_px.norm(), seed.j_px.norm());
  for (const Neighbour& neighbour : neighbours) {
    for (const double si : {-0.5, 0.5}) {
      for (const double sj : {-0.5, 0.5}) {
        const Eigen::Vector2d off_px = neighbour.offset_px - si * seed.i_px - sj * seed.j_px;
        if (off_px.norm() < kSeedLimits.centre * spacing_px) return true;
      }
    }
  }
  return false;
}

// Returns the two directions of the lattice at a dot, if there are any. The dot's own shape undoes the tilt: in units
// of its outline, the two are approximately equally long and orthogonal.
std::optional<Seed> FindSeed(const std::vector<Ellipse>& dots, const DotIndex& index, double max_size_ratio, int dot) {
  const std::vector<Neighbour> neighbours = NeighboursOf(dots, index, max_size_ratio, dot);
  std::optional<Seed> best;
  for (size_t a = 0; a < std::min(neighbours.size(), kSeedLimits.num_first); ++a) {
    for (const Neighbour& along_j : neighbours) {
      const Neighbour& along_i = neighbours[a];
      const double length_ratio = along_j.offset.norm() / along_i.offset.norm();
      if (length_ratio < kSeedLimits.min_length_ratio || length_ratio > kSeedLimits.max_length_ratio) continue;
      const double sine = Cross(along_i.offset, along_j.offset) / (along_i.offset.norm() * along_j.offset.norm());
      if (sine < kSeedLimits.min_sine) continue;
      const Seed candidate = SeedOf(dot, along_i.offset_px, along_j.offset_px, neighbours);
      if (HasDotInMesh(candidate, neighbours)) continue;
      if (!best || candidate.num_agreeing > best->num_agreeing ||
          (candidate.num_agreeing == best->num_agreeing && candidate.spread < best->spread)) {
        best = candidate;
      }
    }
  }
  constexpr int kFewestAgreeing = 3;
  return best && best->num_agreeing >= kFewestAgreeing ? best : std::nullopt;
}

// The predicted position of a neighbour of a dot, from the part of the lattice that is known.
struct Prediction {
  Eigen::Vector2d pixel;
  double spacing_px;
  double tolerance;  // Tolerance relative to the spacing.
};

Prediction Predict(const Lattice& lattice, const std::vector<Ellipse>& dots, const LatticeCell& cell,
                   const LatticeCell& step, const Eigen::Vector2d& default_px) {
  const auto find = [&](const LatticeCell& at) -> const Eigen::Vector2d* {
    const auto entry = lattice.find(at);
    return entry == lattice.end() ? nullptr : &dots[entry->second].centre_px;
  };
  const LatticeCell side{-step.j, step.i};
  const Eigen::Vector2d& here = dots[lattice.at(cell)].centre_px;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double weights = 0;
  // The previous step is extrapolated, with its change if that is known.
  if (const Eigen::Vector2d* last = find(cell - step)) {
    Eigen::Vector2d expected = 2 * here - *last;
    double weight = 1;
    if (const Eigen::Vector2d* before_last = find(cell - step - step)) {
      expected = 3 * here - 3 * *last + *before_last;
      weight = 0.7;
    }
    sum += weight * expected;
    weights += weight;
  }
  // The same step in the adjacent rows is used as well.
  for (const int sign : {-1, 1}) {
    const LatticeCell beside = cell + LatticeCell{sign * side.i, sign * side.j};
    const Eigen::Vector2d* from = find(beside);
    const Eigen::Vector2d* to = find(beside + step);
    if (from != nullptr && to != nullptr) {
      sum += 1.5 * (here + *to - *from);
      weights += 1.5;
    }
  }
  if (weights == 0) return {here + default_px, default_px.norm(), 0.3};
  const Eigen::Vector2d expected = sum / weights;
  return {expected, (expected - here).norm(), weights > 1.4 ? 0.2 : 0.25};
}

Lattice Grow(const std::vector<Ellipse>& dots, const DotIndex& index, const LatticeOptions& options, const Seed& seed) {
  Lattice lattice;
  std::set<int> used;
  struct Open {
    LatticeCell cell;
    Eigen::Vector2d i_px;
    Eigen::Vector2d j_px;
  };
  std::deque<Open> open;
  lattice[{0, 0}] = seed.dot;
  used.insert(seed.dot);
  open.push_back({{0, 0}, seed.i_px, seed.j_px});
  while (!open.empty()) {
    Open current = open.front();
    open.pop_front();
    const int dot = lattice.at(current.cell);
    for (const LatticeCell& step : kSteps) {
      const LatticeCell cell = current.cell + step;
      if (lattice.count(cell) > 0) continue;
      const Eigen::Vector2d default_px = step.i * current.i_px + step.j * current.j_px;
      const Prediction prediction = Predict(lattice, dots, current.cell, step, default_px);
      const double reach_px = prediction.tolerance * prediction.spacing_px;
      int best = -1;
      double best_distance = std::numeric_limits<double>::infinity();
      for (const int other : index.Near(prediction.pixel, reach_px)) {
        if (used.count(other) > 0) continue;
        if (!AreAlike(dots[dot], dots[other], options.max_size_ratio)) continue;
        const double distance = (dots[other].centre_px - prediction.pixel).norm();
        if (distance < best_distance) {
          best_distance = distance;
          best = other;
        }
      }
      if (best < 0) continue;
      lattice[cell] = best;
      used.insert(best);
      Open next{cell, current.i_px, current.j_px};
      const Eigen::Vector2d step_px = dots[best].centre_px - dots[dot].centre_px;
      if (step.i != 0) {
        next.i_px = step.i * step_px;
      } else {
        next.j_px = step.j * step_px;
      }
      open.push_back(next);
    }
  }
  return lattice;
}

// Returns the first `max_lattices`, but only some of those that are nearly the same: a dot that was found twice
// yields two copies of its lattice.
std::vector<Lattice> WithoutCopies(const std::vector<Lattice>& lattices, size_t max_lattices) {
  constexpr int kMaxAlike = 3;
  std::vector<Lattice> kept;
  std::vector<std::set<int>> dots_of_kept;
  for (const Lattice& lattice : lattices) {
    if (kept.size() == max_lattices) break;
    std::set<int> dots;
    for (const auto& [cell, dot] : lattice) dots.insert(dot);
    int num_alike = 0;
    for (const std::set<int>& others : dots_of_kept) {
      size_t num_shared = 0;
      for (const int dot : dots) num_shared += others.count(dot);
      num_alike += 5 * num_shared > 4 * dots.size() && 50 * (others.size() - dots.size()) <= dots.size() ? 1 : 0;
    }
    if (num_alike >= kMaxAlike) continue;
    kept.push_back(lattice);
    dots_of_kept.push_back(std::move(dots));
  }
  return kept;
}

}  // namespace

std::vector<Lattice> GrowLattices(const std::vector<Ellipse>& dots, const LatticeOptions& options) {
  const DotIndex index(dots);
  std::vector<Seed> seeds;
  for (size_t n = 0; n < dots.size(); ++n) {
    const std::optional<Seed> seed = FindSeed(dots, index, options.max_size_ratio, static_cast<int>(n));
    if (seed) seeds.push_back(*seed);
  }
  std::stable_sort(seeds.begin(), seeds.end(), [](const Seed& a, const Seed& b) {
    return a.num_agreeing != b.num_agreeing ? a.num_agreeing > b.num_agreeing : a.spread < b.spread;
  });
  std::vector<Lattice> lattices;
  std::vector<int> num_uses(dots.size(), 0);
  int num_grown = 0;
  for (const Seed& seed : seeds) {
    // A dot that is already in two lattices is not used again; the first one may have had a wrong pair of directions.
    if (num_uses[seed.dot] >= 2) continue;
    constexpr int kMaxGrown = 300;
    if (++num_grown > kMaxGrown) break;
    Lattice lattice = Grow(dots, index, options, seed);
    if (static_cast<int>(lattice.size()) < options.min_dots) continue;
    for (const auto& [cell, dot] : lattice) ++num_uses[dot];
    lattices.push_back(std::move(lattice));
  }
  std::stable_sort(lattices.begin(), lattices.end(),
                   [](const Lattice& a, const Lattice& b) { return a.size() > b.size(); });
  return WithoutCopies(lattices, static_cast<size_t>(options.max_lattices));
}

std::optional<DotPrediction> PredictDot(const Lattice& lattice, const std::vector<Ellipse>& dots,
                                        const LatticeCell& cell) {
  Lattice others = lattice;
  others.erase(cell);
  DotPrediction mean;
  int num = 0;
  for (const LatticeCell& step : kSteps) {
    const LatticeCell from = cell - step;
    if (others.count(from) == 0) continue;
    const Prediction prediction = Predict(others, dots, from, step, Eigen::Vector2d::Zero());
    if (!(prediction.spacing_px > 0)) continue;
    mean.pixel += prediction.pixel;
    mean.spacing_px += prediction.spacing_px;
    ++num;
  }
  if (num == 0) return std::nullopt;
  mean.pixel /= num;
  mean.spacing_px /= num;
  return mean;
}

std::vector<LatticePlacement> PlacePattern(const Lattice& lattice, const std::vector<LatticeCell>& pattern) {
  std::map<std::vector<int>, LatticePlacement> placements;
  if (pattern.empty() || lattice.size() < pattern.size()) return {};
  std::vector<LatticeCell> turned = pattern;
  for (int quarter = 0; quarter < 4; ++quarter) {
    for (const auto& [anchor, anchor_dot] : lattice) {
      const LatticeCell shift = anchor - turned.front();
      std::vector<int> order;
      for (const LatticeCell& cell : turned) {
        const auto entry = lattice.find(cell + shift);
        if (entry == lattice.end()) break;
        order.push_back(entry->second);
      }
      if (order.size() != turned.size()) continue;
      std::vector<int> key = order;
      std::sort(key.begin(), key.end());
      placements[key].orders.push_back(std::move(order));
    }
    for (LatticeCell& cell : turned) cell = {-cell.j, cell.i};
  }
  std::vector<LatticePlacement> result;
  for (auto& [key, placement] : placements) result.push_back(std::move(placement));
  return result;
}

}  // namespace heba
