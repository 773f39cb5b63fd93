#include "targets/render/sheet.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <new>
#include <string_view>

#include <cairo-pdf.h>
#include <cairo-svg.h>
#include <cairo.h>
#include <nlohmann/json.hpp>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "targets/render/cairo_status.h"
#include "targets/render/sheet_layout.h"
#include "targets/render/sheet_painter.h"
#include "targets/render/stroke_text.h"

namespace heba {
namespace {

constexpr double kMmPerInch = 25.4;
constexpr double kPointsPerMm = 72 / kMmPerInch;
constexpr int kMaxPixels = 32767;  // Limit for a side of a Cairo image.
constexpr size_t kMaxPages = 400;
// Rounds a number for display: no 12.000000000000002.
double Rounded(double value) { return std::round(value * 1e9) / 1e9 + 0.0; }

struct SurfaceDeleter {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
};
using Surface = std::unique_ptr<cairo_surface_t, SurfaceDeleter>;

// Cairo calls this function, which no exception may leave.
cairo_status_t Append(void* bytes, const unsigned char* data, unsigned int size) {
  try {
    static_cast<std::string*>(bytes)->append(reinterpret_cast<const char*>(data), size);
  } catch (const std::bad_alloc&) {
    return CAIRO_STATUS_NO_MEMORY;
  }
  return CAIRO_STATUS_SUCCESS;
}

// Draws all pages on `surface`, then finishes it.
void PaintAndFinish(const Surface& surface, double units_per_mm, const Sheet& sheet) {
  RequireCairo(cairo_surface_status(surface.get()));
  for (const SheetPage& page : sheet.pages) {
    PaintSheetPage(sheet, page, units_per_mm, surface.get());
    if (sheet.pages.size() > 1) cairo_surface_show_page(surface.get());
  }
  cairo_surface_finish(surface.get());
  RequireCairo(cairo_surface_status(surface.get()));
}

// Replaces the text between the first `before` and the next `after`.
void ReplaceBetween(std::string_view before, std::string_view after, const std::string& text, std::string* bytes) {
  const size_t found = bytes->find(before);
  CHECK_NE(found, std::string::npos);
  const size_t begin = found + before.size();
  bytes->replace(begin, bytes->find(after, begin) - begin, text);
}

std::string Svg(const Sheet& sheet) {
  // Cairo stores paths in units of 1/256: drawn in millimetres, they would be off by 2 um.
  constexpr double kUnitsPerMm = 100;
  const Eigen::Vector2d size = kUnitsPerMm * sheet.page_mm;
  std::string bytes;
  PaintAndFinish(Surface(cairo_svg_surface_create_for_stream(Append, &bytes, size.x(), size.y())), kUnitsPerMm, sheet);
  ReplaceBetween(" width=\"", "\"", RoundTrip(Rounded(sheet.page_mm.x())) + "mm", &bytes);
  ReplaceBetween(" height=\"", "\"", RoundTrip(Rounded(sheet.page_mm.y())) + "mm", &bytes);
  // Cairo numbers the surfaces of a process; a fixed id gives equal bytes for equal sheets.
  ReplaceBetween("<g id=\"", "\"", "sheet", &bytes);
  return bytes;
}

std::string Pdf(const Sheet& sheet) {
  const Eigen::Vector2d size = kPointsPerMm * sheet.page_mm;
  std::string bytes;
  const Surface surface(cairo_pdf_surface_create_for_stream(Append, &bytes, size.x(), size.y()));
  // The dates are fixed, so that equal sheets give equal bytes.
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_CREATE_DATE, "2000-01-01T00:00:00Z");
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_MOD_DATE, "2000-01-01T00:00:00Z");
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_CREATOR, "heba");
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_TITLE, sheet.options.title.c_str());
  PaintAndFinish(surface, kPointsPerMm, sheet);
  return bytes;
}

void AppendBigEndian(uint32_t value, std::string* bytes) {
  for (int shift = 24; shift >= 0; shift -= 8) bytes->push_back(static_cast<char>((value >> shift) & 0xff));
}

// Computes the checksum of a PNG chunk (CRC-32 of ISO 3309).
uint32_t Crc(std::string_view bytes) {
  uint32_t crc = 0xffffffffU;
  for (const char byte : bytes) {
    crc ^= static_cast<unsigned char>(byte);
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1U) != 0 ? 0xedb88320U : 0U);
  }
  return ~crc;
}

std::string Png(const Sheet& sheet) {
  const double pixels_per_mm = sheet.options.dpi / kMmPerInch;
  const auto whole = [](double pixels) { return static_cast<int>(std::ceil(pixels - 1e-6)); };
  const Eigen::Vector2d size = pixels_per_mm * sheet.page_mm;
  const Surface surface(cairo_image_surface_create(CAIRO_FORMAT_A8, whole(size.x()), whole(size.y())));
  RequireCairo(cairo_surface_status(surface.get()));
  PaintSheetPage(sheet, sheet.pages.front(), pixels_per_mm, surface.get());
  std::string bytes;
  RequireCairo(cairo_surface_write_to_png_stream(surface.get(), Append, &bytes));

  // Cairo does not write the resolution, so a chunk with it is inserted after the first one.
  constexpr size_t kEndOfHeader = 8 + 25;
  const uint32_t pixels_per_m = static_cast<uint32_t>(std::lround(1000 * pixels_per_mm));
  std::string resolution = "pHYs";
  AppendBigEndian(pixels_per_m, &resolution);
  AppendBigEndian(pixels_per_m, &resolution);
  resolution.push_back(1);  // The unit is the metre.
  std::string chunk;
  AppendBigEndian(static_cast<uint32_t>(resolution.size() - 4), &chunk);
  chunk += resolution;
  AppendBigEndian(Crc(resolution), &chunk);
  return bytes.insert(kEndOfHeader, chunk);
}

struct Format {
  std::string_view suffix;
  std::string (*encode)(const Sheet&);
  bool has_dpi;
  bool has_pages;
};
constexpr Format kFormats[] = {{".svg", Svg, false, false}, {".pdf", Pdf, false, true}, {".png", Png, true, false}};

const Format& FormatOf(const std::filesystem::path& path) {
  const std::string suffix = path.extension().string();
  for (const Format& format : kFormats) {
    if (format.suffix == suffix) return format;
  }
  throw InputError(path.string() + ": a sheet is written as .svg, .pdf or .png, not as '" + suffix + "'" +
                   DidYouMean(suffix, {".svg", ".pdf", ".png"}));
}

std::string ShownMm(double mm) { return RoundTrip(std::round(mm * 100) / 100); }
std::string ShownSize(const Eigen::Vector2d& size_mm) {
  return ShownMm(size_mm.x()) + " x " + ShownMm(size_mm.y()) + " mm";
}

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

// Sets the pages of one paper over which a sheet is spread, as few as possible. Each shows as much as it can, at equal
// steps, so that no page is a sliver: each ruler and the code are whole on one page.
void SpreadOver(const Paper& paper, Sheet* sheet) {
  const double frame_mm = sheet->options.margin_mm + kSheetFrameMm;
  size_t fewest = 0;
  for (const bool is_landscape : {false, true}) {
    const Eigen::Vector2d page_mm = paper.SizeMm(is_landscape);
    const Eigen::Vector2d room_mm = page_mm.array() - 2 * frame_mm;
    const Eigen::Array2d most_mm = room_mm.array() - kSheetOverlapMm;
    const Eigen::Array2d num_parts = ((sheet->size_mm.array() - kSheetOverlapMm) / most_mm - 1e-9).ceil();
    const int columns = static_cast<int>(std::clamp(num_parts.x(), 1.0, 1e4));
    const int rows = static_cast<int>(std::clamp(num_parts.y(), 1.0, 1e4));
    const size_t num_pages = static_cast<size_t>(rows) * static_cast<size_t>(columns);
    if (fewest > 0 && num_pages >= fewest) continue;
    fewest = num_pages;
    sheet->page_mm = page_mm;
    sheet->pages.clear();
    // More pages than can be written are not listed.
    if (num_pages > kMaxPages) {
      sheet->pages.resize(kMaxPages + 1);
      continue;
    }
    const Eigen::Vector2d part_mm = room_mm.cwiseMin(sheet->size_mm);
    const Eigen::Vector2d last_from_mm = sheet->size_mm - part_mm;
    for (int row = 0; row < rows; ++row) {
      for (int column = 0; column < columns; ++column) {
        const Eigen::Vector2d from_mm(last_from_mm.x() * column / std::max(columns - 1, 1),
                                      last_from_mm.y() * row / std::max(rows - 1, 1));
        const Eigen::Vector2d to_mm = (from_mm + part_mm).cwiseMin(sheet->size_mm);
        sheet->pages.push_back({row, column, from_mm, to_mm, Eigen::Vector2d::Constant(frame_mm)});
      }
    }
  }
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
    SpreadOver(*options.paper, &sheet);
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

void WriteSheet(const Sheet& sheet, const std::filesystem::path& path) {
  const Format& format = FormatOf(path);
  const double max_mm = sheet.size_mm.maxCoeff();
  const double drawn_mm = 1e3 * (sheet.drawing.max_m - sheet.drawing.min_m).minCoeff();
  constexpr double kLeastMm = 1;
  constexpr double kMostMm = 20000;
  if (!(drawn_mm >= kLeastMm && max_mm <= kMostMm)) {
    throw InputError(path.string() + ": a target of " + Significant(drawn_mm, 3) + " mm on a sheet of " +
                     Significant(max_mm, 3) + " mm cannot be printed; the limits are 1 mm and 20 m");
  }
  if (sheet.pages.size() > 1 && !format.has_pages) {
    const Paper& paper = *sheet.options.paper;
    throw InputError(path.string() + ": the sheet of " + ShownSize(sheet.size_mm) + " does not fit on " +
                     std::string(paper.name) + " (" + ShownSize(paper.SizeMm(false)) +
                     "); use a larger paper, or .pdf, which is spread over several pages");
  }
  if (sheet.pages.size() > kMaxPages) {
    throw InputError(path.string() + ": the sheet of " + ShownSize(sheet.size_mm) + " would need more than " +
                     std::to_string(kMaxPages) + " pages; use a larger paper");
  }
  if (format.has_dpi && max_mm * sheet.options.dpi / kMmPerInch > kMaxPixels) {
    throw InputError(path.string() + ": a sheet of " + Fixed(max_mm, 0) + " mm at " +
                     Significant(sheet.options.dpi, 6) + " dpi has more than " + std::to_string(kMaxPixels) +
                     " pixels per side; use at most " + Fixed(std::floor(kMaxPixels * kMmPerInch / max_mm), 0) +
                     " dpi, or .pdf");
  }
  WriteFileAtomically(path, format.encode(sheet));
}

std::string SheetJson(const Sheet& sheet, const std::filesystem::path& path) {
  nlohmann::ordered_json json;
  json["page_mm"] = {Rounded(sheet.page_mm.x()), Rounded(sheet.page_mm.y())};
  json["dpi"] = FormatOf(path).has_dpi ? nlohmann::ordered_json(sheet.options.dpi) : nlohmann::ordered_json();
  const bool is_spread = sheet.pages.size() > 1;
  if (is_spread) {
    json["pages"] = {{"rows", sheet.NumPageRows()}, {"columns", sheet.NumPageColumns()}};
  }
  json["points"] = nlohmann::ordered_json::array();
  for (const SheetPoint& point : sheet.points) {
    nlohmann::ordered_json entry;
    entry["id"] = point.id;
    entry["target_m"] = {Rounded(point.in_target.x()), Rounded(point.in_target.y()), Rounded(point.in_target.z())};
    if (is_spread) entry["page"] = point.page + 1;
    entry["page_mm"] = {Rounded(point.page_mm.x()), Rounded(point.page_mm.y())};
    json["points"].push_back(entry);
  }
  return json.dump(1) + "\n";
}

bool IsSheetJson(const std::string& text) {
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
  return json.is_object() && json.contains("page_mm") && json.contains("dpi") && json.contains("points");
}

}  // namespace heba
