#include "targets/render/sheet_painter.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "heba/base/units.h"
#include "targets/render/cairo_status.h"
#include "targets/render/sheet_layout.h"
#include "targets/render/stroke_text.h"

namespace heba {
namespace {

constexpr double kLineMm = 0.15;

// Draws in millimetres of the sheet.
class SheetPainter {
 public:
  SheetPainter(cairo_surface_t* surface, double units_per_mm, const Sheet& sheet)
      : context_(cairo_create(surface)),
        one_channel_(cairo_surface_get_type(surface) == CAIRO_SURFACE_TYPE_IMAGE),
        sheet_(sheet) {
    cairo_set_antialias(context_, CAIRO_ANTIALIAS_BEST);
    // Curves are flattened to this tolerance in device units, far below the size of a printer's dots.
    cairo_set_tolerance(context_, 0.01);
    cairo_scale(context_, units_per_mm, units_per_mm);
    if (one_channel_) cairo_set_operator(context_, CAIRO_OPERATOR_SOURCE);
    cairo_set_line_width(context_, kLineMm);
  }
  ~SheetPainter() { cairo_destroy(context_); }
  SheetPainter(const SheetPainter&) = delete;
  SheetPainter& operator=(const SheetPainter&) = delete;

  void Paint(const SheetPage& page) {
    SetAlbedo(1);
    cairo_paint(context_);
    if (sheet_.pages.size() > 1) {
      PaintPageMarks(page);
      const Eigen::Vector2d size_mm = page.to_mm - page.from_mm;
      cairo_rectangle(context_, page.at_mm.x(), page.at_mm.y(), size_mm.x(), size_mm.y());
      cairo_clip(context_);
    }
    const Eigen::Vector2d shift_mm = page.at_mm - page.from_mm;
    cairo_translate(context_, shift_mm.x(), shift_mm.y());
    PaintTarget();
    SetAlbedo(0);
    PaintAxes();
    PaintSideRuler();
    PaintStrip();
    RequireCairo(cairo_status(context_));
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
      const Eigen::Vector2d centre_mm = sheet_.SheetFromTarget(shape.centre_m);
      cairo_new_sub_path(context_);
      cairo_arc(context_, centre_mm.x(), centre_mm.y(), 1000 * shape.radius_m, 0, 2 * kPi);
      cairo_close_path(context_);
      return;
    }
    std::vector<Eigen::Vector2d> points_mm;
    for (const Eigen::Vector2d& point : shape.points_m) points_mm.push_back(sheet_.SheetFromTarget(point));
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
    const Eigen::Vector2d size_mm = 1000 * (sheet_.drawing.max_m - sheet_.drawing.min_m);
    cairo_save(context_);
    cairo_rectangle(context_, sheet_.drawing_at_mm.x(), sheet_.drawing_at_mm.y(), size_mm.x(), size_mm.y());
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
      PaintText(label.text, sheet_.SheetFromTarget(label.at_m), 1000 * label.height_m);
    }
    cairo_restore(context_);
  }

  // The text begins at `at_mm`, and is rotated clockwise by a quarter if it is `downward`.
  void PaintText(const std::string& text, const Eigen::Vector2d& at_mm, double height_mm, bool downward = false) {
    cairo_save(context_);
    cairo_translate(context_, at_mm.x(), at_mm.y());
    if (downward) cairo_rotate(context_, kPi / 2);
    cairo_scale(context_, height_mm, height_mm);
    StrokeText(text).AddTo(context_);
    cairo_restore(context_);
    cairo_fill(context_);
  }

  void AddLine(const Eigen::Vector2d& from_mm, const Eigen::Vector2d& to_mm) {
    cairo_move_to(context_, from_mm.x(), from_mm.y());
    cairo_line_to(context_, to_mm.x(), to_mm.y());
  }

  // A bar at the origin's coordinate, across an arrow along the axis, and the axis' name.
  void PaintAxis(const Eigen::Vector2d& origin_mm, const Eigen::Vector2d& along, const std::string& name) {
    const Eigen::Vector2d across(-along.y(), along.x());
    constexpr double kHalfBarMm = 1.3;
    constexpr double kLengthMm = 8;
    constexpr double kHeadMm = 2;
    cairo_set_line_width(context_, 2 * kLineMm);
    AddLine(origin_mm - kHalfBarMm * across, origin_mm + kHalfBarMm * across);
    AddLine(origin_mm, origin_mm + (kLengthMm - kHeadMm) * along);
    cairo_stroke(context_);
    cairo_set_line_width(context_, kLineMm);
    const Eigen::Vector2d tip_mm = origin_mm + kLengthMm * along;
    const Eigen::Vector2d back_mm = tip_mm - kHeadMm * along;
    cairo_move_to(context_, tip_mm.x(), tip_mm.y());
    for (const double side : {-0.4, 0.4}) {
      const Eigen::Vector2d corner_mm = back_mm + side * kHeadMm * across;
      cairo_line_to(context_, corner_mm.x(), corner_mm.y());
    }
    cairo_close_path(context_);
    cairo_fill(context_);
    // The letter's baseline begins at its bottom-left corner.
    const double width_mm = StrokeText(name).width() * kSheetLetterMm;
    const Eigen::Vector2d middle_mm = tip_mm + 1.6 * along;
    PaintText(name, middle_mm + Eigen::Vector2d(-0.5 * width_mm, 0.3 * kSheetLetterMm), kSheetLetterMm);
  }

  void PaintAxes() {
    const Eigen::Vector2d origin_mm = sheet_.SheetFromTarget({0, 0});
    const bool y_up = sheet_.drawing.y_up;
    const double height_mm = 1000 * (sheet_.drawing.max_m - sheet_.drawing.min_m).y();
    const double x_mark_mm = sheet_.drawing_at_mm.y() + (y_up ? height_mm + kSheetMarkMm : -kSheetMarkMm);
    PaintAxis({origin_mm.x(), x_mark_mm}, {1, 0}, "x");
    PaintAxis({sheet_.drawing_at_mm.x() - kSheetMarkMm, origin_mm.y()}, {0, y_up ? -1 : 1}, "y");
  }

  // Draws a ruler from `from_mm` along `along`, with its ticks on the side `across` and the numbers beyond them.
  void PaintRuler(const Eigen::Vector2d& from_mm, const Eigen::Vector2d& along, const Eigen::Vector2d& across,
                  double length_mm) {
    for (int mm = 0; mm <= static_cast<int>(length_mm); ++mm) {
      const double tick_mm = mm % 10 == 0 ? 3.0 : mm % 5 == 0 ? 2.2 : 1.4;
      const Eigen::Vector2d at_mm = from_mm + mm * along;
      AddLine(at_mm, at_mm + tick_mm * across);
    }
    AddLine(from_mm - 0.5 * kLineMm * along, from_mm + (length_mm + 0.5 * kLineMm) * along);
    cairo_stroke(context_);
    const bool downward = along.y() > 0;
    const std::string end = std::to_string(static_cast<int>(length_mm)) + " mm";
    const double end_mm = length_mm - StrokeText(end).width() * kSheetLetterMm;
    // Letters stand above their baseline, which is on the right of the vertical ruler's ticks for downward text.
    const double baseline_mm = downward ? 3.7 : kSheetNumbersMm - kSheetRulerTopMm;
    PaintText("0", from_mm + baseline_mm * across, kSheetLetterMm, downward);
    PaintText(end, from_mm + end_mm * along + baseline_mm * across, kSheetLetterMm, downward);
  }

  void PaintSideRuler() {
    PaintRuler(Eigen::Vector2d::Constant(sheet_.margin_mm + 0.5 * kLineMm), {0, 1}, {1, 0}, sheet_.side_ruler_mm);
  }

  void PaintStrip() {
    const double top_mm = sheet_.size_mm.y() - sheet_.strip_mm;
    const double left_mm = sheet_.margin_mm + kSheetBandMm;
    PaintRuler({left_mm, top_mm + kSheetRulerTopMm}, {1, 0}, {0, 1}, sheet_.ruler_mm);
    for (size_t line = 0; line < sheet_.small_print.size(); ++line) {
      const double baseline_mm = top_mm + kSheetPrintMm + kSheetLineMm * static_cast<double>(line);
      PaintText(sheet_.small_print[line], {left_mm, baseline_mm}, kSheetLetterMm);
    }
    if (sheet_.code) PaintCode(*sheet_.code, top_mm);
  }

  void PaintCode(const QrCode& code, double top_mm) {
    const double quiet_mm = kQrQuietModules * kSheetCodeModuleMm;
    const double left_mm = sheet_.size_mm.x() - sheet_.margin_mm - quiet_mm - code.size * kSheetCodeModuleMm;
    for (int row = 0; row < code.size; ++row) {
      for (int column = 0; column < code.size; ++column) {
        if (!code.IsBlack(row, column)) continue;
        const int begin = column;
        while (column < code.size && code.IsBlack(row, column)) ++column;
        cairo_rectangle(context_, left_mm + begin * kSheetCodeModuleMm, top_mm + quiet_mm + row * kSheetCodeModuleMm,
                        (column - begin) * kSheetCodeModuleMm, kSheetCodeModuleMm);
      }
    }
    // One path, since modules that are filled separately would show seams.
    cairo_fill(context_);
  }

  // Marks in the frame around the page's part of the sheet: where to cut it, and where the edges of the pages that
  // overlap with it come to lie.
  void PaintPageMarks(const SheetPage& page) {
    SetAlbedo(0);
    const Eigen::Vector2d shift_mm = page.at_mm - page.from_mm;
    const Eigen::Vector2d begin_mm = page.at_mm;
    const Eigen::Vector2d end_mm = page.to_mm + shift_mm;
    const auto add_marks = [&](int axis, double at_mm, double length_mm) {
      const int other = 1 - axis;
      for (const double side : {-1.0, 1.0}) {
        Eigen::Vector2d from_mm;
        from_mm[axis] = at_mm;
        from_mm[other] = side < 0 ? begin_mm[other] : end_mm[other];
        Eigen::Vector2d to_mm = from_mm;
        to_mm[other] += side * length_mm;
        AddLine(from_mm, to_mm);
      }
    };
    for (const int axis : {0, 1}) {
      for (const double at_mm : {begin_mm[axis], end_mm[axis]}) add_marks(axis, at_mm, kSheetFrameMm - 0.5);
    }
    cairo_stroke(context_);
    const double dashes_mm[] = {0.6, 0.4};
    cairo_set_dash(context_, dashes_mm, 2, 0);
    for (const SheetPage& other : sheet_.pages) {
      const bool is_beside = other.row == page.row && std::abs(other.column - page.column) == 1;
      const bool is_below = other.column == page.column && std::abs(other.row - page.row) == 1;
      if (is_beside || is_below) {
        const int axis = is_beside ? 0 : 1;
        const bool is_before = other.row < page.row || other.column < page.column;
        add_marks(axis, (is_before ? other.to_mm : other.from_mm)[axis] + shift_mm[axis], kSheetEdgeMarkMm);
      }
    }
    cairo_stroke(context_);
    cairo_set_dash(context_, nullptr, 0, 0);
    const int num_pages = static_cast<int>(sheet_.pages.size());
    const int number = page.row * sheet_.NumPageColumns() + page.column + 1;
    const std::string label = std::to_string(number) + "/" + std::to_string(num_pages) + ": row " +
                              std::to_string(page.row + 1) + ", column " + std::to_string(page.column + 1) +
                              ". Cut at the lines; the next page's edge: dashes.";
    PaintText(label, {begin_mm.x() + 2, end_mm.y() + kSheetLabelMm}, kSheetLetterMm);
  }

  cairo_t* context_;
  bool one_channel_;
  const Sheet& sheet_;
};

}  // namespace

void PaintSheetPage(const Sheet& sheet, const SheetPage& page, double units_per_mm, cairo_surface_t* surface) {
  SheetPainter(surface, units_per_mm, sheet).Paint(page);
}

}  // namespace heba
