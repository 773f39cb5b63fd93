// The sheet to print: the drawing of a target at true scale, with the positions of its points.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "heba/drawing.h"
#include "heba/target.h"

namespace heba {

struct PaperSize {
  std::string_view name;
  double width_mm;
  double height_mm;
};

// The sizes of paper, from small to large; each in portrait format.
inline constexpr PaperSize kPaperSizes[] = {{"a5", 148, 210},        {"letter", 215.9, 279.4},  {"a4", 210, 297},
                                            {"legal", 215.9, 355.6}, {"tabloid", 279.4, 431.8}, {"a3", 297, 420},
                                            {"a2", 420, 594},        {"a1", 594, 841},          {"a0", 841, 1189}};

struct SheetOptions {
  double dpi = 300;  // Resolution of a PNG; the other formats have none.
  double margin_mm = 5;
  // The description of the target in the small print. If empty, it states the type, the number of points and the
  // size.
  std::string caption;
  // The target's YAML on one line, which the sheet states as text and as a QR code; empty for neither.
  std::string config;
  // The paper, in portrait format; nothing for a page as large as the sheet.
  std::optional<Eigen::Vector2d> paper_mm;
  // Returns the violated constraints, one per line; empty if the options are valid.
  [[nodiscard]] std::string Check() const;
};

struct SheetPoint {
  int id = 0;
  Eigen::Vector3d in_target = Eigen::Vector3d::Zero();  // m
  Eigen::Vector2d page_mm = Eigen::Vector2d::Zero();    // Offset right and down from the sheet's top-left corner.
};

// The drawing the right way round (y_up drawings are flipped), with marks at its edges that point to its origin, above
// a strip with a ruler, the small print and the QR code, and left of a strip with a second ruler. On paper, it is
// centred on a page in the format that holds it, or else cut into tiles.
struct Sheet {
  Drawing drawing;
  std::vector<SheetPoint> points;
  Eigen::Vector2d page_mm = Eigen::Vector2d::Zero();     // Width and height; of the assembled sheet if it has tiles.
  Eigen::Vector2d content_mm = Eigen::Vector2d::Zero();  // Width and height of the drawing with its strips.
  Eigen::Vector2d offset_mm = Eigen::Vector2d::Zero();   // Top-left corner of the content on the page.
  double strip_mm = 0;                                   // Height of the strip at the bottom.
  double side_mm = 0;                                    // Width of the strip at the right.
  double ruler_mm = 0;                                   // Length of the ruler at the bottom, 100; no page is narrower.
  double side_ruler_mm = 0;                              // Length of the ruler at the right, 100 or 50.
  Eigen::Vector2i num_tiles = {1, 1};                    // Pages beside and below each other, each of tile_mm.
  Eigen::Vector2d tile_mm = Eigen::Vector2d::Zero();     // The paper of a tile; 0 without tiles.
  SheetOptions options;

  bool has_tiles() const { return num_tiles.prod() > 1; }
  Eigen::Vector2d PageFromTarget(const Eigen::Vector2d& point_in_target_m) const;
};

Sheet MakeSheet(const Target& target, const SheetOptions& options = {});

// Returns the smallest paper that holds the sheet on one page; null if none does.
const PaperSize* SmallestPaper(const Sheet& sheet);

// Writes the sheet as .svg, .pdf or .png, by the suffix of `path`, completely or not at all; equal sheets give equal
// bytes. Page point (x, y) mm lies at pixel x * dpi / 25.4 - 0.5 of the PNG, which is rounded up to whole pixels and
// states its resolution (pHYs). Throws InputError if the suffix is another, the target is smaller than 1 mm, the page
// is larger than 20 m, the PNG would have more than 32767 pixels per side, a sheet with tiles is not a .pdf, or
// the file cannot be written.
void WriteSheet(const Sheet& sheet, const std::filesystem::path& path);

// Returns SHEET.json (docs/manual/commands.md) for the sheet written to `path`, whose suffix decides whether there is a
// dpi.
std::string SheetJson(const Sheet& sheet, const std::filesystem::path& path);

}  // namespace heba
