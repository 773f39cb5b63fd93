#include "targets/render/clutter.h"

#include <algorithm>
#include <cmath>

#include <cairo.h>
#include <opencv2/core.hpp>

#include "heba/base/error.h"
#include "heba/base/units.h"
#include "targets/dots/ring_code.h"

namespace heba {
namespace {

// The surface has one channel: coverage represents albedo.
void SetAlbedo(cairo_t* context, double albedo) { cairo_set_source_rgba(context, 0, 0, 0, albedo); }

void AddPolygon(cairo_t* context, const Eigen::Vector2d& at, double size_px, Rng& rng) {
  const int num_corners = 3 + rng.Index(5);
  const double start_rad = rng.Uniform(0, 2 * kPi);
  for (int i = 0; i < num_corners; ++i) {
    const double angle = start_rad + 2 * kPi * (i + rng.Uniform(-0.3, 0.3)) / num_corners;
    const double radius_px = size_px * rng.Uniform(0.4, 1.0);
    cairo_line_to(context, at.x() + radius_px * std::cos(angle), at.y() + radius_px * std::sin(angle));
  }
  cairo_close_path(context);
  cairo_fill(context);
}

void AddDisc(cairo_t* context, const Eigen::Vector2d& at, double size_px, Rng& rng) {
  cairo_save(context);
  cairo_translate(context, at.x(), at.y());
  cairo_rotate(context, rng.Uniform(0, kPi));
  cairo_scale(context, 1, rng.Uniform(0.4, 1.0));
  cairo_arc(context, 0, 0, 0.5 * size_px, 0, 2 * kPi);
  cairo_restore(context);
  cairo_fill(context);
}

void AddRing(cairo_t* context, const Eigen::Vector2d& at, double size_px, Rng& rng) {
  const double start_rad = rng.Uniform(0, 2 * kPi);
  cairo_set_line_width(context, size_px * rng.Uniform(0.05, 0.25));
  cairo_arc(context, at.x(), at.y(), 0.4 * size_px, start_rad, start_rad + rng.Uniform(0.3, 1.0) * 2 * kPi);
  cairo_stroke(context);
  if (rng.Uniform() < 0.5) {
    cairo_arc(context, at.x(), at.y(), 0.15 * size_px, 0, 2 * kPi);
    cairo_fill(context);
  }
}

void AddLine(cairo_t* context, const Eigen::Vector2d& at, double size_px, Rng& rng) {
  const double angle = rng.Uniform(0, 2 * kPi);
  const double length_px = size_px * rng.Uniform(1.0, 5.0);
  cairo_set_line_width(context, rng.Uniform(1.0, 6.0));
  cairo_move_to(context, at.x(), at.y());
  cairo_line_to(context, at.x() + length_px * std::cos(angle), at.y() + length_px * std::sin(angle));
  cairo_stroke(context);
}

// Draws lines of small strokes, which resemble print seen from afar.
void AddPrint(cairo_t* context, const Eigen::Vector2d& at, double size_px, Rng& rng) {
  const double letter_px = rng.Uniform(4.0, 14.0);
  const int num_lines = 1 + rng.Index(4);
  cairo_save(context);
  cairo_translate(context, at.x(), at.y());
  cairo_rotate(context, rng.Uniform(-0.4, 0.4));
  cairo_set_line_width(context, std::max(1.0, 0.14 * letter_px));
  for (int line = 0; line < num_lines; ++line) {
    for (double x = 0; x < 2 * size_px; x += 0.75 * letter_px) {
      if (rng.Uniform() < 0.15) continue;
      const double y = line * 1.6 * letter_px;
      const Eigen::Vector2d start{rng.Uniform(0, 0.5), rng.Uniform(0, 0.3)};
      cairo_move_to(context, x + start.x() * letter_px, y + start.y() * letter_px);
      for (int stroke = 0; stroke < 3; ++stroke) {
        const Eigen::Vector2d end{rng.Uniform(0, 0.55), rng.Uniform()};
        cairo_line_to(context, x + end.x() * letter_px, y + end.y() * letter_px);
      }
      cairo_stroke(context);
    }
  }
  cairo_restore(context);
}

void AddGradient(cairo_t* context, const Eigen::Vector2d& at, double size_px, Rng& rng) {
  const double angle = rng.Uniform(0, 2 * kPi);
  const Eigen::Vector2d along = size_px * Eigen::Vector2d(std::cos(angle), std::sin(angle));
  cairo_pattern_t* pattern =
      cairo_pattern_create_linear(at.x() - along.x(), at.y() - along.y(), at.x() + along.x(), at.y() + along.y());
  cairo_pattern_add_color_stop_rgba(pattern, 0, 0, 0, 0, rng.Uniform());
  cairo_pattern_add_color_stop_rgba(pattern, 1, 0, 0, 0, rng.Uniform());
  cairo_set_source(context, pattern);
  cairo_pattern_destroy(pattern);
  AddPolygon(context, at, size_px, rng);
}

using AddMark = void (*)(cairo_t*, const Eigen::Vector2d&, double, Rng&);
constexpr AddMark kMarks[] = {AddPolygon, AddDisc, AddRing, AddLine, AddPrint, AddGradient};

}  // namespace

cv::Mat DrawClutter(int width_px, int height_px, const std::vector<Eigen::Vector2d>& outline_px, Rng rng) {
  cairo_surface_t* surface = cairo_image_surface_create(CAIRO_FORMAT_A8, width_px, height_px);
  cairo_t* context = cairo_create(surface);
  CHECK_EQ(cairo_status(context), CAIRO_STATUS_SUCCESS);
  cairo_set_operator(context, CAIRO_OPERATOR_SOURCE);

  const double diagonal_px = std::hypot(width_px, height_px);
  const Eigen::Vector2d middle(0.5 * width_px, 0.5 * height_px);
  SetAlbedo(context, 0.5);
  cairo_paint(context);
  AddGradient(context, middle, 2 * diagonal_px, rng);
  constexpr int kNumMarks = 90;
  for (int i = 0; i < kNumMarks; ++i) {
    Eigen::Vector2d at{rng.Uniform(0, width_px), rng.Uniform(0, height_px)};
    double size_px = diagonal_px * std::exp(rng.Uniform(std::log(0.008), std::log(0.12)));
    if (i >= kNumMarks / 2 && !outline_px.empty()) {
      // Half of the marks are placed right beside the sheet.
      size_px *= 0.5;
      at = outline_px[rng.Index(static_cast<int>(outline_px.size()))] +
           size_px * Eigen::Vector2d{rng.Normal(), rng.Normal()};
    }
    SetAlbedo(context, rng.Uniform());
    // The position is clamped, so that a mark far outside the image consumes the same random numbers.
    const double limit_px = 2 * diagonal_px;
    kMarks[rng.Index(std::size(kMarks))](context, at.cwiseMax(-limit_px).cwiseMin(limit_px), size_px, rng);
  }

  cairo_surface_flush(surface);
  const cv::Mat coverage(height_px, width_px, CV_8UC1, cairo_image_surface_get_data(surface),
                         static_cast<size_t>(cairo_image_surface_get_stride(surface)));
  cv::Mat albedo;
  coverage.convertTo(albedo, CV_32F, 1.0 / 255);
  cairo_destroy(context);
  cairo_surface_destroy(surface);
  return albedo;
}

Drawing WithRoundMarks(Drawing drawing, const RoundMarksOptions& options, const Eigen::AlignedBox2d& kept, Rng& rng) {
  for (int n = 0; n < options.count; ++n) {
    const double radius_m = std::exp(rng.Uniform(std::log(options.min_radius_m), std::log(options.max_radius_m)));
    // Most rings have the correct proportions.
    const double inner = rng.Uniform() < 0.6 ? 2 : rng.Uniform(1.4, 2.6);
    const double outer = rng.Uniform() < 0.6 ? inner + 1 : inner + rng.Uniform(0.3, 1.4);
    const double ink = rng.Uniform() < 0.7 ? 0 : rng.Uniform(0, 0.6);
    const bool has_ring = rng.Uniform() < 0.8;
    const bool is_coded = rng.Uniform() < 0.8;
    const bool is_broken = rng.Uniform() < 0.2;
    const double start_rad = rng.Uniform(0, 2 * kPi);
    uint32_t word = 0;
    do {
      word = static_cast<uint32_t>(rng.Index(1 << options.bits));
    } while (std::count(options.avoided_codes.begin(), options.avoided_codes.end(), RingCodeOf(word, options.bits)) >
             0);
    const double reach_m = (has_ring ? outer : 1) * radius_m;
    const Eigen::Vector2d at{rng.Uniform(drawing.min_m.x(), drawing.max_m.x()),
                             rng.Uniform(drawing.min_m.y(), drawing.max_m.y())};
    if (kept.exteriorDistance(at) < reach_m) continue;
    const double paper = drawing.ground;
    const double colour = paper > 0.5 ? ink : 1 - ink;
    if (has_ring) {
      drawing.AddDisc(at, reach_m, colour);
      for (int sector = 0; is_coded && sector < options.bits; ++sector) {
        if (((word >> (options.bits - 1 - sector)) & 1U) != 0) continue;
        Shape wedge;
        wedge.albedo = paper;
        wedge.points_m.push_back(at);
        for (int step = 0; step <= 2; ++step) {
          const double angle = start_rad + 2 * kPi * (sector + 0.5 * step) / options.bits;
          wedge.points_m.push_back(at + 1.08 * reach_m * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
        }
        drawing.shapes.push_back(std::move(wedge));
      }
      drawing.AddDisc(at, inner * radius_m, paper);
    }
    drawing.AddDisc(at, radius_m, colour);
    if (is_broken) {
      const double chip_radius_m = rng.Uniform(0.2, 0.8) * radius_m;
      drawing.AddDisc(at + 0.7 * reach_m * Eigen::Vector2d(std::cos(start_rad), std::sin(start_rad)), chip_radius_m,
                      rng.Uniform());
    }
  }
  return drawing;
}

}  // namespace heba
