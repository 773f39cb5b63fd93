// Draws a sheet on a surface of Cairo.
#pragma once

#include <cairo.h>

#include "targets/render/sheet.h"

namespace heba {

// Draws one page of the sheet. On a surface with one channel, coverage represents albedo.
void PaintSheetPage(const Sheet& sheet, const SheetPage& page, double units_per_mm, cairo_surface_t* surface);

}  // namespace heba
