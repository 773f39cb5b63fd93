// The files of a sheet: the print, and where its points are on it.
#pragma once

#include <filesystem>
#include <string>

#include "targets/render/sheet.h"

namespace heba {

// Writes the sheet as .svg, .pdf or .png, by the suffix of `path`, completely or not at all; equal sheets give equal
// bytes. Page point (x, y) mm lies at pixel x * dpi / 25.4 - 0.5 of the PNG, which is rounded up to whole pixels and
// states its resolution (pHYs). Throws InputError if the suffix is another, a sheet of several pages is not written as
// .pdf, the target is smaller than 1 mm, the sheet is larger than 20 m or has more than 400 pages, the PNG would have
// more than 32767 pixels per side, or the file cannot be written.
void WriteSheet(const Sheet& sheet, const std::filesystem::path& path);

// Returns SHEET.json (docs/manual/targets.md) for the sheet written to `path`, whose suffix decides whether there is a
// dpi.
std::string SheetJson(const Sheet& sheet, const std::filesystem::path& path);
// Returns whether a text is a SHEET.json.
bool IsSheetJson(const std::string& text);

}  // namespace heba
