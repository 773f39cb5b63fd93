// A grid of dots: symmetric (square), asymmetric as in OpenCV (odd rows shifted by half a pitch), or symmetric with
// one larger dot that makes the order unique (industrial_calibration's modified circle grid). Frame: origin at the
// first dot, x to the right along the columns, y down, z into the sheet. id = row * columns + column; in an
// asymmetric grid, the dot (row, column) is at ((2 column + row % 2) spacing, row spacing). The larger dot is the
// first one of the last row.
//
// All kinds are square lattices of neighbouring dots (the asymmetric one is rotated by 45 degrees), so that one
// search serves all: it finds dots (FindEllipses), then lattices among them (GrowLattices), and places the grid's
// pattern on a lattice (PlacePattern).
#include <algorithm>
#include <cmath>
#include <set>

#include <Eigen/Dense>

#include "heba/base/error.h"
#include "heba/base/median.h"
#include "heba/base/text.h"
#include "heba/config/yaml_reader.h"
#include "heba/geometry/homography.h"
#include "heba/target.h"
#include "targets/dots/circle_lattice.h"
#include "targets/dots/dot_grid.h"
#include "targets/dots/ellipse_finder.h"
#include "targets/dots/ellipse_refinement.h"
#include "targets/types/likely_misconfigurations.h"

namespace heba {
namespace {

struct CircleGridOptions : DotGrid {
  bool asymmetric = false;
  bool marker_dot = false;
  double dot_diameter_m = 0;
  double marker_diameter_m = 0;
};

std::string Count(size_t count, const std::string& what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

struct Dot : Ellipse {
  Eigen::Matrix2d centre_covariance_px2 = Eigen::Matrix2d::Zero();
};
// The dots of a grid in the order of its ids.
using Dots = std::vector<Dot>;

class CircleGrid final : public Target {
 public:
  explicit CircleGrid(const CircleGridOptions& options) : options_(options) {
    for (int row = 0; row < options_.rows; ++row) {
      for (int column = 0; column < options_.columns; ++column) {
        const int x = options_.asymmetric ? 2 * column + row % 2 : column;
        const int id = row * options_.columns + column;
        const bool is_marker = options_.marker_dot && id == MarkerId();
        points_.push_back({id,
                           {x * options_.spacing_m, row * options_.spacing_m, 0},
                           0.5 * (is_marker ? options_.marker_diameter_m : options_.dot_diameter_m)});
        // The steps of an asymmetric grid's lattice are along (1, 1) and (-1, 1).
        pattern_.push_back(options_.asymmetric ? LatticeCell{(x + row) / 2, (row - x) / 2} : LatticeCell{x, row});
      }
    }
    drawing_ = MakeDrawing();
  }

  std::string_view type() const override { return "circle_grid"; }
  const std::vector<TargetPoint>& points() const override { return points_; }

  std::vector<Rigid3d> Symmetries() const override {
    return options_.marker_dot ? std::vector<Rigid3d>{Rigid3d()} : PlaneSymmetries(points_);
  }

  // Adds the larger dot, or a row to an asymmetric grid: a rotation by 180 degrees maps an asymmetric grid onto
  // itself only if it exchanges shifted and other rows, which requires an even number of rows.
  TargetSettings WithoutSymmetry() const override {
    if (Symmetries().size() == 1) return {};
    if (!options_.asymmetric) return {{"marker_dot", "true"}};
    return {{"rows", std::to_string(options_.rows + 1)}};
  }

  std::vector<TargetSettings> LikelyMisconfigurations(const cv::Mat& /*grey*/) const override {
    std::vector<TargetSettings> confusions = ConfusedGrids(options_.rows, options_.columns);
    confusions.push_back({{"light_on_dark", options_.polarity == DotPolarity::kDarkOnLight ? "true" : "false"}});
    confusions.push_back({{"asymmetric", options_.asymmetric ? "false" : "true"}});
    if (!options_.asymmetric) confusions.push_back({{"marker_dot", options_.marker_dot ? "false" : "true"}});
    return confusions;
  }
  const Drawing& Draw() const override { return drawing_; }
  TargetSettings UnitLengths() const override {
    TargetSettings lengths = {{"spacing", UnitLength(1, 1)},
                              {"dot_diameter", UnitLength(options_.dot_diameter_m, options_.spacing_m)}};
    if (options_.marker_dot) {
      lengths.emplace_back("marker_diameter", UnitLength(options_.marker_diameter_m, options_.spacing_m));
    }
    return lengths;
  }

  Detection Detect(const cv::Mat& grey) const override {
    CHECK_EQ(grey.type(), CV_8UC1);
    EllipseFinderOptions finder_options;
    finder_options.polarity = options_.polarity;
    std::vector<Ellipse> dots;
    for (const FoundEllipse& found : FindEllipses(grey, finder_options)) dots.push_back(found.ellipse);
    LatticeOptions lattice_options;
    // Manufacturers differ about the size of the larger dot.
    if (options_.marker_dot)
      lattice_options.max_size_ratio *= 1.4 * options_.marker_diameter_m / options_.dot_diameter_m;

    Detection detection;
    const std::string needed = " of the " + Count(points_.size(), "dot");
    size_t num_seen = 0;
    std::string beyond;
    std::string fault;
    std::vector<Dots> orders;  // Orders of one set of dots.
    std::set<std::vector<int>> sets_seen;
    Dots others;  // Dots of lattices that are not this target's; parts of such lattices are not either.
    for (const Lattice& lattice : GrowLattices(dots, lattice_options)) {
      num_seen = std::max(num_seen, lattice.size());
      const std::vector<LatticePlacement> placements = PlacePattern(lattice, pattern_);
      if (placements.empty()) continue;
      if (placements.size() > 1 || GoesOn(lattice, dots, placements.front())) {
        if (beyond.empty()) {
          beyond = "the dots continue beyond " + std::to_string(options_.rows) + " rows of " +
                   std::to_string(options_.columns) + ": " + Count(lattice.size(), "dot") + " in a grid";
        }
        for (const auto& [cell, dot] : lattice) others.push_back({dots[dot]});
        continue;
      }
      std::vector<int> dot_set = placements.front().orders.front();
      std::sort(dot_set.begin(), dot_set.end());
      if (!sets_seen.insert(dot_set).second) continue;
      Dots candidate;
      for (const int dot : dot_set) candidate.push_back({dots[dot]});
      if (AreSame(candidate, others)) continue;
      Outcome<std::vector<Dots>> refined = Refine(grey, dots, placements.front());
      if (!refined) {
        if (fault.empty()) fault = refined.reason();
        continue;
      }
      if (!orders.empty() && !AreSame(orders.front(), refined->front())) {
        detection.reason = "there is more than one grid of " + std::to_string(options_.rows) + " rows of " +
                           std::to_string(options_.columns) + " dots";
        return detection;
      }
      if (orders.empty()) orders = *refined;
    }
    if (orders.empty()) {
      if (fault.empty()) fault = beyond;
      if (fault.empty() && num_seen >= points_.size()) {
        fault = Count(num_seen, "dot") + " seen in a grid, but not in " + std::to_string(options_.rows) + " rows of " +
                std::to_string(options_.columns) + (options_.asymmetric ? ", or mirrored" : "");
      }
      detection.reason = !fault.empty() ? fault
                                        : std::to_string(num_seen) + needed + " seen in a grid (" +
                                              Count(dots.size(), "dot") + " in the image)";
      return detection;
    }
    const Outcome<Dots> ordered = options_.marker_dot ? OrderByMarker(orders) : OrderByImage(orders);
    if (!ordered) {
      detection.reason = ordered.reason();
      return detection;
    }
    for (size_t n = 0; n < points_.size(); ++n) {
      detection.ids.push_back(points_[n].id);
      detection.pixels.push_back((*ordered)[n].centre_px);
      detection.covariances_px2.emplace_back((*ordered)[n].centre_covariance_px2);
    }
    return detection;
  }

 private:
  Drawing MakeDrawing() const {
    Drawing drawing;
    const Eigen::Vector2d last(points_.back().in_target.x(), points_.back().in_target.y());
    const double max_x_m = options_.asymmetric && options_.rows > 1 ? (2 * options_.columns - 1) * options_.spacing_m
                                                                    : (options_.columns - 1) * options_.spacing_m;
    const double margin_m = options_.spacing_m + 0.5 * std::max(options_.dot_diameter_m,
                                                                options_.marker_dot ? options_.marker_diameter_m : 0);
    drawing.min_m = Eigen::Vector2d(-margin_m, -margin_m);
    drawing.max_m = Eigen::Vector2d(max_x_m + margin_m, last.y() + margin_m);
    drawing.ground = options_.Ground();
    for (const TargetPoint& point : points_) {
      drawing.AddDisc(point.in_target.head<2>(), point.radius_m, options_.Ink());
    }
    return drawing;
  }

  int MarkerId() const { return (options_.rows - 1) * options_.columns; }

  // Returns whether the lattice continues beyond the pattern with more than a stray dot or two at the exact positions
  // of the next dots.
  bool GoesOn(const Lattice& lattice, const std::vector<Ellipse>& dots, const LatticePlacement& placement) const {
    const std::set<int> inside(placement.orders.front().begin(), placement.orders.front().end());
    Lattice grid;
    for (const auto& [cell, dot] : lattice) {
      if (inside.count(dot) > 0) grid[cell] = dot;
    }
    int num_beyond = 0;
    for (const auto& [cell, dot] : lattice) {
      if (inside.count(dot) > 0) continue;
      const std::optional<DotPrediction> prediction = PredictDot(grid, dots, cell);
      if (!prediction) continue;
      const double off_px = (prediction->pixel - dots[dot].centre_px).norm();
      if (off_px < 0.1 * prediction->spacing_px) ++num_beyond;
    }
    return num_beyond > std::max(1, std::min(options_.rows, options_.columns) / 3);
  }

  // Returns the refined dots in all orders of a placement, or the reason why they are not a grid.
  Outcome<std::vector<Dots>> Refine(const cv::Mat& grey, const std::vector<Ellipse>& dots,
                                    const LatticePlacement& placement) const {
    const std::vector<int>& first = placement.orders.front();
    std::vector<double> contrasts;
    Dots refined_dots(dots.size());
    size_t num_bad = 0;
    for (const int dot : first) {
      const Ellipse& start = dots[dot];
      RefineEllipseOptions refine_options;
      refine_options.max_margin_px = 0.6 * GapPx(dots, first, dot);
      const std::optional<RefinedEllipse> refined = RefineEllipse(grey, start, refine_options);
      const double sign = options_.polarity == DotPolarity::kLightOnDark ? 1 : -1;
      // A ragged outline is a reason for rejection only if it makes the centre uncertain.
      if (!refined || sign * refined->contrast_grey < 4 || refined->residual_ratio > 0.35 ||
          (refined->residual_ratio > 0.2 && refined->CentreStddevPx() > 0.02) || refined->visible_ratio < 0.7 ||
          refined->CentreStddevPx() > 0.25 ||
          std::abs(std::log(refined->ellipse.RadiusPx() / start.RadiusPx())) > 0.3 + 0.5 / start.RadiusPx()) {
        ++num_bad;
        continue;
      }
      refined_dots[dot] = {refined->ellipse, refined->centre_covariance_px2};
      contrasts.push_back(std::abs(refined->contrast_grey));
    }
    if (num_bad > 0) {
      return Failure{Count(num_bad, "dot") + " of " + std::to_string(first.size()) + " unclear or incomplete"};
    }
    if (*std::min_element(contrasts.begin(), contrasts.end()) < 0.15 * Median(contrasts)) {
      return Failure{"the dots differ too much in brightness to be one grid"};
    }
    std::vector<Dots> orders;
    for (const std::vector<int>& order : placement.orders) {
      Dots ordered;
      for (const int dot : order) ordered.push_back(refined_dots[dot]);
      orders.push_back(std::move(ordered));
    }
    if (!IsEven(orders.front())) return Failure{"the dots are not evenly spaced"};
    return orders;
  }

  // Returns whether more than half of the dots of `a` are among those of `b`. Several candidates for one dot coincide
  // after refinement.
  static bool AreSame(const Dots& a, const Dots& b) {
    size_t num_shared = 0;
    for (const Ellipse& dot : a) {
      num_shared += std::any_of(b.begin(), b.end(), [&](const Ellipse& other) {
        return (other.centre_px - dot.centre_px).norm() < 0.3 * dot.RadiusPx();
      });
    }
    return 2 * num_shared > a.size();
  }

  // Returns the gap between the outlines of `dot` and the nearest other dot.
  static double GapPx(const std::vector<Ellipse>& dots, const std::vector<int>& grid, int dot) {
    double gap_px = 1e6;
    for (const int other : grid) {
      if (other == dot) continue;
      const Eigen::Vector2d offset = dots[other].centre_px - dots[dot].centre_px;
      const Eigen::Vector2d direction = offset.normalized();
      const auto reach_px = [&](const Ellipse& ellipse) {
        return 1 / std::sqrt(direction.dot(ellipse.shape * direction));
      };
      gap_px = std::min(gap_px, offset.norm() - reach_px(dots[dot]) - reach_px(dots[other]));
    }
    return gap_px;
  }

  // Returns whether steps and sizes change as slowly as perspective and lens distortion make them.
  bool IsEven(const Dots& dots) const {
    Lattice lattice;
    for (size_t n = 0; n < dots.size(); ++n) lattice[pattern_[n]] = static_cast<int>(n);
    const auto find = [&](int i, int j) -> const Ellipse* {
      const auto entry = lattice.find({i, j});
      return entry == lattice.end() ? nullptr : &dots[entry->second];
    };
    for (const LatticeCell& cell : pattern_) {
      const Ellipse& here = *find(cell.i, cell.j);
      for (const auto& [i, j] : {std::pair{1, 0}, std::pair{0, 1}}) {
        const Ellipse* next = find(cell.i + i, cell.j + j);
        const Ellipse* last = find(cell.i - i, cell.j - j);
        if (next == nullptr || last == nullptr) continue;
        const double bend_px = (next->centre_px - 2 * here.centre_px + last->centre_px).norm();
        if (bend_px > 0.1 * (next->centre_px - last->centre_px).norm()) return false;
      }
      const Ellipse* right = find(cell.i + 1, cell.j);
      const Ellipse* below = find(cell.i, cell.j + 1);
      const Ellipse* across = find(cell.i + 1, cell.j + 1);
      if (right == nullptr || below == nullptr || across == nullptr) continue;
      const double twist_px = (here.centre_px + across->centre_px - right->centre_px - below->centre_px).norm();
      if (twist_px > 0.1 * (across->centre_px - here.centre_px).norm()) return false;
    }
    const std::vector<double> sizes = EvenSizes(dots);
    if (sizes.empty()) return false;
    // The larger dot may have any size.
    const double median = Median(sizes);
    int num_unlike = 0;
    for (const double size : sizes) num_unlike += size > 1.35 * median || size < median / 1.35 ? 1 : 0;
    return num_unlike <= (options_.marker_dot ? 1 : 0);
  }

  // Returns the dots' radii with the perspective removed, m; empty if no homography fits.
  std::vector<double> EvenSizes(const Dots& dots) const {
    std::vector<Eigen::Vector2d> plane;
    std::vector<Eigen::Vector2d> image;
    for (size_t n = 0; n < dots.size(); ++n) {
      plane.emplace_back(points_[n].in_target.head<2>());
      image.push_back(dots[n].centre_px);
    }
    const std::optional<Eigen::Matrix3d> pixel_from_plane = FitHomography(plane, image);
    if (!pixel_from_plane) return {};
    std::vector<double> sizes;
    for (size_t n = 0; n < dots.size(); ++n) {
      const double scale = AreaScale(*pixel_from_plane, plane[n]);
      if (!(scale > 0)) return {};
      sizes.push_back(dots[n].RadiusPx() / std::sqrt(scale));
    }
    return sizes;
  }

  // Returns the order in which the larger dot is at its position.
  Outcome<Dots> OrderByMarker(const std::vector<Dots>& orders) const {
    const double marker_ratio = options_.marker_diameter_m / options_.dot_diameter_m;
    for (const Dots& order : orders) {
      const std::vector<double> sizes = EvenSizes(order);
      if (sizes.empty()) continue;
      const auto largest = std::max_element(sizes.begin(), sizes.end());
      if (largest - sizes.begin() != MarkerId()) continue;
      // The threshold is the geometric mean of the expected sizes of the larger dot and of the others.
      if (*largest < std::sqrt(marker_ratio) * Median(sizes)) break;
      return order;
    }
    return Failure{"all dots were seen, but none in a corner is larger than the others"};
  }

  // Returns the order whose first row points most nearly to the right of the image. Any order would do: the robot's
  // poses determine the correct one.
  Outcome<Dots> OrderByImage(const std::vector<Dots>& orders) const {
    const auto upright = [&](const Dots& order) {
      return (order[options_.columns - 1].centre_px - order[0].centre_px).normalized().x();
    };
    return *std::max_element(orders.begin(), orders.end(),
                             [&](const Dots& a, const Dots& b) { return upright(a) < upright(b); });
  }

  CircleGridOptions options_;
  std::vector<TargetPoint> points_;
  std::vector<LatticeCell> pattern_;  // Lattice cell of each point.
  Drawing drawing_;
};

}  // namespace

std::unique_ptr<Target> CreateTarget_circle_grid(MapReader& reader) {
  CircleGridOptions options{ReadDotGrid(reader)};
  options.asymmetric = reader.Bool("asymmetric", false);
  options.marker_dot = reader.Bool("marker_dot", false);
  if (options.asymmetric && options.marker_dot) {
    reader.Get("marker_dot").Fail("requires a symmetric grid");
  }
  // The distance between neighbouring dots.
  const double pitch_m = options.asymmetric ? std::sqrt(2.0) * options.spacing_m : options.spacing_m;
  options.dot_diameter_m = reader.PositiveLength("dot_diameter", 0.5 * pitch_m);
  if (options.dot_diameter_m > 0.95 * pitch_m) {
    reader.Get("dot_diameter").Fail("the dots touch: it must be at most 0.95 of the distance between their centres");
  }
  if (options.marker_dot) {
    options.marker_diameter_m = reader.PositiveLength("marker_diameter", 1.5 * options.dot_diameter_m);
    if (options.marker_diameter_m < 1.2 * options.dot_diameter_m ||
        0.5 * (options.marker_diameter_m + options.dot_diameter_m) > 0.95 * pitch_m) {
      const std::optional<ConfigValue> given = reader.Find("marker_diameter");
      (given ? *given : reader.Get("dot_diameter"))
          .Fail("the larger dot must be at least 1.2 times as large as the others and not touch its neighbours");
    }
  }
  return std::make_unique<CircleGrid>(options);
}

std::vector<TargetSettings> ProposeTargets_circle_grid(const cv::Mat& grey) {
  std::vector<TargetSettings> proposals;
  for (const DotPolarity polarity : {DotPolarity::kDarkOnLight, DotPolarity::kLightOnDark}) {
    EllipseFinderOptions finder_options;
    finder_options.polarity = polarity;
    std::vector<Ellipse> dots;
    for (const FoundEllipse& found : FindEllipses(grey, finder_options)) dots.push_back(found.ellipse);
    constexpr int kFewestDots = 6;
    LatticeOptions lattice_options;
    lattice_options.min_dots = kFewestDots;
    const std::vector<Lattice> lattices = GrowLattices(dots, lattice_options);
    if (lattices.empty()) continue;
    const Lattice& lattice = lattices.front();
    const auto num_dots = static_cast<int>(lattice.size());
    std::vector<double> shares;  // Diameters, as shares of the distance to the next dot.
    LatticeCell least = lattice.begin()->first;
    LatticeCell most = least;
    for (const auto& [cell, dot] : lattice) {
      least = {std::min(least.i, cell.i), std::min(least.j, cell.j)};
      most = {std::max(most.i, cell.i), std::max(most.j, cell.j)};
      const auto next = lattice.find({cell.i + 1, cell.j});
      if (next == lattice.end()) continue;
      const Ellipse& here = dots[static_cast<size_t>(dot)];
      shares.push_back(2 * here.RadiusPx() /
                       (here.centre_px - dots[static_cast<size_t>(next->second)].centre_px).norm());
    }
    if (shares.empty()) continue;
    // Perspective shortens distances and dots alike in one direction only, so the share is a rough one.
    const double share = std::clamp(Median(shares), 0.1, 0.9);
    const auto add = [&](int rows, int columns, bool is_asymmetric, bool has_marker) {
      TargetSettings grid = RowsAndColumns(rows, columns);
      grid.emplace_back("spacing", UnitLength(1, 1));
      grid.emplace_back("dot_diameter", Fixed(is_asymmetric ? std::sqrt(2.0) * share : share, 2) + " m");
      if (is_asymmetric) grid.emplace_back("asymmetric", "true");
      if (has_marker) grid.emplace_back("marker_dot", "true");
      if (polarity == DotPolarity::kLightOnDark) grid.emplace_back("light_on_dark", "true");
      proposals.push_back(std::move(grid));
    };
    const int rows = std::min(most.i - least.i, most.j - least.j) + 1;
    const int columns = std::max(most.i - least.i, most.j - least.j) + 1;
    if (rows >= 2 && rows * columns == num_dots) {
      add(rows, columns, false, false);
    } else if (rows >= 2 && rows * columns == num_dots + 1) {
      // The larger dot is not a part of the lattice.
      add(rows, columns, false, true);
    } else {
      for (int factor = 2; factor * 2 <= num_dots; ++factor) {
        if (num_dots % factor == 0) add(num_dots / factor, factor, true, false);
      }
    }
  }
  return proposals;
}

}  // namespace heba
