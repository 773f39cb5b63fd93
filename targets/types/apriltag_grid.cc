// A grid of AprilTags in Kalibr's geometry, or a single tag. Frame: origin at the outer bottom-left corner of the
// first tag, x to the right, y up, z out of the sheet. Tags are numbered row by row from the bottom left. Point id =
// 4 * tag id + corner, with the corners counter-clockwise from the bottom left.
//
// A tag's corners are those of the quad that libapriltag reports: the outer edge of the black border. Tags of the
// families tagCircle..., tagCustom... and tagStandard... have cells outside of that quad, which is the inner one of a
// black ring: `tag_size` is the quad's side for them too, not the side of the printed tag.
#include <algorithm>
#include <optional>
#include <utility>

#include <Eigen/Geometry>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/config/yaml_reader.h"
#include "heba/target.h"
#include "targets/numbered_grid.h"
#include "targets/table_choice.h"
#include "targets/tags/tag_codes.h"
#include "targets/tags/tag_layout.h"
#include "targets/tags/tag_search.h"
#include "targets/types/likely_misconfigurations.h"

namespace heba {
namespace {

class AprilTagGrid final : public Target {
 public:
  AprilTagGrid(TagFamily family, const TagGridGeometry& geometry)
      : geometry_(geometry),
        max_bit_errors_(MaxBitErrors(*family)),
        family_(std::move(family), geometry, max_bit_errors_) {
    const double size_m = geometry_.tag_size_m;
    layout_.pitch_m = size_m * (1 + geometry_.tag_spacing_ratio);
    for (int index = 0; index < geometry_.rows * geometry_.columns; ++index) {
      const int row = index / geometry_.columns;
      const int column = index % geometry_.columns;
      const Eigen::Vector2d first(column * layout_.pitch_m, row * layout_.pitch_m);
      layout_.corners_m.push_back({first, first + Eigen::Vector2d(size_m, 0), first + Eigen::Vector2d(size_m, size_m),
                                   first + Eigen::Vector2d(0, size_m)});
      for (size_t corner = 0; corner < 4; ++corner) {
        const Eigen::Vector2d& at_m = layout_.corners_m.back()[corner];
        points_.push_back({geometry_.PointId(index, corner), {at_m.x(), at_m.y(), 0}});
      }
    }
    drawing_ = MakeDrawing();
  }

  std::string_view type() const override { return "apriltag_grid"; }
  const std::vector<TargetPoint>& points() const override { return points_; }

  std::vector<std::string> Codes() const override {
    std::vector<std::string> codes;
    for (int index = 0; index < geometry_.rows * geometry_.columns; ++index) {
      codes.push_back(geometry_.family + " " + std::to_string(geometry_.first_id + index));
    }
    return codes;
  }

  Detection Detect(const cv::Mat& grey) const override { return DetectTagGrid(grey, Grid()); }

  std::vector<TargetSettings> LikelyMisconfigurations(const cv::Mat& grey) const override {
    std::vector<TargetSettings> confusions =
        OtherFirstIds("first_id", SeenTagIds(grey, Grid()), geometry_.first_id, geometry_.rows * geometry_.columns);
    if (geometry_.rows != geometry_.columns) {
      confusions.push_back(RowsAndColumns(geometry_.columns, geometry_.rows));
    }
    const std::vector<TargetSettings> families = OtherNames("family", kTagFamilies, geometry_.family);
    confusions.insert(confusions.end(), families.begin(), families.end());
    confusions.push_back({{"border_bits", geometry_.border_bits == 1 ? "2" : "1"}});
    for (const char* spacing : {"0.1", "0.15", "0.2", "0.25", "0.3", "0.35", "0.4", "0.5"}) {
      confusions.push_back({{"tag_spacing", spacing}});
    }
    const std::vector<TargetSettings> grids = ConfusedGrids(geometry_.rows, geometry_.columns);
    confusions.insert(confusions.end(), grids.begin(), grids.end());
    return confusions;
  }
  const Drawing& Draw() const override { return drawing_; }
  TargetSettings UnitLengths() const override { return {{"tag_size", UnitLength(1, 1)}}; }

 private:
  TagGrid Grid() const { return {geometry_, family_, layout_, drawing_, max_bit_errors_}; }

  Drawing MakeDrawing() const {
    Drawing drawing;
    drawing.y_up = true;
    const double cell_m = geometry_.tag_size_m / family_.width();
    const double gap_m = geometry_.tag_size_m * geometry_.tag_spacing_ratio;
    const double outer_m = family_.NumOuterCells() * cell_m;
    // One cell of paper surrounds everything that is printed.
    const double rim_m = std::max(geometry_.corner_squares ? gap_m : 0.0, outer_m) + cell_m;
    const Eigen::Vector2d last_m = layout_.corners_m.back()[2];
    drawing.min_m = {-rim_m, -rim_m};
    drawing.max_m = {last_m.x() + rim_m, last_m.y() + rim_m};
    // Labels are in the gap below the tag, away from its corners.
    const double room_m = (layout_.corners_m.size() > 1 ? std::min(gap_m, rim_m) : rim_m) - outer_m;
    const double height_m = std::min(0.002, 0.3 * room_m);
    for (int index = 0; index < static_cast<int>(layout_.corners_m.size()); ++index) {
      const Eigen::Vector2d& first_m = layout_.corners_m[static_cast<size_t>(index)][0];
      for (const Eigen::AlignedBox2d& run : BlackRuns(index, first_m, cell_m)) {
        drawing.AddRectangle(run.min().x(), run.min().y(), run.max().x(), run.max().y(), 0);
      }
      const Eigen::Vector2d below_m(0.45 * geometry_.tag_size_m, -outer_m - 0.5 * (room_m + height_m));
      drawing.labels.push_back({std::to_string(geometry_.first_id + index), first_m + below_m, height_m});
    }
    if (geometry_.corner_squares) {
      for (int row = 0; row <= geometry_.rows; ++row) {
        for (int column = 0; column <= geometry_.columns; ++column) {
          const double x_m = column * layout_.pitch_m;
          const double y_m = row * layout_.pitch_m;
          drawing.AddRectangle(x_m - gap_m, y_m - gap_m, x_m, y_m, 0);
        }
      }
    }
    return drawing;
  }

  // Returns the runs of black cells in the rows of a tag. A run is one shape, so that no hairline shows between cells.
  std::vector<Eigen::AlignedBox2d> BlackRuns(int index, const Eigen::Vector2d& first_m, double cell_m) const {
    std::vector<Eigen::AlignedBox2d> runs;
    const int begin = -family_.NumOuterCells();
    const int end = family_.width() + family_.NumOuterCells();
    for (int y = begin; y < end; ++y) {
      // Cells count down from the top, the target's y up from the bottom.
      const double top_m = first_m.y() + (family_.width() - y) * cell_m;
      for (int x = begin; x < end; ++x) {
        if (!family_.IsBlack(index, x, y)) continue;
        const int run_begin = x;
        while (x < end && family_.IsBlack(index, x, y)) ++x;
        runs.emplace_back(Eigen::Vector2d(first_m.x() + run_begin * cell_m, top_m - cell_m),
                          Eigen::Vector2d(first_m.x() + x * cell_m, top_m));
      }
    }
    return runs;
  }

  TagGridGeometry geometry_;
  int max_bit_errors_;
  TagCodes family_;
  TagLayout layout_;
  std::vector<TargetPoint> points_;
  Drawing drawing_;
};

}  // namespace

std::unique_ptr<Target> CreateTarget_apriltag_grid(MapReader& reader) {
  const TagFamilyName* const entry = ReadChoice(reader, "family", kTagFamilies);
  const std::string name = entry->name;
  TagFamily family(*entry);
  const bool has_outer_cells = family.NumOuterCells() > 0;
  TagGridGeometry geometry;
  geometry.family = name;
  constexpr IntRange kTags = {1, 200};
  geometry.rows = reader.Int("rows", kTags);
  geometry.columns = reader.Int("columns", kTags);
  geometry.tag_size_m = reader.PositiveLength("tag_size");
  geometry.border_bits = reader.Int("border_bits", {1, 4}, 1);
  if (has_outer_cells && geometry.border_bits != 1) {
    reader.Get("border_bits").Fail("must be 1 for " + name + ", whose border lies between its cells");
  }
  geometry.tag_spacing_ratio = reader.Number("tag_spacing", 0.3);
  if (!(geometry.tag_spacing_ratio >= 0.01 && geometry.tag_spacing_ratio <= 10)) {
    reader.Get("tag_spacing").Fail("must be at least 0.01 and at most 10");
  }
  if (has_outer_cells && geometry.rows * geometry.columns > 1) {
    const double min_ratio = (2.0 * family.NumOuterCells() + 1) / family->width_at_border;
    if (geometry.tag_spacing_ratio < min_ratio) {
      const std::string fault = "tags of " + name +
                                " have cells outside of tag_size and need a tag_spacing of at least " +
                                Significant(min_ratio, 3);
      if (reader.Has("tag_spacing")) reader.Get("tag_spacing").Fail(fault);
      reader.value().Fail(fault);
    }
  }
  geometry.first_id = reader.Int("first_id", {0, 100000}, 0);
  const int num_needed = geometry.first_id + geometry.rows * geometry.columns;
  if (num_needed > static_cast<int>(family->ncodes)) {
    reader.Get("family").Fail(name + " has " + std::to_string(family->ncodes) + " tags; the target's last id is " +
                              std::to_string(num_needed - 1));
  }
  geometry.corner_squares = reader.Bool("corner_squares", !has_outer_cells);
  if (geometry.corner_squares && has_outer_cells) {
    reader.Get("corner_squares").Fail("must be false for " + name + ", which has cells where the squares would be");
  }
  return std::make_unique<AprilTagGrid>(std::move(family), geometry);
}

namespace {

// A family of tags with borders of some width.
struct TagBorder {
  const TagFamilyName* family;
  int bits;
  bool has_outer_cells;
};

// Returns the borders that are searched for in images of unknown targets.
std::vector<TagBorder> CommonBorders() {
  std::vector<TagBorder> borders;
  for (const TagFamilyName& entry : kTagFamilies) {
    // 16h5 is read in any clutter.
    if (std::string_view(entry.name) == "tag16h5") continue;
    const bool has_outer_cells = TagFamily(entry).NumOuterCells() > 0;
    for (const int bits : {1, 2}) {
      if (has_outer_cells && bits > 1) continue;
      borders.push_back({&entry, bits, has_outer_cells});
    }
  }
  return borders;
}

std::unique_ptr<TagCodes> CodesOf(const TagBorder& border) {
  // The codes of the largest families are not all used by any target.
  constexpr int kMostTags = 587;
  TagFamily family(*border.family);
  TagGridGeometry all;
  all.family = border.family->name;
  all.rows = 1;
  all.columns = std::min(kMostTags, static_cast<int>(family->ncodes));
  all.border_bits = border.bits;
  return std::make_unique<TagCodes>(std::move(family), all, 0);
}

// Returns the settings of a grid with corner squares, if the border allows them, and of one without. An empty
// `tag_spacing` is left out.
std::vector<TargetSettings> GridsOf(const TagBorder& border, int rows, int columns, int first_id,
                                    const std::string& tag_spacing) {
  std::vector<TargetSettings> grids;
  for (const bool has_squares : {true, false}) {
    if (has_squares && border.has_outer_cells) continue;
    TargetSettings grid = {{"family", border.family->name}};
    for (auto& setting : RowsAndColumns(rows, columns)) grid.push_back(std::move(setting));
    grid.emplace_back("tag_size", UnitLength(1, 1));
    if (!tag_spacing.empty()) grid.emplace_back("tag_spacing", tag_spacing);
    if (border.bits != 1) grid.emplace_back("border_bits", std::to_string(border.bits));
    if (first_id > 0) grid.emplace_back("first_id", std::to_string(first_id));
    if (!has_squares && !border.has_outer_cells) grid.emplace_back("corner_squares", "false");
    grids.push_back(std::move(grid));
  }
  return grids;
}

}  // namespace

std::vector<TargetSettings> ProposeTargets_apriltag_grid(const cv::Mat& grey) {
  const std::vector<TagBorder> borders = CommonBorders();
  std::vector<std::unique_ptr<TagCodes>> codes;
  std::vector<const TagCodes*> families;
  for (const TagBorder& border : borders) {
    codes.push_back(CodesOf(border));
    families.push_back(codes.back().get());
  }
  constexpr double kDecimate = 2;
  const std::vector<std::vector<SeenTag>> tags_of = TagCodes::DetectAll(families, grey, kDecimate);
  std::vector<TargetSettings> proposals;
  for (size_t k = 0; k < borders.size(); ++k) {
    const TagBorder& border = borders[k];
    const std::vector<SeenTag>& tags = tags_of[k];
    if (tags.empty()) continue;
    std::vector<SeenNumber> seen;
    int last = 0;
    for (const SeenTag& tag : tags) {
      seen.push_back({tag.index, CentreOf(tag.corners_px)});
      last = std::max(last, tag.index);
    }
    constexpr int kMostColumns = 30;
    const std::optional<NumberedGrid> grid = FindNumberedGrid(
        seen, kMostColumns, [](int index, int columns) { return Eigen::Vector2d(index % columns, index / columns); });
    if (!grid && tags.size() > 1) continue;
    if (!grid) {
      for (TargetSettings& single : GridsOf(border, 1, 1, last, "")) proposals.push_back(std::move(single));
      continue;
    }
    const double spacing = 1 / MedianSideInCells(tags, grid->pixel_from_cell) - 1;
    if (!(spacing > 0.01)) continue;
    const int rows = (last - grid->first) / grid->columns + 1;
    for (TargetSettings& whole : GridsOf(border, rows, grid->columns, grid->first, Fixed(spacing, 2))) {
      proposals.push_back(std::move(whole));
    }
    return proposals;
  }
  return proposals;
}

}  // namespace heba
