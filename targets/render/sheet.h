// The sheet to print: a target's drawing true to scale, and the places of its points on it.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "targets/drawing.h"
#include "targets/target.h"

namespace heba {

struct SheetOptions {
  double dpi = 300;  // Of a PNG; the other formats have none.
  double margin_mm = 5;
  // The small print: what the target is. Empty: its type, its number of points and its size.
  std::string caption;
  // Every violated constraint, one a line; empty if the options are valid.
  [[nodiscard]] std::string Check() const;
};

struct SheetPoint {
  int id = 0;
  Eigen::Vector3d in_target = Eigen::Vector3d::Zero();  // m
  Eigen::Vector2d page_mm = Eigen::Vector2d::Zero();    // Right and down from the sheet's top-left corner.
};

// The drawing reads right on it (y_up drawings are turned over); below it runs a strip with a ruler and the small
// print.
struct Sheet {
  Drawing drawing;
  std::vector<SheetPoint> points;
  Eigen::Vector2d page_mm = Eigen::Vector2d::Zero();  // Width and height, the strip included.
  double strip_mm = 0;                                // Height of the strip at the bottom.
  double ruler_mm = 0;                                // 100: a smaller target's page is wider than the target.
  SheetOptions options;

  Eigen::Vector2d PageFromTarget(const Eigen::Vector2d& point_in_target_m) const;
};

Sheet MakeSheet(const Target& target, const SheetOptions& options = {});

// Writes the sheet as .svg, .pdf or .png, by the suffix of `path`, whole or not at all; the same sheet gives the same
// bytes. Page point (x, y) mm is at pixel x * dpi / 25.4 - 0.5 of the PNG, which is rounded up to whole pixels and says
// its resolution (pHYs). InputError if the suffix is another, the PNG would have more than 32767 pixels a side, or the
// file cannot be written.
void WriteSheet(const Sheet& sheet, const std::filesystem::path& path);

// SHEET.json (README, "Commands") of the sheet written to `path`: its suffix decides whether there is a dpi.
std::string SheetJson(const Sheet& sheet, const std::filesystem::path& path);

}  // namespace heba
