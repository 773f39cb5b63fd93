#include "targets/render/sheet_file.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <new>
#include <string_view>
#include <utility>

#include <cairo-pdf.h>
#include <cairo-svg.h>
#include <cairo.h>
#include <nlohmann/json.hpp>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/data/scale_sigmas.h"
#include "targets/render/cairo_status.h"
#include "targets/render/sheet_layout.h"
#include "targets/render/sheet_painter.h"

namespace heba {
namespace {

constexpr double kMmPerInch = 25.4;
constexpr double kPointsPerMm = 72 / kMmPerInch;
constexpr int kMaxPixels = 32767;  // Limit for a side of a Cairo image.
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

// Returns the bytes with another text between the first `before`, if there is one, and the next quotation mark.
std::string WithText(std::string bytes, std::string_view before, const std::string& text) {
  const size_t found = bytes.find(before);
  if (found == std::string::npos) return bytes;
  const size_t begin = found + before.size();
  bytes.replace(begin, bytes.find('"', begin) - begin, text);
  return bytes;
}

std::string Svg(const Sheet& sheet) {
  // Cairo stores paths in units of 1/256: drawn in millimetres, they would be off by 2 um.
  constexpr double kUnitsPerMm = 100;
  const Eigen::Vector2d size = kUnitsPerMm * sheet.page_mm;
  std::string bytes;
  PaintAndFinish(Surface(cairo_svg_surface_create_for_stream(Append, &bytes, size.x(), size.y())), kUnitsPerMm, sheet);
  constexpr std::string_view kWidth = " width=\"";
  constexpr std::string_view kHeight = " height=\"";
  CHECK(bytes.find(kWidth) != std::string::npos && bytes.find(kHeight) != std::string::npos);
  bytes = WithText(std::move(bytes), kWidth, RoundTrip(Rounded(sheet.page_mm.x())) + "mm");
  bytes = WithText(std::move(bytes), kHeight, RoundTrip(Rounded(sheet.page_mm.y())) + "mm");
  // Cairo numbers the surfaces of a process, up to version 1.16; a fixed id gives equal bytes for equal sheets.
  return WithText(std::move(bytes), "<g id=\"surface", "");
}

std::string Pdf(const Sheet& sheet) {
  const Eigen::Vector2d size = kPointsPerMm * sheet.page_mm;
  std::string bytes;
  const Surface surface(cairo_pdf_surface_create_for_stream(Append, &bytes, size.x(), size.y()));
  // Every printer reads this version, and its objects are not compressed.
  cairo_pdf_surface_restrict_to_version(surface.get(), CAIRO_PDF_VERSION_1_4);
  // The dates are fixed, so that equal sheets give equal bytes.
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_CREATE_DATE, "2000-01-01T00:00:00Z");
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_MOD_DATE, "2000-01-01T00:00:00Z");
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_CREATOR, "heba");
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_TITLE, sheet.options.title.c_str());
  PaintAndFinish(surface, kPointsPerMm, sheet);
  return bytes;
}

std::string BigEndian(uint32_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes.push_back(static_cast<char>((value >> shift) & 0xff));
  return bytes;
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
  const Eigen::Vector2d size_px = pixels_per_mm * sheet.page_mm;
  const Surface surface(cairo_image_surface_create(CAIRO_FORMAT_A8, whole(size_px.x()), whole(size_px.y())));
  RequireCairo(cairo_surface_status(surface.get()));
  PaintSheetPage(sheet, sheet.pages.front(), pixels_per_mm, surface.get());
  std::string bytes;
  RequireCairo(cairo_surface_write_to_png_stream(surface.get(), Append, &bytes));

  // Cairo does not write the resolution, so a chunk with it is inserted after the first one.
  constexpr size_t kEndOfHeader = 8 + 25;
  const std::string pixels_per_m = BigEndian(static_cast<uint32_t>(std::lround(1000 * pixels_per_mm)));
  const std::string resolution = "pHYs" + pixels_per_m + pixels_per_m + '\1';  // The unit 1 is the metre.
  const std::string size = BigEndian(static_cast<uint32_t>(resolution.size() - 4));
  return bytes.insert(kEndOfHeader, size + resolution + BigEndian(Crc(resolution)));
}

struct Format {
  std::string_view suffix;
  std::string (*encode)(const Sheet&);
  bool has_dpi;
  bool has_pages;
};
constexpr Format kFormats[] = {{".svg", Svg, false, false}, {".pdf", Pdf, false, true}, {".png", Png, true, false}};

const Format& SheetFormatOf(const std::filesystem::path& path) {
  const std::string suffix = path.extension().string();
  for (const Format& format : kFormats) {
    if (format.suffix == suffix) return format;
  }
  throw InputError(path.string() + ": a sheet is written as .svg, .pdf or .png, not as '" + suffix + "'" +
                   DidYouMean(suffix, {".svg", ".pdf", ".png"}));
}

}  // namespace

void WriteSheet(const Sheet& sheet, const std::filesystem::path& path) {
  const Format& format = SheetFormatOf(path);
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
  if (sheet.pages.size() > kMostSheetPages) {
    throw InputError(path.string() + ": the sheet of " + ShownSize(sheet.size_mm) + " would need more than " +
                     std::to_string(kMostSheetPages) + " pages; use a larger paper");
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
  json["dpi"] = SheetFormatOf(path).has_dpi ? nlohmann::ordered_json(sheet.options.dpi) : nlohmann::ordered_json();
  const bool is_spread = sheet.pages.size() > 1;
  if (is_spread) {
    json["pages"] = {{"rows", sheet.NumPageRows()}, {"columns", sheet.NumPageColumns()}};
  }
  json["scale_sigma"] = kSheetScaleSigma;
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
