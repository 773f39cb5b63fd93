#include "targets/render/sheet.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "targets/render/sheet_layout.h"
#include "targets/render/stroke_text.h"

namespace heba {
namespace {

// Returns the paragraphs of the small print.
std::vector<std::string> SmallPrint(const Target& target, const SheetOptions& options) {
  const Drawing& drawing = target.Draw();
  std::string origin = "Origin: where the bars at the arrows x and y meet";
  for (const TargetPoint& point : target.points()) {
    if (point.in_target.norm() < 1e-9) origin += ", point " + std::to_string(point.id);
  }
  origin += drawing.y_up ? "; x right, y up, z out of the sheet." : "; x right, y down, z into the sheet.";
  std::vector<std::string> paragraphs = {options.title + ": " + ShownSize(1000 * (drawing.max_m - drawing.min_m)) +
                                             " with its border, " + std::to_string(target.points().size()) +
                                             " points. Print at 100 %, check both rulers.",
                                         origin};
  if (!options.config.empty()) paragraphs.push_back(options.config);
  return paragraphs;
}

// The extents of a sheet whose page has a given width.
struct Layout {
  double ruler_mm = 0;
  std::vector<std::string> small_print;
  double strip_mm = 0;                                      // Without the margin below it.
  Eigen::Vector2d least_page_mm = Eigen::Vector2d::Zero();  // The smallest page that holds it all.
};

constexpr double kRulersMm[] = {100, 50};

// Returns the side of the code with its quiet zone; 0 without a code.
double CodeMm(const std::optional<QrCode>& code) {
  return code ? (code->size + 2 * kQrQuietModules) * kSheetCodeModuleMm : 0;
}

// Returns the shorter side of what a page of several shows.
double ShortSideMm(const Paper& paper, const SheetOptions& options) {
  return std::min(paper.width_mm, paper.height_mm) - 2 * (options.margin_mm + kSheetFrameMm);
}

// Returns the layout on a page of this width, without margins; the width for the longest ruler of at most
// `longest_ruler_mm` if `width_mm` is not given.
Layout LayoutFor(const Target& target, const SheetOptions& options, const std::optional<QrCode>& code,
                 const std::optional<double>& width_mm, double longest_ruler_mm = kRulersMm[0]) {
  const double code_mm = CodeMm(code);
  const double code_room_mm = code ? code_mm + kSheetGapMm : 0;
  const Eigen::Vector2d drawing_mm = 1000 * (target.Draw().max_m - target.Draw().min_m);
  Layout layout;
  for (const double ruler_mm : kRulersMm) {
    if (ruler_mm > longest_ruler_mm) continue;
    layout.ruler_mm = ruler_mm;
    layout.least_page_mm.x() = kSheetBandMm + std::max(drawing_mm.x(), ruler_mm + 1 + code_room_mm);
    if (!width_mm || layout.least_page_mm.x() <= *width_mm) break;
  }
  const double print_mm = width_mm.value_or(layout.least_page_mm.x()) - kSheetBandMm - code_room_mm;
  for (const std::string& paragraph : SmallPrint(target, options)) {
    // A ruler's length is the least that a line has.
    for (std::string& line : BrokenLines(paragraph, std::max(print_mm, kRulersMm[1]) / kSheetLetterMm)) {
      layout.small_print.push_back(std::move(line));
    }
  }
  const double last_line_mm = kSheetPrintMm + kSheetLineMm * (static_cast<double>(layout.small_print.size()) - 1) + 1;
  layout.strip_mm = std::max(last_line_mm, code_mm);
  const double room_mm = drawing_mm.y() + kSheetMarkRoomMm + kSheetPlainRoomMm;
  layout.least_page_mm.y() = std::max(room_mm + layout.strip_mm, kRulersMm[1] + 1);
  return layout;
}

// A page of a paper, upright or on its long side.
struct PageChoice {
  Eigen::Vector2d page_mm;
  Layout layout;
};

// Returns the way in which the sheet fits on the paper with the most room to spare; nothing if it does not fit.
std::optional<PageChoice> FitOn(const Paper& paper, const Target& target, const SheetOptions& options,
                                const std::optional<QrCode>& code) {
  std::optional<PageChoice> best;
  double most_spare_mm = -1e-6;
  for (const bool is_landscape : {false, true}) {
    const Eigen::Vector2d page_mm = paper.SizeMm(is_landscape);
    const Eigen::Vector2d room_mm = page_mm.array() - 2 * options.margin_mm;
    const Layout layout = LayoutFor(target, options, code, room_mm.x());
    const double spare_mm = (room_mm - layout.least_page_mm).minCoeff();
    if (spare_mm < most_spare_mm) continue;
    most_spare_mm = spare_mm;
    best = {page_mm, layout};
  }
  return best;
}

struct Spread {
  Eigen::Vector2d page_mm = Eigen::Vector2d::Zero();
  std::vector<SheetPage> pages;
};

// Returns the pages of one paper over which a sheet is spread, as few as possible. Each shows as much as it can, at
// equal steps, so that no page is a sliver: each ruler and the code are whole on one page.
Spread SpreadOver(const Paper& paper, const Sheet& sheet) {
  const double frame_mm = sheet.options.margin_mm + kSheetFrameMm;
  Spread spread;
  size_t fewest = 0;
  for (const bool is_landscape : {false, true}) {
    const Eigen::Vector2d page_mm = paper.SizeMm(is_landscape);
    const Eigen::Vector2d room_mm = page_mm.array() - 2 * frame_mm;
    const Eigen::Array2d most_mm = room_mm.array() - kSheetOverlapMm;
    const Eigen::Array2d num_parts = ((sheet.size_mm.array() - kSheetOverlapMm) / most_mm - 1e-9).ceil();
    const int columns = static_cast<int>(std::clamp(num_parts.x(), 1.0, 1e4));
    const int rows = static_cast<int>(std::clamp(num_parts.y(), 1.0, 1e4));
    const size_t num_pages = static_cast<size_t>(rows) * static_cast<size_t>(columns);
    if (fewest > 0 && num_pages >= fewest) continue;
    fewest = num_pages;
    spread.page_mm = page_mm;
    spread.pages.clear();
    // More pages than can be written are not listed.
    if (num_pages > kMostSheetPages) {
      spread.pages.resize(kMostSheetPages + 1);
      continue;
    }
    const Eigen::Vector2d part_mm = room_mm.cwiseMin(sheet.size_mm);
    const Eigen::Vector2d last_from_mm = sheet.size_mm - part_mm;
    for (int row = 0; row < rows; ++row) {
      for (int column = 0; column < columns; ++column) {
        const Eigen::Vector2d from_mm(last_from_mm.x() * column / std::max(columns - 1, 1),
                                      last_from_mm.y() * row / std::max(rows - 1, 1));
        const Eigen::Vector2d to_mm = (from_mm + part_mm).cwiseMin(sheet.size_mm);
        spread.pages.push_back({row, column, from_mm, to_mm, Eigen::Vector2d::Constant(frame_mm)});
      }
    }
  }
  return spread;
}

// Returns the index of the page on which a position of the sheet is farthest from an edge.
int PageOf(const Sheet& sheet, const Eigen::Vector2d& at_mm) {
  int best = 0;
  double farthest_mm = -INFINITY;
  for (size_t i = 0; i < sheet.pages.size(); ++i) {
    const SheetPage& page = sheet.pages[i];
    const double inside_mm = std::min((at_mm - page.from_mm).minCoeff(), (page.to_mm - at_mm).minCoeff());
    if (inside_mm <= farthest_mm) continue;
    farthest_mm = inside_mm;
    best = static_cast<int>(i);
  }
  return best;
}

}  // namespace

std::string SheetOptions::Check() const {
  std::vector<std::string> faults;
  if (!(dpi >= 10 && dpi <= 10000)) faults.push_back("dpi must be from 10 to 10000");
  if (!(margin_mm >= 0 && margin_mm <= 1000)) faults.push_back("margin_mm must be from 0 to 1000");
  if (config.size() > kMaxQrBytes)
    faults.push_back("config must have at most " + std::to_string(kMaxQrBytes) + " bytes");
  if (paper) {
    // Of pages that the sheet is spread over, one shows the whole of the shorter ruler beside the band, and one the
    // code.
    const bool has_code = !config.empty() && config.size() <= kMaxQrBytes;
    const double least_mm =
        std::max(kSheetBandMm + kRulersMm[1] + 1, CodeMm(has_code ? std::optional(EncodeQr(config)) : std::nullopt));
    if (ShortSideMm(*paper, *this) < least_mm) {
      faults.push_back("paper must leave " + ShownMm(least_mm) +
                       " mm between its margins and the marks inside of them");
    }
  }
  return Join(faults, "\n");
}

Eigen::Vector2d Sheet::SheetFromTarget(const Eigen::Vector2d& point_in_target_m) const {
  const Eigen::Vector2d from_left_m = point_in_target_m - drawing.min_m;
  const double down_m = drawing.y_up ? drawing.max_m.y() - point_in_target_m.y() : from_left_m.y();
  return drawing_at_mm + 1000 * Eigen::Vector2d(from_left_m.x(), down_m);
}

Sheet MakeSheet(const Target& target, const SheetOptions& options) {
  CHECK(options.Check().empty()) << options.Check();
  Sheet sheet;
  sheet.drawing = target.Draw();
  sheet.options = options;
  if (sheet.options.title.empty()) {
    sheet.options.title = std::string(target.type()) + ", " + std::to_string(target.points().size()) + " points";
  }
  if (!options.config.empty()) sheet.code = EncodeQr(options.config);
  const std::optional<PageChoice> choice =
      options.paper ? FitOn(*options.paper, target, sheet.options, sheet.code) : std::nullopt;
  // On several pages, the frame of each page is the margin.
  const bool is_spread = options.paper && !choice;
  sheet.margin_mm = is_spread ? 0 : options.margin_mm;
  // Each ruler is whole on one page, whichever way the pages lie.
  const double side_room_mm = is_spread ? ShortSideMm(*options.paper, options) : INFINITY;
  const bool has_long_ruler = kSheetBandMm + kRulersMm[0] + 1 <= side_room_mm;
  Layout layout = choice ? choice->layout
                         : LayoutFor(target, sheet.options, sheet.code, /*width_mm=*/std::nullopt,
                                     kRulersMm[has_long_ruler ? 0 : 1]);
  // The strip is whole on one page too: a wider sheet has fewer lines of small print.
  constexpr double kWidthStepMm = 50;
  for (double width_mm = layout.least_page_mm.x(); layout.strip_mm > side_room_mm;) {
    width_mm += kWidthStepMm;
    layout = LayoutFor(target, sheet.options, sheet.code, width_mm, layout.ruler_mm);
    layout.least_page_mm.x() = std::max(layout.least_page_mm.x(), width_mm);
  }
  sheet.size_mm = choice ? choice->page_mm : Eigen::Vector2d(layout.least_page_mm.array() + 2 * sheet.margin_mm);
  sheet.ruler_mm = layout.ruler_mm;
  sheet.small_print = layout.small_print;
  sheet.strip_mm = layout.strip_mm + sheet.margin_mm;
  for (const double ruler_mm : {kRulersMm[1], kRulersMm[0]}) {
    const double room_mm = std::min(sheet.size_mm.y() - 2 * sheet.margin_mm, side_room_mm);
    if (ruler_mm + 1 <= room_mm) sheet.side_ruler_mm = ruler_mm;
  }
  // On paper the drawing is in the middle of the room beside the band and above the strip.
  const double above_mm = sheet.drawing.y_up ? kSheetPlainRoomMm : kSheetMarkRoomMm;
  sheet.drawing_at_mm = {sheet.margin_mm + kSheetBandMm, sheet.margin_mm + above_mm};
  if (choice) {
    const Eigen::Vector2d drawing_mm = 1000 * (sheet.drawing.max_m - sheet.drawing.min_m);
    const Eigen::Vector2d room_mm(
        sheet.size_mm.x() - 2 * sheet.margin_mm - kSheetBandMm,
        sheet.size_mm.y() - sheet.margin_mm - sheet.strip_mm - kSheetMarkRoomMm - kSheetPlainRoomMm);
    sheet.drawing_at_mm += 0.5 * (room_mm - drawing_mm);
  }
  if (is_spread) {
    Spread spread = SpreadOver(*options.paper, sheet);
    sheet.page_mm = spread.page_mm;
    sheet.pages = std::move(spread.pages);
  } else {
    sheet.page_mm = sheet.size_mm;
    sheet.pages = {{0, 0, Eigen::Vector2d::Zero(), sheet.size_mm, Eigen::Vector2d::Zero()}};
  }
  for (const TargetPoint& point : target.points()) {
    const Eigen::Vector2d at_mm = sheet.SheetFromTarget(point.in_target.head<2>());
    const int index = PageOf(sheet, at_mm);
    const SheetPage& page = sheet.pages[static_cast<size_t>(index)];
    sheet.points.push_back({point.id, point.in_target, index, at_mm - page.from_mm + page.at_mm});
  }
  return sheet;
}

std::optional<Paper> SmallestPaper(const Target& target, const SheetOptions& options) {
  const std::optional<QrCode> code = options.config.empty() ? std::nullopt : std::optional(EncodeQr(options.config));
  std::optional<Paper> smallest;
  for (const Paper& paper : Papers()) {
    if (!FitOn(paper, target, options, code)) continue;
    if (!options.paper || paper.series == options.paper->series) return paper;
    if (!smallest) smallest = paper;
  }
  return smallest;
}

}  // namespace heba
