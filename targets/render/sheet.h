// The sheet to print: the drawing of a target at true scale, with the positions of its points.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "heba/drawing.h"
#include "heba/target.h"
#include "targets/render/papers.h"
#include "targets/render/qr_code.h"

namespace heba {

struct SheetOptions {
  double dpi = 300;  // Resolution of a PNG; the other formats have none.
  // Blank at every border of a page, where printers do not print.
  double margin_mm = 5;
  // The title of a PDF and of the small print. If empty, it states the type and the number of points.
  std::string title;
  // The target's config as one line of YAML (TargetConfigLine), for the small print and the QR code; empty for neither.
  std::string config;
  // The paper to print on. Without it, the page is as large as the sheet.
  std::optional<Paper> paper;
  // Returns the violated constraints, one per line; empty if the options are valid.
  [[nodiscard]] std::string Check() const;
};

struct SheetPoint {
  int id = 0;
  Eigen::Vector3d in_target = Eigen::Vector3d::Zero();  // m
  int page = 0;                                         // Index in Sheet::pages.
  Eigen::Vector2d page_mm = Eigen::Vector2d::Zero();    // Offset right and down from that page's top-left corner.
};

// A page, which shows a rectangle of the sheet. Neighbouring pages overlap by 10 mm or more.
struct SheetPage {
  int row = 0;
  int column = 0;
  Eigen::Vector2d from_mm = Eigen::Vector2d::Zero();  // The rectangle, on the sheet.
  Eigen::Vector2d to_mm = Eigen::Vector2d::Zero();
  Eigen::Vector2d at_mm = Eigen::Vector2d::Zero();  // Position of the rectangle's top-left corner on the page.
};

// The sheet is the drawing, the right way round (y_up drawings are flipped), with marks at the origin and a ruler on
// its left, above a strip with a ruler, the small print and a QR code of the config. It has one page, whose top-left
// corner is that of the sheet, or it is spread over several.
struct Sheet {
  Drawing drawing;
  std::vector<SheetPoint> points;
  Eigen::Vector2d size_mm = Eigen::Vector2d::Zero();        // Width and height of the sheet.
  Eigen::Vector2d page_mm = Eigen::Vector2d::Zero();        // Width and height of a page.
  Eigen::Vector2d drawing_at_mm = Eigen::Vector2d::Zero();  // Top-left corner of the drawing on the sheet.
  double margin_mm = 0;                                     // Blank at the borders of the sheet.
  double strip_mm = 0;                                      // Height of the strip at the bottom, with the margin.
  double ruler_mm = 0;                                      // Length of the horizontal ruler, 100 or 50.
  double side_ruler_mm = 0;                                 // Length of the vertical ruler, 100 or 50.
  std::vector<std::string> small_print;                     // Its lines.
  std::optional<QrCode> code;
  std::vector<SheetPage> pages;  // Row by row.
  SheetOptions options;

  Eigen::Vector2d SheetFromTarget(const Eigen::Vector2d& point_in_target_m) const;
  int NumPageRows() const { return pages.back().row + 1; }
  int NumPageColumns() const { return pages.back().column + 1; }
};

// Lays out the sheet of a target; `options.Check()` must be empty. On a paper the sheet has one page, upright or on its
// side, if it fits; otherwise it is spread over pages of that paper, as few as possible, each of which shows as much as
// it can. Each ruler, the strip in its height, and the code are whole on one of them; Check() requires the room for it.
// Nothing is written, and no limit of WriteSheet (sheet_file.h) is checked.
Sheet MakeSheet(const Target& target, const SheetOptions& options = {});

// Returns the smallest paper on which the target has one page, from the series of the options' paper if that has one;
// nothing if there is none.
std::optional<Paper> SmallestPaper(const Target& target, const SheetOptions& options);

}  // namespace heba
