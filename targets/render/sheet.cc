#include "targets/render/sheet.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string_view>

#include <cairo-pdf.h>
#include <cairo-svg.h>
#include <cairo.h>
#include <nlohmann/json.hpp>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/base/units.h"

namespace heba {
namespace {

constexpr double kMmPerInch = 25.4;
constexpr double kPointsPerMm = 72 / kMmPerInch;
constexpr int kMaxPixels = 32767;  // Limit for a side of a Cairo image.
// The strip has the ruler's ticks at the top, its numbers below them and the small print at the bottom.
constexpr double kStripMm = 14;
constexpr double kRulerMm = 100;
constexpr double kRulerTopMm = 2;
constexpr double kRulerNumbersMm = 7;
constexpr double kPrintMm = 12;
constexpr double kPrintHeightMm = 2.2;

// Rounds a number for display: no 12.000000000000002.
double Rounded(double value) { return std::round(value * 1e9) / 1e9 + 0.0; }

void Require(cairo_status_t status) {
  // Memory streams cannot fail, and the sizes have been checked.
  CHECK_EQ(status, CAIRO_STATUS_SUCCESS) << cairo_status_to_string(status);
}

cairo_status_t Append(void* bytes, const unsigned char* data, unsigned int size) {
  static_cast<std::string*>(bytes)->append(reinterpret_cast<const char*>(data), size);
  return CAIRO_STATUS_SUCCESS;
}

// A line of text as a path of height 1, drawn with Cairo's own strokes: it is the same on every machine, whatever
// fonts are installed.
class Text {
 public:
  explicit Text(const std::string& text) {
    // The surface has no bounds, since the path would omit what lies outside them.
    cairo_surface_t* const surface = cairo_recording_surface_create(CAIRO_CONTENT_ALPHA, nullptr);
    cairo_t* const context = cairo_create(surface);
    cairo_font_options_t* const options = cairo_font_options_create();
    cairo_font_options_set_hint_style(options, CAIRO_HINT_STYLE_NONE);
    cairo_font_options_set_hint_metrics(options, CAIRO_HINT_METRICS_OFF);
    cairo_set_font_options(context, options);
    cairo_font_options_destroy(options);
    cairo_select_font_face(context, "@cairo:", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    // Strokes become polygons at this size; at a large size the text would make up most of the file.
    constexpr double kSize = 4;
    cairo_set_font_size(context, kSize);
    cairo_text_extents_t extents;
    cairo_text_extents(context, text.c_str(), &extents);
    width_ = extents.x_advance / kSize;
    cairo_move_to(context, 0, 0);
    cairo_text_path(context, text.c_str());
    cairo_scale(context, kSize, kSize);
    path_ = cairo_copy_path(context);
    Require(cairo_status(context));
    cairo_destroy(context);
    cairo_surface_destroy(surface);
  }
  ~Text() { cairo_path_destroy(path_); }
  Text(const Text&) = delete;
  Text& operator=(const Text&) = delete;

  double width() const { return width_; }
  void AddTo(cairo_t* context) const { cairo_append_path(context, path_); }

 private:
  double width_ = 0;
  cairo_path_t* path_ = nullptr;
};

// Draws the sheet in millimetres.
class SheetPainter {
 public:
  // On a surface with one channel, coverage represents albedo.
  SheetPainter(cairo_surface_t* surface, double units_per_mm, const Sheet& sheet)
      : context_(cairo_create(surface)),
        one_channel_(cairo_surface_get_type(surface) == CAIRO_SURFACE_TYPE_IMAGE),
        sheet_(sheet) {
    cairo_set_antialias(context_, CAIRO_ANTIALIAS_BEST);
    // Curves are flattened to this tolerance in device units, far below the size of a printer's dots.
    cairo_set_tolerance(context_, 0.01);
    cairo_scale(context_, units_per_mm, units_per_mm);
    if (one_channel_) cairo_set_operator(context_, CAIRO_OPERATOR_SOURCE);
  }
  ~SheetPainter() { cairo_destroy(context_); }
  SheetPainter(const SheetPainter&) = delete;
  SheetPainter& operator=(const SheetPainter&) = delete;

  void Paint() {
    SetAlbedo(1);
    cairo_paint(context_);
    PaintTarget();
    PaintStrip();
    Require(cairo_status(context_));
  }

 private:
  void SetAlbedo(double albedo) {
    if (one_channel_) {
      cairo_set_source_rgba(context_, 0, 0, 0, albedo);
    } else {
      cairo_set_source_rgb(context_, albedo, albedo, albedo);
    }
  }

  void AddPath(const Shape& shape) {
    if (shape.points_m.empty()) {
      const Eigen::Vector2d centre_mm = sheet_.PageFromTarget(shape.centre_m);
      cairo_new_sub_path(context_);
      cairo_arc(context_, centre_mm.x(), centre_mm.y(), 1000 * shape.radius_m, 0, 2 * kPi);
      cairo_close_path(context_);
      return;
    }
    std::vector<Eigen::Vector2d> points_mm;
    for (const Eigen::Vector2d& point : shape.points_m) points_mm.push_back(sheet_.PageFromTarget(point));
    // All polygons get the orientation of the discs, so that the shapes of one path add up where they overlap.
    double twice_area = 0;
    for (size_t i = 0; i < points_mm.size(); ++i) {
      const Eigen::Vector2d& a = points_mm[i];
      const Eigen::Vector2d& b = points_mm[(i + 1) % points_mm.size()];
      twice_area += a.x() * b.y() - a.y() * b.x();
    }
    if (twice_area < 0) std::reverse(points_mm.begin(), points_mm.end());
    // Otherwise a line would lead here from the start of the previous shape.
    cairo_new_sub_path(context_);
    for (const Eigen::Vector2d& point_mm : points_mm) cairo_line_to(context_, point_mm.x(), point_mm.y());
    cairo_close_path(context_);
  }

  void PaintTarget() {
    const double strip_top_mm = sheet_.page_mm.y() - sheet_.strip_mm;
    cairo_save(context_);
    // The ground extends to the right as far as there is paper, since a PNG is rounded up to whole pixels.
    cairo_rectangle(context_, 0, 0, sheet_.page_mm.x() + kMmPerInch, strip_top_mm);
    cairo_clip(context_);
    SetAlbedo(sheet_.drawing.ground);
    cairo_paint(context_);
    // Consecutive shapes of the same albedo form one path; filled separately, they would show a seam.
    const std::vector<Shape>& shapes = sheet_.drawing.shapes;
    for (size_t i = 0; i < shapes.size(); ++i) {
      AddPath(shapes[i]);
      if (i + 1 < shapes.size() && shapes[i + 1].albedo == shapes[i].albedo) continue;
      SetAlbedo(shapes[i].albedo);
      cairo_fill(context_);
    }
    SetAlbedo(sheet_.drawing.ground < 0.5 ? 1 : 0);
    for (const Label& label : sheet_.drawing.labels) {
      const Eigen::Vector2d at_mm = sheet_.PageFromTarget(label.at_m);
      PaintText(Text(label.text), at_mm, 1000 * label.height_m);
    }
    cairo_restore(context_);
  }

  void PaintText(const Text& text, const Eigen::Vector2d& at_mm, double height_mm) {
    cairo_save(context_);
    cairo_translate(context_, at_mm.x(), at_mm.y());
    cairo_scale(context_, height_mm, height_mm);
    text.AddTo(context_);
    cairo_restore(context_);
    cairo_fill(context_);
  }

  void PaintStrip() {
    const double top_mm = sheet_.page_mm.y() - sheet_.strip_mm;
    const double left_mm = sheet_.options.margin_mm;
    SetAlbedo(0);
    constexpr double kLineMm = 0.15;
    cairo_set_line_width(context_, kLineMm);
    const int length_mm = static_cast<int>(sheet_.ruler_mm);
    for (int mm = 0; length_mm > 0 && mm <= length_mm; ++mm) {
      const double tick_mm = mm % 10 == 0 ? 3.0 : mm % 5 == 0 ? 2.2 : 1.4;
      cairo_move_to(context_, left_mm + mm, top_mm + kRulerTopMm);
      cairo_line_to(context_, left_mm + mm, top_mm + kRulerTopMm + tick_mm);
    }
    cairo_move_to(context_, left_mm - 0.5 * kLineMm, top_mm + kRulerTopMm);
    cairo_line_to(context_, left_mm + length_mm + 0.5 * kLineMm, top_mm + kRulerTopMm);
    cairo_stroke(context_);
    if (length_mm > 0) {
      PaintText(Text("0"), {left_mm, top_mm + kRulerNumbersMm}, kPrintHeightMm);
      const Text end(std::to_string(length_mm) + " mm");
      const double end_mm = left_mm + length_mm - end.width() * kPrintHeightMm;
      PaintText(end, {end_mm, top_mm + kRulerNumbersMm}, kPrintHeightMm);
    }
    // The small print is scaled down if it does not fit.
    const Text print(sheet_.options.caption);
    const double room_mm = sheet_.page_mm.x() - 2 * left_mm;
    PaintText(print, {left_mm, top_mm + kPrintMm}, std::min(kPrintHeightMm, room_mm / print.width()));
  }

  cairo_t* context_;
  bool one_channel_;
  const Sheet& sheet_;
};

// Draws on `surface`, then finishes and destroys it.
void PaintAndFinish(cairo_surface_t* surface, double units_per_mm, const Sheet& sheet) {
  Require(cairo_surface_status(surface));
  SheetPainter(surface, units_per_mm, sheet).Paint();
  cairo_surface_finish(surface);
  Require(cairo_surface_status(surface));
  cairo_surface_destroy(surface);
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
  PaintAndFinish(cairo_svg_surface_create_for_stream(Append, &bytes, size.x(), size.y()), kUnitsPerMm, sheet);
  ReplaceBetween(" width=\"", "\"", RoundTrip(Rounded(sheet.page_mm.x())) + "mm", &bytes);
  ReplaceBetween(" height=\"", "\"", RoundTrip(Rounded(sheet.page_mm.y())) + "mm", &bytes);
  // Cairo numbers the surfaces of a process; a fixed id gives equal bytes for equal sheets.
  ReplaceBetween("<g id=\"", "\"", "sheet", &bytes);
  return bytes;
}

std::string Pdf(const Sheet& sheet) {
  const Eigen::Vector2d size = kPointsPerMm * sheet.page_mm;
  std::string bytes;
  cairo_surface_t* const surface = cairo_pdf_surface_create_for_stream(Append, &bytes, size.x(), size.y());
  // The dates are fixed, so that equal sheets give equal bytes.
  cairo_pdf_surface_set_metadata(surface, CAIRO_PDF_METADATA_CREATE_DATE, "2000-01-01T00:00:00Z");
  cairo_pdf_surface_set_metadata(surface, CAIRO_PDF_METADATA_MOD_DATE, "2000-01-01T00:00:00Z");
  cairo_pdf_surface_set_metadata(surface, CAIRO_PDF_METADATA_CREATOR, "heba");
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
  cairo_surface_t* const surface = cairo_image_surface_create(CAIRO_FORMAT_A8, whole(size.x()), whole(size.y()));
  Require(cairo_surface_status(surface));
  SheetPainter(surface, pixels_per_mm, sheet).Paint();
  std::string bytes;
  Require(cairo_surface_write_to_png_stream(surface, Append, &bytes));
  cairo_surface_destroy(surface);

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
};
constexpr Format kFormats[] = {{".svg", Svg, false}, {".pdf", Pdf, false}, {".png", Png, true}};

const Format& FormatOf(const std::filesystem::path& path) {
  const std::string suffix = path.extension().string();
  for (const Format& format : kFormats) {
    if (format.suffix == suffix) return format;
  }
  throw InputError(path.string() + ": a sheet is written as .svg, .pdf or .png, not as '" + suffix + "'" +
                   DidYouMean(suffix, {".svg", ".pdf", ".png"}));
}

std::string DefaultCaption(const Target& target, const Drawing& drawing) {
  const Eigen::Vector2d size_mm = 1000 * (drawing.max_m - drawing.min_m);
  return std::string(target.type()) + ", " + std::to_string(target.points().size()) + " points, " +
         RoundTrip(Rounded(size_mm.x())) + " x " + RoundTrip(Rounded(size_mm.y())) + " mm";
}

}  // namespace

std::string SheetOptions::Check() const {
  std::vector<std::string> faults;
  if (!(dpi >= 10 && dpi <= 10000)) faults.push_back("dpi must be from 10 to 10000");
  if (!(margin_mm >= 0 && margin_mm <= 1000)) faults.push_back("margin_mm must be from 0 to 1000");
  return Join(faults, "\n");
}

Eigen::Vector2d Sheet::PageFromTarget(const Eigen::Vector2d& point_in_target_m) const {
  const Eigen::Vector2d from_left_m = point_in_target_m - drawing.min_m;
  const double down_m = drawing.y_up ? drawing.max_m.y() - point_in_target_m.y() : from_left_m.y();
  return Eigen::Vector2d(1000 * from_left_m.x(), 1000 * down_m).array() + options.margin_mm;
}

Sheet MakeSheet(const Target& target, const SheetOptions& options) {
  CHECK(options.Check().empty()) << options.Check();
  Sheet sheet;
  sheet.drawing = target.Draw();
  sheet.options = options;
  if (sheet.options.caption.empty()) sheet.options.caption = DefaultCaption(target, sheet.drawing);
  sheet.options.caption += ". Print at 100 %";
  sheet.strip_mm = kStripMm;
  const Eigen::Vector2d size_mm = 1000 * (sheet.drawing.max_m - sheet.drawing.min_m);
  sheet.ruler_mm = kRulerMm;
  sheet.page_mm = size_mm.cwiseMax(Eigen::Vector2d(kRulerMm, 0)).array() + 2 * options.margin_mm;
  sheet.page_mm.y() += sheet.strip_mm;
  for (const TargetPoint& point : target.points()) {
    sheet.points.push_back({point.id, point.in_target, sheet.PageFromTarget(point.in_target.head<2>())});
  }
  return sheet;
}

void WriteSheet(const Sheet& sheet, const std::filesystem::path& path) {
  const Format& format = FormatOf(path);
  const double max_mm = sheet.page_mm.maxCoeff();
  const double drawn_mm = 1e3 * (sheet.drawing.max_m - sheet.drawing.min_m).minCoeff();
  constexpr double kLeastMm = 1;
  constexpr double kMostMm = 20000;
  if (!(drawn_mm >= kLeastMm && max_mm <= kMostMm)) {
    throw InputError(path.string() + ": a target of " + Significant(drawn_mm, 3) + " mm on a sheet of " +
                     Significant(max_mm, 3) + " mm cannot be printed; the limits are 1 mm and 20 m");
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
  json["points"] = nlohmann::ordered_json::array();
  for (const SheetPoint& point : sheet.points) {
    nlohmann::ordered_json entry;
    entry["id"] = point.id;
    entry["target_m"] = {Rounded(point.in_target.x()), Rounded(point.in_target.y()), Rounded(point.in_target.z())};
    entry["page_mm"] = {Rounded(point.page_mm.x()), Rounded(point.page_mm.y())};
    json["points"].push_back(entry);
  }
  return json.dump(1) + "\n";
}

}  // namespace heba
