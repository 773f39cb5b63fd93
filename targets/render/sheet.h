// The sheet to print: the drawing of a target at true scale, with the positions of its points.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "heba/drawing.h"
#include "heba/target.h"

namespace heba {

struct SheetOptions {
  double dpi = 300;  // Resolution of a PNG; the other formats have none.
  double margin_mm = 5;
  // The description of the target in the small print. If empty, it states the type, the number of points and the
  // size.
  std::string caption;
  // Returns the violated constraints, one per line; empty if the options are valid.
  [[nodiscard]] std::string Check() const;
};

struct SheetPoint {
  int id = 0;
  Eigen::Vector3d in_target = Eigen::Vector3d::Zero();  // m
  Eigen::Vector2d page_mm = Eigen::Vector2d::Zero();    // Offset right and down from the sheet's top-left corner.
};

// A page with the drawing the right way round (y_up drawings are flipped), above a strip with a ruler and the small
// print.
struct Sheet {
  Drawing drawing;
  std::vector<SheetPoint> points;
  Eigen::Vector2d page_mm = Eigen::Vector2d::Zero();  // Width and height, including the strip.
  double strip_mm = 0;                                // Height of the strip at the bottom.
  double ruler_mm = 0;                                // Length of the ruler, 100; no page is narrower.
  SheetOptions options;

  Eigen::Vector2d PageFromTarget(const Eigen::Vector2d& point_in_target_m) const;
};

Sheet MakeSheet(const Target& target, const SheetOptions& options = {});

// Writes the sheet as .svg, .pdf or .png, by the suffix of `path`, completely or not at all; equal sheets give equal
// bytes. Page point (x, y) mm lies at pixel x * dpi / 25.4 - 0.5 of the PNG, which is rounded up to whole pixels and
// states its resolution (pHYs). Throws InputError if the suffix is another, the target is smaller than 1 mm, the page
// is larger than 20 m, the PNG would have more than 32767 pixels per side, or the file cannot be written.
void WriteSheet(const Sheet& sheet, const std::filesystem::path& path);

// Returns SHEET.json (docs/manual/commands.md) for the sheet written to `path`, whose suffix decides whether there is a
// dpi.
std::string SheetJson(const Sheet& sheet, const std::filesystem::path& path);

}  // namespace heba
