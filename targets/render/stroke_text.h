// Lines of text that are drawn with Cairo's own strokes: they are the same on every machine, whatever fonts are
// installed.
#pragma once

#include <string>
#include <vector>

#include <cairo.h>

namespace heba {

// A line of text as a path of height 1.
class StrokeText {
 public:
  explicit StrokeText(const std::string& text);
  ~StrokeText();
  StrokeText(const StrokeText&) = delete;
  StrokeText& operator=(const StrokeText&) = delete;

  // The width in units of the height.
  double width() const { return width_; }
  void AddTo(cairo_t* context) const { cairo_append_path(context, path_); }

 private:
  double width_ = 0;
  cairo_path_t* path_ = nullptr;
};

// Breaks `text` at blanks into lines that are at most `width` wide, in units of the height. A longer word has a line
// of its own.
std::vector<std::string> BrokenLines(const std::string& text, double width);

}  // namespace heba
