// A chessboard with ArUco markers in its white squares. Frame: origin at the target's outer top-left corner as
// printed, x to the right, y down, z into the sheet (the frame of OpenCV's CharucoBoard since 4.7). The points are
// the inner corners: id = row * (columns - 1) + column, at ((column + 1) square, (row + 1) square, 0).
//
// The square in the top-left corner is black. Targets drawn by OpenCV before 4.6 (`legacy_pattern`) have the black
// square in the bottom-left corner instead, which differs if the number of rows is even.
//
// Corners are predicted from the markers around them (targets/tags/aruco_markers.h), refined as saddles and measured by
// MeasureCorner.
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>

#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/config/yaml_reader.h"
#include "heba/geometry/homography.h"
#include "heba/target.h"
#include "targets/corners/corner_refinement.h"
#include "targets/images/image.h"
#include "targets/numbered_grid.h"
#include "targets/table_choice.h"
#include "targets/tags/aruco_dictionary.h"
#include "targets/tags/aruco_markers.h"
#include "targets/tags/tag_layout.h"
#include "targets/types/likely_misconfigurations.h"

namespace heba {
namespace {

// Returns the name of a dictionary without its size: the smaller dictionaries are the beginnings of the larger ones.
std::string MarkersName(const std::string& dictionary) {
  for (const std::string_view size : {"_50", "_100", "_250", "_1000"}) {
    if (dictionary.ends_with(size)) return dictionary.substr(0, dictionary.size() - size.size());
  }
  return dictionary;
}

struct CharucoGeometry {
  std::string dictionary;
  int rows = 0;
  int columns = 0;
  double square_m = 0;
  double marker_m = 0;
  bool legacy_pattern = false;
  int first_marker = 0;

  bool IsBlack(int row, int column) const {
    const bool top_left_black = !legacy_pattern || rows % 2 == 1;
    return ((row + column) % 2 == 0) == top_left_black;
  }
};

// Returns an image in which markers can be searched for, and corners compared with what is drawn: each speck of strong
// noise would be traced like a marker's outline, and hides the edges of a corner.
cv::Mat WithoutStrongNoise(const cv::Mat& grey) {
  constexpr double kStrongNoiseGrey = 8;
  if (NoiseGrey(grey) <= kStrongNoiseGrey) return grey;
  cv::Mat smooth;
  cv::GaussianBlur(grey, smooth, {}, 0.8);
  return smooth;
}

class Charuco final : public Target {
 public:
  Charuco(const CharucoGeometry& geometry, ArucoDictionary dictionary)
      : geometry_(geometry), dictionary_(std::move(dictionary)) {
    const double square_m = geometry_.square_m;
    for (int row = 0; row + 1 < geometry_.rows; ++row) {
      for (int column = 0; column + 1 < geometry_.columns; ++column) {
        points_.push_back({row * (geometry_.columns - 1) + column, {(column + 1) * square_m, (row + 1) * square_m, 0}});
      }
    }
    // Markers are numbered row by row from the top.
    const double gap_m = 0.5 * (square_m - geometry_.marker_m);
    for (int row = 0; row < geometry_.rows; ++row) {
      for (int column = 0; column < geometry_.columns; ++column) {
        if (geometry_.IsBlack(row, column)) continue;
        const Eigen::Vector2d first(column * square_m + gap_m, row * square_m + gap_m);
        const double m = geometry_.marker_m;
        // A marker's order is clockwise from its top-left corner.
        layout_.corners_m.push_back(
            {first, first + Eigen::Vector2d(m, 0), first + Eigen::Vector2d(m, m), first + Eigen::Vector2d(0, m)});
        marker_squares_.push_back({row, column});
      }
    }
    layout_.pitch_m = square_m * std::sqrt(2.0);
    drawing_ = MakeDrawing();
  }

  std::string_view type() const override { return "charuco"; }
  const std::vector<TargetPoint>& points() const override { return points_; }

  std::vector<std::string> Codes() const override {
    std::vector<std::string> codes;
    for (size_t index = 0; index < marker_squares_.size(); ++index) {
      codes.push_back(MarkersName(geometry_.dictionary) + " " +
                      std::to_string(geometry_.first_marker + static_cast<int>(index)));
    }
    return codes;
  }

  Detection Detect(const cv::Mat& image) const override {
    const cv::Mat grey = WithoutStrongNoise(image);
    Detection detection;
    const ConsistentTags markers = KeepConsistent(FindMarkers(grey), layout_, 0);
    if (markers.tags.empty()) {
      detection.reason = "no marker of the target found";
      return detection;
    }
    std::vector<bool> seen(layout_.corners_m.size(), false);
    for (const SeenTag& tag : markers.tags) seen[static_cast<size_t>(tag.index)] = true;
    int missed = 0;
    for (const TargetPoint& point : points_) {
      const std::optional<MeasuredCorner> corner = FindCorner(grey, markers.tags, seen, point);
      if (corner) {
        detection.ids.push_back(point.id);
        detection.pixels.push_back(corner->pixel);
        detection.covariances_px2.emplace_back(corner->covariance_px2);
      } else {
        ++missed;
      }
    }
    constexpr int kEnoughToTell = 6;
    if (missed >= kEnoughToTell && missed > static_cast<int>(detection.ids.size()) &&
        2 * markers.tags.size() > layout_.corners_m.size()) {
      detection.reason = std::to_string(markers.tags.size()) + " markers of the target, but " + std::to_string(missed) +
                         " of " + std::to_string(points_.size()) +
                         " corners do not look as drawn: are rows, columns, square, marker and legacy_pattern right?";
    } else if (detection.ids.empty()) {
      detection.reason = std::to_string(markers.tags.size()) + " markers, but no corner between them could be measured";
    } else if (missed > 0) {
      detection.reason = std::to_string(missed) + " of " + std::to_string(points_.size()) + " corners not seen";
    }
    return detection;
  }

  std::vector<TargetSettings> LikelyMisconfigurations(const cv::Mat& grey) const override {
    std::vector<int> ids;
    for (const SeenTag& marker : AllMarkers(WithoutStrongNoise(grey))) ids.push_back(marker.index);
    std::vector<TargetSettings> confusions = OtherFirstIds("first_marker", std::move(ids), geometry_.first_marker,
                                                           static_cast<int>(layout_.corners_m.size()));
    confusions.push_back({{"legacy_pattern", geometry_.legacy_pattern ? "false" : "true"}});
    const std::vector<TargetSettings> grids = ConfusedGrids(geometry_.rows, geometry_.columns);
    confusions.insert(confusions.end(), grids.begin(), grids.end());
    const std::vector<TargetSettings> dictionaries = OtherNames("dictionary", kArucoDictionaries, geometry_.dictionary);
    confusions.insert(confusions.end(), dictionaries.begin(), dictionaries.end());
    return confusions;
  }
  const Drawing& Draw() const override { return drawing_; }
  TargetSettings UnitLengths() const override {
    return {{"square", UnitLength(1, 1)}, {"marker", UnitLength(geometry_.marker_m, geometry_.square_m)}};
  }

 private:
  Drawing MakeDrawing() const {
    Drawing drawing;
    const double square_m = geometry_.square_m;
    const double rim_m = 0.5 * square_m;
    drawing.min_m = {-rim_m, -rim_m};
    drawing.max_m = {geometry_.columns * square_m + rim_m, geometry_.rows * square_m + rim_m};
    for (int row = 0; row < geometry_.rows; ++row) {
      for (int column = 0; column < geometry_.columns; ++column) {
        if (!geometry_.IsBlack(row, column)) continue;
        drawing.AddRectangle(column * square_m, row * square_m, (column + 1) * square_m, (row + 1) * square_m, 0);
      }
    }
    for (size_t index = 0; index < layout_.corners_m.size(); ++index) {
      const int cells = dictionary_.size() + 2;  // With the border.
      const int marker = geometry_.first_marker + static_cast<int>(index);
      const Eigen::Vector2d& corner = layout_.corners_m[index][0];
      const double cell_m = geometry_.marker_m / cells;
      for (int row = 0; row < cells; ++row) {
        // A run of black cells is one shape, so that no hairline shows between them.
        for (int column = 0; column < cells;) {
          if (!dictionary_.IsBlack(marker, row, column)) {
            ++column;
            continue;
          }
          const int begin = column;
          while (column < cells && dictionary_.IsBlack(marker, row, column)) ++column;
          drawing.AddRectangle(corner.x() + begin * cell_m, corner.y() + row * cell_m, corner.x() + column * cell_m,
                               corner.y() + (row + 1) * cell_m, 0);
        }
      }
    }
    return drawing;
  }

  std::vector<SeenTag> FindMarkers(const cv::Mat& grey) const {
    std::vector<SeenTag> markers;
    for (SeenTag& marker : AllMarkers(grey)) {
      marker.index -= geometry_.first_marker;
      if (marker.index >= 0 && marker.index < static_cast<int>(layout_.corners_m.size())) markers.push_back(marker);
    }
    return markers;
  }

  std::vector<SeenTag> AllMarkers(const cv::Mat& grey) const { return FindArucoMarkers(grey, dictionary_).markers; }

  // Predicts a corner from the nearest markers, at least one of which must touch it, and refines it within its
  // squares.
  std::optional<MeasuredCorner> FindCorner(const cv::Mat& grey, const std::vector<SeenTag>& markers,
                                           const std::vector<bool>& seen, const TargetPoint& point) const {
    const int row = point.id / (geometry_.columns - 1);
    const int column = point.id % (geometry_.columns - 1);
    bool touched = false;
    for (size_t index = 0; index < marker_squares_.size(); ++index) {
      const auto [r, c] = marker_squares_[index];
      touched = touched || (seen[index] && r - row >= 0 && r - row <= 1 && c - column >= 0 && c - column <= 1);
    }
    if (!touched) return std::nullopt;
    const Eigen::Vector2d at_m = point.in_target.head<2>();
    constexpr size_t kNumNearest = 4;
    const std::optional<Eigen::Matrix3d> homography = LocalHomography(markers, layout_, at_m, kNumNearest);
    if (!homography) return std::nullopt;
    const Eigen::Vector2d predicted_px = ApplyHomography(*homography, at_m);
    // The nearest other feature is a marker's corner, on the diagonal.
    const double gap_m = 0.5 * (geometry_.square_m - geometry_.marker_m);
    double diagonal_px = std::numeric_limits<double>::infinity();
    double square_px = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector2d& direction : {Eigen::Vector2d(1, 1), Eigen::Vector2d(1, -1)}) {
      diagonal_px =
          std::min(diagonal_px, (ApplyHomography(*homography, at_m + gap_m * direction) - predicted_px).norm());
    }
    for (const Eigen::Vector2d& direction : {Eigen::Vector2d(1, 0), Eigen::Vector2d(0, 1)}) {
      square_px = std::min(square_px,
                           (ApplyHomography(*homography, at_m + geometry_.square_m * direction) - predicted_px).norm());
    }
    // Markers that nearly fill their squares leave less room than a saddle needs: its edges still outweigh theirs.
    constexpr double kMinReachPx = 4.7;
    const double reach_px = std::max(diagonal_px, kMinReachPx);
    if (square_px < 8) return std::nullopt;
    const double max_move_px = std::max(2.0, 0.15 * square_px);
    const std::optional<Eigen::Vector2d> saddle_px =
        RefineCorner(grey, predicted_px, std::min(reach_px, 0.5 * square_px), max_move_px);
    if (!saddle_px) return std::nullopt;
    return MeasureCorner(grey, drawing_, at_m, 0.5 * geometry_.square_m, *homography, *saddle_px);
  }

  CharucoGeometry geometry_;
  ArucoDictionary dictionary_;
  std::vector<TargetPoint> points_;
  TagLayout layout_;
  Drawing drawing_;
  std::vector<std::array<int, 2>> marker_squares_;  // Row and column of each marker's square.
};

// Returns the square of the marker with an index from 0, as (column, row), if the markers are in every other square.
Eigen::Vector2d SquareOfMarker(int index, int columns, bool is_first_black) {
  // Two rows have as many markers as columns; the first one has the smaller half if it begins with a black square.
  const int in_first = is_first_black ? columns / 2 : columns - columns / 2;
  const int pair = index / columns;
  const int rest = index % columns;
  const bool is_second = rest >= in_first;
  const int place = is_second ? rest - in_first : rest;
  const bool begins_black = is_first_black != is_second;
  return {2 * place + (begins_black ? 1 : 0), 2 * pair + (is_second ? 1 : 0)};
}

// Returns the smallest dictionary that has the markers of `whole`, of which it is the beginning, up to `last`.
const char* SmallestDictionary(const ArucoDictionaryName& whole, int last) {
  const std::string name = whole.name;
  if (!name.ends_with("_1000")) return whole.name;
  const std::string beginning = name.substr(0, name.rfind('_') + 1);
  for (const ArucoDictionaryName& entry : kArucoDictionaries) {
    const bool is_part = std::string_view(entry.name).starts_with(beginning);
    if (is_part && entry.num_markers > last) return entry.name;
  }
  return whole.name;
}

// Returns the markers up to their edges: their outlines run through the centres of their outermost pixels.
std::vector<SeenTag> UpToEdges(std::vector<SeenTag> markers) {
  constexpr double kInsidePx = 0.5;
  for (SeenTag& marker : markers) {
    const auto outline = marker.corners_px;
    for (size_t k = 0; k < 4; ++k) {
      for (const size_t neighbour : {(k + 1) % 4, (k + 3) % 4}) {
        marker.corners_px[k] += kInsidePx * (outline[k] - outline[neighbour]).normalized();
      }
    }
  }
  return markers;
}

// Returns the boards on which these markers of one dictionary lie.
std::vector<TargetSettings> BoardsOf(const std::vector<SeenTag>& markers, const ArucoDictionaryName& whole) {
  std::vector<SeenNumber> seen;
  int last = 0;
  for (const SeenTag& marker : markers) {
    seen.push_back({marker.index, CentreOf(marker.corners_px)});
    last = std::max(last, marker.index);
  }
  std::vector<TargetSettings> boards;
  for (const bool is_first_black : {true, false}) {
    constexpr int kMostColumns = 40;
    const std::optional<NumberedGrid> grid = FindNumberedGrid(
        seen, kMostColumns, [&](int index, int columns) { return SquareOfMarker(index, columns, is_first_black); });
    if (!grid || grid->columns < 2) continue;
    int rows = static_cast<int>(SquareOfMarker(last - grid->first, grid->columns, is_first_black).y()) + 1;
    // The top-left square of a legacy pattern is white only if the number of rows is even.
    if (!is_first_black) rows += rows % 2;
    const double ratio = MedianSideInCells(UpToEdges(markers), grid->pixel_from_cell);
    if (!(ratio > 0.2 && ratio < 0.98)) continue;
    TargetSettings board = RowsAndColumns(std::max(rows, 2), grid->columns);
    board.emplace_back("square", UnitLength(1, 1));
    board.emplace_back("marker", Fixed(ratio, 2) + " m");
    board.emplace_back("dictionary", SmallestDictionary(whole, last));
    if (!is_first_black) board.emplace_back("legacy_pattern", "true");
    if (grid->first > 0) board.emplace_back("first_marker", std::to_string(grid->first));
    boards.push_back(std::move(board));
  }
  return boards;
}

}  // namespace

std::vector<TargetSettings> ProposeTargets_charuco(const cv::Mat& grey) {
  // The dictionaries whose markers have as many cells, joined: the outlines of all markers are found once for each
  // size.
  struct Joined {
    ArucoDictionary markers;
    std::vector<std::pair<const ArucoDictionaryName*, int>> dictionaries;  // Each with the number of its first marker.
  };
  std::vector<Joined> of_sizes;
  for (const ArucoDictionaryName& entry : kArucoDictionaries) {
    // The smaller dictionaries are the beginnings of the largest of their kind. 16h5 is read in any clutter.
    const std::string_view name = entry.name;
    const bool is_part = name.ends_with("_50") || name.ends_with("_100") || name.ends_with("_250");
    if (is_part || name.ends_with("16h5")) continue;
    const auto alike = std::find_if(of_sizes.begin(), of_sizes.end(),
                                    [&](const Joined& joined) { return joined.markers.size() == entry.size; });
    if (alike == of_sizes.end()) {
      of_sizes.push_back({ArucoDictionary(entry), {{&entry, 0}}});
      continue;
    }
    alike->dictionaries.emplace_back(&entry, alike->markers.num_markers());
    alike->markers.Append(ArucoDictionary(entry));
  }
  std::vector<TargetSettings> proposals;
  // The outlines are searched for once, with the first dictionaries.
  const cv::Mat smooth = WithoutStrongNoise(grey);
  const ArucoMarkers found = FindArucoMarkers(smooth, of_sizes.front().markers);
  std::vector<TagCorners> outlines;
  for (const SeenTag& marker : found.markers) outlines.push_back(marker.corners_px);
  outlines.insert(outlines.end(), found.rejected.begin(), found.rejected.end());
  std::vector<SeenTag> all = found.markers;
  for (const Joined& joined : of_sizes) {
    if (&joined != &of_sizes.front()) {
      all.clear();
      for (const TagCorners& outline : outlines) {
        if (const std::optional<SeenTag> marker = ReadArucoMarker(smooth, outline, joined.markers)) {
          all.push_back(*marker);
        }
      }
    }
    int next = joined.markers.num_markers();
    for (auto part = joined.dictionaries.rbegin(); part != joined.dictionaries.rend(); ++part) {
      const auto& [dictionary, first] = *part;
      std::vector<SeenTag> markers;
      for (SeenTag marker : all) {
        if (marker.index < first || marker.index >= next) continue;
        marker.index -= first;
        markers.push_back(marker);
      }
      next = first;
      for (TargetSettings& board : BoardsOf(markers, *dictionary)) proposals.push_back(std::move(board));
    }
    if (!proposals.empty()) break;  // The markers of another kind do not lie as those of a board.
  }
  return proposals;
}

std::unique_ptr<Target> CreateTarget_charuco(MapReader& reader) {
  CharucoGeometry geometry;
  constexpr IntRange kSquares = {2, 100};
  geometry.rows = reader.Int("rows", kSquares);
  geometry.columns = reader.Int("columns", kSquares);
  geometry.square_m = reader.PositiveLength("square");
  geometry.marker_m = reader.PositiveLength("marker");
  if (geometry.marker_m >= geometry.square_m) reader.Get("marker").Fail("must be smaller than the square");
  const ArucoDictionaryName* const entry = ReadChoice(reader, "dictionary", kArucoDictionaries);
  geometry.dictionary = entry->name;
  geometry.legacy_pattern = reader.Bool("legacy_pattern", false);
  geometry.first_marker = reader.Int("first_marker", {0, 10000}, 0);
  const int num_markers = geometry.rows * geometry.columns / 2;
  if (geometry.first_marker + num_markers > entry->num_markers) {
    reader.Get("dictionary")
        .Fail(std::string(entry->name) + " has " + std::to_string(entry->num_markers) + " markers; the target needs " +
              std::to_string(geometry.first_marker + num_markers));
  }
  return std::make_unique<Charuco>(geometry, ArucoDictionary(*entry));
}

}  // namespace heba
