// The map from a flat pattern to the image that FitPattern estimates: a homography known from the initial guess plus
// a sum of displacements. The pattern's used rectangle is scaled to [-1, 1] along both axes ("unit" coordinates).
//
// The terms, by index: 0 to 5 are affine (1, x, y in u, then in v); 6 and 7 are perspective; 8 and 9 are a lens that
// is radial about the image centre (terms 6 to 9 cover the second-order effect of such a lens within the pattern); 10
// to 16 are a polynomial in u (three squares, four cubes), 17 to 23 the same in v.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heba/kernels/simd.h"

namespace heba {

// Selects the free terms; the others are held.
enum class MapForm {
  kAffine,      // Terms 0 to 5; the others are 0.
  kQuadratic,   // Terms 0 to 5 and the squares; perspective, lens and cubes are 0.
  kLens,        // Terms 0 to 9; the polynomial is 0.
  kPolynomial,  // Terms 0 to 5 and the polynomial; perspective and lens are held.
};

struct PatternMap {
  static constexpr int kNumAffine = 6;
  static constexpr int kPerspective = 6;
  static constexpr int kLens = 8;
  static constexpr int kPolynomial = 10;
  static constexpr int kNumSquares = 3;
  static constexpr int kNumPolynomial = 7;  // Per axis.
  static constexpr int kNumTerms = 24;

  MapForm form = MapForm::kAffine;
  double start[3][3] = {};    // image_from_unit: homography of the initial guess.
  double middle_px[2] = {};   // Centre of the pattern in the image.
  double size_px = 1;         // Half the pattern's size in the image.
  double lens_px[2] = {};     // Centre of the whole image.
  double lens_radius_px = 1;  // Distance from lens_px to the first pixel.
};

// Returns the free terms by increasing index.
std::vector<int> SoughtTerms(MapForm form);

template <class V>
struct StartPoint {
  V u;
  V v;
  V inverse_w;
};
template <class V>
HEBA_INLINE StartPoint<V> MapByStart(const PatternMap& map, const V& x, const V& y) {
  const V inverse_w = 1.0 / (map.start[2][0] * x + map.start[2][1] * y + map.start[2][2]);
  return {(map.start[0][0] * x + map.start[0][1] * y + map.start[0][2]) * inverse_w,
          (map.start[1][0] * x + map.start[1][1] * y + map.start[1][2]) * inverse_w, inverse_w};
}

// A pixel and its derivatives by the unit coordinates.
template <class V>
struct MappedPoint {
  V u;
  V v;
  V u_by_x;
  V u_by_y;
  V v_by_x;
  V v_by_y;
};

template <class V>
HEBA_INLINE V Determinant(const MappedPoint<V>& point) {
  return point.u_by_x * point.v_by_y - point.u_by_y * point.v_by_x;
}

// Maps a point to the image. `terms` are the kNumTerms displacements, px.
template <class V>
HEBA_INLINE MappedPoint<V> MapPoint(const PatternMap& map, const double* terms, const V& x, const V& y) {
  const StartPoint<V> start = MapByStart(map, x, y);
  const V ux = (map.start[0][0] - start.u * map.start[2][0]) * start.inverse_w;
  const V uy = (map.start[0][1] - start.u * map.start[2][1]) * start.inverse_w;
  const V vx = (map.start[1][0] - start.v * map.start[2][0]) * start.inverse_w;
  const V vy = (map.start[1][1] - start.v * map.start[2][1]) * start.inverse_w;
  MappedPoint<V> point;
  point.u = start.u + terms[0] + terms[1] * x + terms[2] * y;
  point.v = start.v + terms[3] + terms[4] * x + terms[5] * y;
  point.u_by_x = ux + terms[1];
  point.u_by_y = uy + terms[2];
  point.v_by_x = vx + terms[4];
  point.v_by_y = vy + terms[5];
  if (map.form == MapForm::kAffine) return point;
  const auto add_squares = [&](const double* p, V* value, V* by_x, V* by_y) __attribute__((always_inline)) {
    *value += (p[0] * x + p[1] * y) * x + p[2] * y * y;
    *by_x += 2 * p[0] * x + p[1] * y;
    *by_y += p[1] * x + 2 * p[2] * y;
  };
  const double* const in_u = terms + PatternMap::kPolynomial;
  const double* const in_v = in_u + PatternMap::kNumPolynomial;
  if (map.form == MapForm::kQuadratic) {
    add_squares(in_u, &point.u, &point.u_by_x, &point.u_by_y);
    add_squares(in_v, &point.v, &point.v_by_x, &point.v_by_y);
    return point;
  }
  {
    const double per_px = 1 / map.size_px;
    const double* const p = terms + PatternMap::kPerspective;
    const V from_u = (start.u - map.middle_px[0]) * per_px;
    const V from_v = (start.v - map.middle_px[1]) * per_px;
    const V share = p[0] * x + p[1] * y;
    const V slope = share * per_px;
    point.u += share * from_u;
    point.v += share * from_v;
    point.u_by_x += slope * ux + p[0] * from_u;
    point.u_by_y += slope * uy + p[1] * from_u;
    point.v_by_x += slope * vx + p[0] * from_v;
    point.v_by_y += slope * vy + p[1] * from_v;
  }
  {
    const double per_px = 1 / map.lens_radius_px;
    const double* const p = terms + PatternMap::kLens;
    const V from_u = (start.u - map.lens_px[0]) * per_px;
    const V from_v = (start.v - map.lens_px[1]) * per_px;
    const V r2 = from_u * from_u + from_v * from_v;
    const V share = (p[0] + p[1] * r2) * r2;
    const V twice = (2 * p[0] + 4 * p[1] * r2) * per_px;
    const V uu = share * per_px + twice * from_u * from_u;
    const V uv = twice * from_u * from_v;
    const V vv = share * per_px + twice * from_v * from_v;
    point.u += share * from_u;
    point.v += share * from_v;
    point.u_by_x += uu * ux + uv * vx;
    point.u_by_y += uu * uy + uv * vy;
    point.v_by_x += uv * ux + vv * vx;
    point.v_by_y += uv * uy + vv * vy;
  }
  if (map.form == MapForm::kLens) return point;
  const auto add_cubes = [&](const double* p, V* value, V* by_x, V* by_y) __attribute__((always_inline)) {
    *value += ((p[0] * x + p[1] * y) * x + p[2] * y * y) * x + p[3] * y * y * y;
    *by_x += (3 * p[0] * x + 2 * p[1] * y) * x + p[2] * y * y;
    *by_y += (p[1] * x + 2 * p[2] * y) * x + 3 * p[3] * y * y;
  };
  add_squares(in_u, &point.u, &point.u_by_x, &point.u_by_y);
  add_squares(in_v, &point.v, &point.v_by_x, &point.v_by_y);
  add_cubes(in_u + PatternMap::kNumSquares, &point.u, &point.u_by_x, &point.u_by_y);
  add_cubes(in_v + PatternMap::kNumSquares, &point.v, &point.v_by_x, &point.v_by_y);
  return point;
}

// Calls `in` with x^2, x y, y^2 and, if `has_cubes`, with x^3, x^2 y, x y^2, y^3.
template <class V, class In>
HEBA_INLINE void ForEachPower(const V& x, const V& y, bool has_cubes, const In& in) {
  const V xx = x * x;
  const V xy = x * y;
  const V yy = y * y;
  in(xx);
  in(xy);
  in(yy);
  if (!has_cubes) return;
  in(V(xx * x));
  in(V(xx * y));
  in(V(xy * y));
  in(V(yy * y));
}

// Computes the displacement per unit of each free term at a point. Calls, by increasing term, in_u(px) for terms that
// act on u only, in_v(px) for terms that act on v only, and in_both(px in u, px in v) for the others.
template <class V, class InU, class InV, class InBoth>
HEBA_INLINE void ForEachDisplacement(const PatternMap& map, const V& x, const V& y, const InU& in_u, const InV& in_v,
                                     const InBoth& in_both) {
  const V one = AllLanes<V>(1);
  in_u(one);
  in_u(x);
  in_u(y);
  in_v(one);
  in_v(x);
  in_v(y);
  if (map.form == MapForm::kAffine) return;
  if (map.form == MapForm::kLens) {
    const StartPoint<V> start = MapByStart(map, x, y);
    const V from_u = (start.u - map.middle_px[0]) * (1 / map.size_px);
    const V from_v = (start.v - map.middle_px[1]) * (1 / map.size_px);
    in_both(V(from_u * x), V(from_v * x));
    in_both(V(from_u * y), V(from_v * y));
    const V lens_u = (start.u - map.lens_px[0]) * (1 / map.lens_radius_px);
    const V lens_v = (start.v - map.lens_px[1]) * (1 / map.lens_radius_px);
    const V r2 = lens_u * lens_u + lens_v * lens_v;
    const V r4 = r2 * r2;
    in_both(V(r2 * lens_u), V(r2 * lens_v));
    in_both(V(r4 * lens_u), V(r4 * lens_v));
    return;
  }
  const bool has_cubes = map.form == MapForm::kPolynomial;
  ForEachPower(x, y, has_cubes, in_u);
  ForEachPower(x, y, has_cubes, in_v);
}

}  // namespace heba
