#include "targets/render/stroke_text.h"

#include "heba/base/error.h"
#include "heba/base/text.h"

namespace heba {

StrokeText::StrokeText(const std::string& text) {
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
  constexpr double kSize = 1;
  cairo_set_font_size(context, kSize);
  cairo_text_extents_t extents;
  cairo_text_extents(context, text.c_str(), &extents);
  width_ = extents.x_advance / kSize;
  cairo_move_to(context, 0, 0);
  cairo_text_path(context, text.c_str());
  cairo_scale(context, kSize, kSize);
  path_ = cairo_copy_path(context);
  // Recording surfaces need no memory of a fixed size and no file, so they cannot fail.
  CHECK_EQ(cairo_status(context), CAIRO_STATUS_SUCCESS);
  cairo_destroy(context);
  cairo_surface_destroy(surface);
}

StrokeText::~StrokeText() { cairo_path_destroy(path_); }

std::vector<std::string> BrokenLines(const std::string& text, double width) {
  std::vector<std::string> lines;
  for (const std::string& word : Split(text, ' ')) {
    const std::string longer = lines.empty() ? word : lines.back() + " " + word;
    if (!lines.empty() && StrokeText(longer).width() <= width) {
      lines.back() = longer;
    } else {
      lines.push_back(word);
    }
  }
  return lines;
}

}  // namespace heba
