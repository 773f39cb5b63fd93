#include "targets/corners/pattern_rows.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <Eigen/LU>

#include "heba/base/error.h"
#include "heba/kernels/gram_matrix.h"
#include "heba/kernels/lane_functions.h"

namespace heba {
namespace {

// The weight of a Gaussian is negligible beyond this many standard deviations (6e-5).
constexpr double kSupportRadius = 4.0;
// The distance that pixels may move before the edges within support_radius are searched for again.
constexpr double kMaxMovePx = 0.5;

constexpr size_t kMaxLines = CellPattern::kMaxLines;
constexpr int kNumLight = kStretch - kLight;

bool IsLightBent(MapForm form) { return form == MapForm::kLens || form == MapForm::kPolynomial; }

// The blurred albedo of the pattern and its first and second derivatives by x and y in standard deviations. The second
// ones are those by the blur's covariance: a Gaussian mean obeys the equation of heat.
template <class V>
struct BlurredLanes {
  V value;
  V by_a;
  V by_b;
  V by_aa;
  V by_ab;
  V by_bb;
};

// The lines along one axis within support_radius: their distances from the pixels in standard deviations, and the
// normal distribution function and density there.
template <class V>
struct SeenLines {
  V at[kMaxLines];
  V cdf[kMaxLines];
  V density[kMaxLines];
};

// The bivariate normal distribution function at a pair of lines, and its derivatives.
template <class V>
struct NormalPair {
  V cdf;
  V by_a;
  V by_b;
  V by_ab;
};

// Adds the contributions of all pairs of lines; `at_pair(j, i)` returns the NormalPair of lines j and i.
template <class V, class AtPair>
HEBA_INLINE void AddTwists(const double* cross_differences, int num_x, int num_y, const SeenLines<V>& x,
                           const SeenLines<V>& y, const V& correlation, const AtPair& at_pair,
                           BlurredLanes<V>* result) {
  constexpr int kLanes = kLanesIn<V>;
  for (int j = 0; j < num_y; ++j) {
    for (int i = 0; i < num_x; ++i) {
      const V cross_difference = LoadLanes<V>(cross_differences + (j * num_x + i) * kLanes);
      if (LargestLane(AbsLanes(cross_difference)) == 0) continue;
      const NormalPair<V> pair = at_pair(j, i);
      const V slope_a = cross_difference * pair.by_a;
      const V slope_b = cross_difference * pair.by_b;
      result->value += cross_difference * pair.cdf;
      result->by_a += slope_a;
      result->by_b += slope_b;
      const V twist = cross_difference * pair.by_ab;
      result->by_aa -= slope_a * x.at[i] + correlation * twist;
      result->by_ab += twist;
      result->by_bb -= slope_b * y.at[j] + correlation * twist;
    }
  }
}

// Adds the pairs of lines for a small correlation r. The bivariate normal distribution function is the product of the
// univariate ones plus Mehler's series sum r^k / k! He_(k-1)(a) He_(k-1)(b) times the two densities (Kendall 1941),
// truncated after kTerms.
template <int kTerms, class V>
HEBA_INLINE void AddTwistsBySeries(const double* cross_differences, int num_x, int num_y, const SeenLines<V>& x,
                                   const SeenLines<V>& y, const V& correlation, BlurredLanes<V>* result) {
  const auto at_pair = [&](int j, int i) __attribute__((always_inline))->NormalPair<V> {
    const V a = x.at[i];
    const V b = y.at[j];
    V last_a = AllLanes<V>(1);
    V last_b = AllLanes<V>(1);
    V here_a = a;
    V here_b = b;
    V power = correlation;
    V sum = AllLanes<V>(0);
    V sum_a = sum;
    V sum_b = sum;
    V sum_ab = last_a;
    for (int k = 1; k <= kTerms; ++k) {
      sum += power * last_a * last_b;
      sum_a += power * here_a * last_b;
      sum_b += power * last_a * here_b;
      sum_ab += power * here_a * here_b;
      const V next_a = a * here_a - static_cast<double>(k) * last_a;
      const V next_b = b * here_b - static_cast<double>(k) * last_b;
      last_a = here_a;
      last_b = here_b;
      here_a = next_a;
      here_b = next_b;
      power *= correlation * (1.0 / (k + 1));
    }
    const V densities = x.density[i] * y.density[j];
    return {x.cdf[i] * y.cdf[j] + densities * sum, x.density[i] * y.cdf[j] - densities * sum_a,
            y.density[j] * x.cdf[i] - densities * sum_b, densities * sum_ab};
  };
  AddTwists(cross_differences, num_x, num_y, x, y, correlation, at_pair, result);
}

// Adds the pairs of lines for any correlation: the product of the univariate distribution functions plus an integral
// over the angle of the correlation (Plackett 1954), computed by Gauss-Legendre quadrature (to 1e-8).
template <class V>
HEBA_INLINE void AddTwistsByQuadrature(const double* cross_differences, int num_x, int num_y, const SeenLines<V>& x,
                                       const SeenLines<V>& y, const V& correlation, BlurredLanes<V>* result) {
  constexpr int kNumNodes = 6;
  constexpr double kNodes[kNumNodes] = {0.2386191860831969,  -0.2386191860831969, 0.6612093864662645,
                                        -0.6612093864662645, 0.9324695142031521,  -0.9324695142031521};
  constexpr double kWeights[kNumNodes] = {0.4679139345726910, 0.4679139345726910, 0.3607615730481386,
                                          0.3607615730481386, 0.1713244923791704, 0.1713244923791704};
  const V angle = EachLane(
      correlation, correlation, [](double value, double) __attribute__((always_inline)) { return std::asin(value); });
  V sines[kNumNodes];
  V scales[kNumNodes];  // -1 / (2 cos^2)
  for (int n = 0; n < kNumNodes; ++n) {
    const V at = (0.5 * (1 + kNodes[n])) * angle;
    sines[n] = EachLane(
        at, at, [](double value, double) __attribute__((always_inline)) { return std::sin(value); });
    scales[n] = -0.5 / (1.0 - sines[n] * sines[n]);
  }
  const V inverse_rest = 1.0 / SqrtLanes<V>(1.0 - correlation * correlation);
  const V scale = (0.25 / std::numbers::pi) * angle;
  const auto at_pair = [&](int j, int i) __attribute__((always_inline))->NormalPair<V> {
    const V a = x.at[i];
    const V b = y.at[j];
    const V squares = a * a + b * b;
    V sum = AllLanes<V>(0);
    for (int n = 0; n < kNumNodes; ++n) {
      sum += kWeights[n] * ExpLanes<V>((squares - 2.0 * a * b * sines[n]) * scales[n]);
    }
    const NormalLanes<V> of_b = NormalOf<V>((b - correlation * a) * inverse_rest);
    return {x.cdf[i] * y.cdf[j] + sum * scale, x.density[i] * of_b.cdf,
            y.density[j] * NormalOf<V>((a - correlation * b) * inverse_rest).cdf,
            x.density[i] * of_b.density * inverse_rest};
  };
  AddTwists(cross_differences, num_x, num_y, x, y, correlation, at_pair, result);
}

// Computes the blurred albedo at a point. `numbers` were written by UnitCells::Write for each lane; `inverse_x` is 1
// over the blur's standard deviation along x, `inverse_y` likewise along y.
template <class V>
HEBA_INLINE BlurredLanes<V> Blur(const double* numbers, int num_x, int num_y, const V& x, const V& y,
                                 const V& inverse_x, const V& inverse_y, const V& correlation) {
  constexpr int kLanes = kLanesIn<V>;
  const V none = AllLanes<V>(0);
  BlurredLanes<V> result{LoadLanes<V>(numbers), none, none, none, none, none};
  // These are not initialised to 0, since this is called for every pixel.
  SeenLines<V> x_lines;
  SeenLines<V> y_lines;
  const double* next = numbers + 5 * kLanes;
  const auto look = [&](int size, const V& at, const V& inverse_sigma, SeenLines<V>* lines, V* by_at, V* by_at_at)
      __attribute__((always_inline)) {
    for (int k = 0; k < size; ++k, next += 2 * kLanes) {
      const V a = (at - LoadLanes<V>(next)) * inverse_sigma;
      const V step = LoadLanes<V>(next + kLanes);
      const NormalLanes<V> normal = NormalOf(a);
      lines->at[k] = a;
      lines->cdf[k] = normal.cdf;
      lines->density[k] = normal.density;
      const V slope = step * normal.density;
      result.value += step * normal.cdf;
      *by_at += slope;
      *by_at_at -= slope * a;
    }
  };
  look(num_x, x, inverse_x, &x_lines, &result.by_a, &result.by_aa);
  look(num_y, y, inverse_y, &y_lines, &result.by_b, &result.by_bb);
  if (num_x == 0 || num_y == 0) return result;
  const double largest = LargestLane(AbsLanes(correlation));
  // The errors of the two series are at most 2e-7 and 4e-7.
  if (largest <= 0.1) {
    AddTwistsBySeries<4>(next, num_x, num_y, x_lines, y_lines, correlation, &result);
  } else if (largest <= 0.35) {
    AddTwistsBySeries<8>(next, num_x, num_y, x_lines, y_lines, correlation, &result);
  } else {
    AddTwistsByQuadrature(next, num_x, num_y, x_lines, y_lines, correlation, &result);
  }
  return result;
}

// Computes the unit coordinates of a pixel by Newton's method from an initial guess, and the derivative of the map
// near them. Returns false if the iteration does not converge.
template <class V>
HEBA_INLINE bool Invert(const PatternMap& map, const double* terms, const V& u, const V& v, V* x, V* y,
                        MappedPoint<V>* point) {
  constexpr int kMaxSteps = 10;
  constexpr double kLongest = 2;
  // The error that remains is quadratic in the step: 1e-4 px for a strongly curved pattern.
  constexpr double kShort = 1e-3;
  for (int step = 0; step < kMaxSteps; ++step) {
    *point = MapPoint(map, terms, *x, *y);
    const V inverse = 1.0 / Determinant(*point);
    const V off_u = u - point->u;
    const V off_v = v - point->v;
    const V dx = (point->v_by_y * off_u - point->u_by_y * off_v) * inverse;
    const V dy = (point->u_by_x * off_v - point->v_by_x * off_u) * inverse;
    const double length2 = LargestLane<V>(dx * dx + dy * dy);
    const double check = SumOfLanes<V>(dx + dy);
    if (!(length2 <= kLongest * kLongest) || !std::isfinite(check)) return false;
    *x += dx;
    *y += dy;
    if (length2 <= kShort * kShort) return true;
  }
  return false;
}

// The pattern's unit coordinates by pixels at a point.
template <class V>
struct UnitByPixel {
  V x_by_u;
  V x_by_v;
  V y_by_u;
  V y_by_v;
};
template <class V>
HEBA_INLINE UnitByPixel<V> InverseOf(const MappedPoint<V>& point) {
  const V inverse = 1.0 / Determinant(point);
  return {point.v_by_y * inverse, -point.u_by_y * inverse, -point.v_by_x * inverse, point.u_by_x * inverse};
}

// The covariance in unit coordinates of a Gaussian that has the covariance (uu, uv; uv, vv) in pixels.
template <class V>
struct UnitCovariance {
  V xx;
  V xy;
  V yy;
};
template <class V>
HEBA_INLINE UnitCovariance<V> InUnits(const UnitByPixel<V>& by_px, double uu, double uv, double vv) {
  const V x_along_u = uu * by_px.x_by_u + uv * by_px.x_by_v;
  const V x_along_v = uv * by_px.x_by_u + vv * by_px.x_by_v;
  return {x_along_u * by_px.x_by_u + x_along_v * by_px.x_by_v, x_along_u * by_px.y_by_u + x_along_v * by_px.y_by_v,
          by_px.y_by_u * (uu * by_px.y_by_u + 2.0 * uv * by_px.y_by_v) + vv * by_px.y_by_v * by_px.y_by_v};
}

// The inverse standard deviations of a Gaussian along the axes of the unit coordinates, and its correlation.
template <class V>
struct UnitBlur {
  V inverse_x;
  V inverse_y;
  V correlation;
};
template <class V>
HEBA_INLINE UnitBlur<V> BlurOf(const UnitCovariance<V>& covariance) {
  const V inverse_x = 1.0 / SqrtLanes<V>(covariance.xx);
  const V inverse_y = 1.0 / SqrtLanes<V>(covariance.yy);
  const V most = AllLanes<V>(0.999);
  V correlation = covariance.xy * inverse_x * inverse_y;
  correlation = correlation > most ? most : correlation;
  correlation = correlation < -most ? -most : correlation;
  return {inverse_x, inverse_y, correlation};
}

// The square root of the weight of a residual, and its loss.
template <class V>
struct WeightedLoss {
  V root;
  V rho;
};
// `counts` is 1 for the pixels that count and 0 for the others, whose weight is 0.
template <class V>
HEBA_INLINE WeightedLoss<V> LossOfResidual(const V& residual, const V& counts, double huber_grey) {
  if (LargestLane(AbsLanes(residual)) > huber_grey) {
    const HuberLanes<V> huber = HuberOf(residual, huber_grey);
    return {counts * SqrtLanes(huber.weight), 0.5 * huber.cost};
  }
  return {counts, 0.5 * residual * residual};
}

// Returns the largest standard deviation of the blur in any direction.
double LargestBlurPx(const double* params) {
  return params[kBlur] * std::sqrt(1 + std::hypot(params[kStretch], params[kStretch + 1]));
}

}  // namespace

std::vector<int> SoughtParams(MapForm form, bool is_stretch_free) {
  std::vector<int> params = SoughtTerms(form);
  const int end = IsLightBent(form) ? kStretch : kLightBend;
  for (int k = kBlack; k < end; ++k) params.push_back(k);
  for (int k = kStretch; is_stretch_free && k < kNumPatternParams; ++k) params.push_back(k);
  return params;
}

UnitCells::Table::Table(const Eigen::MatrixXd& matrix) : num_columns(static_cast<size_t>(matrix.cols())) {
  for (Eigen::Index row = 0; row < matrix.rows(); ++row) {
    for (Eigen::Index column = 0; column < matrix.cols(); ++column) values.push_back(matrix(row, column));
  }
}

namespace {

Eigen::MatrixXd StepsAlongX(const Eigen::MatrixXd& cells) {
  return cells.rightCols(cells.cols() - 1) - cells.leftCols(cells.cols() - 1);
}
Eigen::MatrixXd StepsAlongY(const Eigen::MatrixXd& cells) {
  return cells.bottomRows(cells.rows() - 1) - cells.topRows(cells.rows() - 1);
}

}  // namespace

UnitCells::UnitCells(const CellPattern& pattern, const Eigen::Vector2d& centre_m, const Eigen::Vector2d& half_m)
    : albedo_(pattern.albedo),
      step_x_(StepsAlongX(pattern.albedo)),
      step_y_(StepsAlongY(pattern.albedo)),
      twist_(StepsAlongY(StepsAlongX(pattern.albedo))) {
  for (const double x_m : pattern.x_m) x_.push_back((x_m - centre_m.x()) / half_m.x());
  for (const double y_m : pattern.y_m) y_.push_back((y_m - centre_m.y()) / half_m.y());
}

void UnitCells::FindEdgesWithin(double x, double y, double support_radius_x, double support_radius_y,
                                Window* window) const {
  // The search begins at the last window, which is near.
  const auto find = [](const std::vector<double>& lines, double from, double to, size_t* first) {
    size_t begin = std::min(*first, lines.size());
    while (begin > 0 && lines[begin - 1] >= from) --begin;
    while (begin < lines.size() && lines[begin] < from) ++begin;
    size_t end = begin;
    while (end < lines.size() && lines[end] <= to) ++end;
    *first = begin;
    return end;
  };
  const size_t end_x = find(x_, x - support_radius_x, x + support_radius_x, &window->first_x);
  const size_t end_y = find(y_, y - support_radius_y, y + support_radius_y, &window->first_y);
  window->num_x = 0;
  window->num_y = 0;
  for (size_t i = window->first_x; i < end_x; ++i) {
    for (size_t j = window->first_y; j <= end_y; ++j) {
      if (step_x_(j, i) == 0) continue;
      window->x[window->num_x++] = i;
      break;
    }
  }
  for (size_t j = window->first_y; j < end_y; ++j) {
    for (size_t i = window->first_x; i <= end_x; ++i) {
      if (step_y_(j, i) == 0) continue;
      window->y[window->num_y++] = j;
      break;
    }
  }
}

void UnitCells::Write(const Window& window, double x, double y, size_t num_x, size_t num_y, size_t stride,
                      double* to) const {
  to[0] = albedo_(window.first_y, window.first_x);
  // Writes the position of the nearest line and 0.5 if there is one.
  const auto write_nearest = [&](const std::vector<double>& lines, const size_t* seen, size_t size, double at,
                                 double* place) {
    double distance = std::numeric_limits<double>::infinity();
    for (size_t k = 0; k < size; ++k) {
      const double line = lines[seen[k]];
      if (std::abs(line - at) >= distance) continue;
      distance = std::abs(line - at);
      place[0] = line;
      place[stride] = 0.5;
    }
  };
  write_nearest(x_, window.x, window.num_x, x, to + stride);
  write_nearest(y_, window.y, window.num_y, y, to + 3 * stride);
  double* next = to + 5 * stride;
  for (size_t i = 0; i < window.num_x; ++i) {
    next[2 * i * stride] = x_[window.x[i]];
    next[(2 * i + 1) * stride] = step_x_(window.first_y, window.x[i]);
  }
  next += 2 * num_x * stride;
  for (size_t j = 0; j < window.num_y; ++j) {
    next[2 * j * stride] = y_[window.y[j]];
    next[(2 * j + 1) * stride] = step_y_(window.y[j], window.first_x);
  }
  next += 2 * num_y * stride;
  for (size_t j = 0; j < window.num_y; ++j) {
    for (size_t i = 0; i < window.num_x; ++i) {
      next[(j * num_x + i) * stride] = twist_(window.y[j], window.x[i]);
    }
  }
}

PatternPixels::PatternPixels(const std::vector<Pixel>& pixels, const Eigen::Vector2d& light_px, double light_size_px)
    : size_(pixels.size()) {
  const size_t padded = PaddedToLanes(size_);
  for (std::vector<double>* column : {&u_, &v_, &light_x_, &light_y_, &grey_, &counts_, &x_, &y_}) {
    column->resize(padded);
  }
  for (size_t i = 0; i < padded; ++i) {
    const Pixel& pixel = pixels[std::min(i, size_ - 1)];
    u_[i] = pixel.u;
    v_[i] = pixel.v;
    light_x_[i] = (pixel.u - light_px.x()) / light_size_px;
    light_y_[i] = (pixel.v - light_px.y()) / light_size_px;
    grey_[i] = pixel.grey;
    counts_[i] = i < size_ ? 1 : 0;
    x_[i] = pixel.x;
    y_[i] = pixel.y;
  }
}

// The input and output of the kernels; the arrays are indexed by pixel.
struct PatternTask {
  const PatternMap* map;
  const double* params;
  double huber_grey;
  PatternColumns columns;
  const double* u;
  const double* v;
  const double* light_x;
  const double* light_y;
  const double* grey;
  const double* counts;
  // Unit coordinates: the start of the inversion, and its result.
  const double* from_x;
  const double* from_y;
  double* x;
  double* y;
};

namespace {

// Computes the unit coordinates of the pixels and the support radius of each. Returns false if the map cannot be
// inverted.
template <int kLanes>
HEBA_INLINE bool FindReach(const PatternTask& task, size_t size, double* support_radius_x, double* support_radius_y) {
  using V = Lanes<kLanes>;
  const double support_radius_px = kSupportRadius * LargestBlurPx(task.params) + kMaxMovePx;
  const double squared = support_radius_px * support_radius_px;
  for (size_t i = 0; i < size; i += kLanes) {
    V x = LoadLanes<V>(task.from_x + i);
    V y = LoadLanes<V>(task.from_y + i);
    MappedPoint<V> point;
    if (!Invert(*task.map, task.params, LoadLanes<V>(task.u + i), LoadLanes<V>(task.v + i), &x, &y, &point)) {
      return false;
    }
    const UnitCovariance<V> support = InUnits(InverseOf(point), squared, 0, squared);
    StoreLanes(x, task.x + i);
    StoreLanes(y, task.y + i);
    StoreLanes(SqrtLanes<V>(support.xx), support_radius_x + i);
    StoreLanes(SqrtLanes<V>(support.yy), support_radius_y + i);
  }
  return true;
}

// Some rows of the columns of PatternSums::products; the columns are kStride apart.
struct Rows {
  static constexpr int kStride = 64;
  // GramMatrix requires one more column.
  alignas(64) double columns[GramMatrix::kMaxColumns + 1][kStride];
  double cost = 0;
  ResidualsAtEdges at_edges;
};

// Computes the residuals and the columns of pixels i to i + kLanes - 1. Returns false if the map cannot be inverted.
template <int kLanes>
HEBA_INLINE bool FillRow(const PatternTask& task, size_t i, const double* numbers, int num_x, int num_y,
                         double* residuals, double* columns, double* cost, ResidualsAtEdges* at_edges) {
  using V = Lanes<kLanes>;
  const PatternMap& map = *task.map;
  const double* const params = task.params;
  V x = LoadLanes<V>(task.from_x + i);
  V y = LoadLanes<V>(task.from_y + i);
  MappedPoint<V> point;
  if (!Invert(map, params, LoadLanes<V>(task.u + i), LoadLanes<V>(task.v + i), &x, &y, &point)) return false;
  StoreLanes(x, task.x + i);
  StoreLanes(y, task.y + i);
  // The map's derivative half way to the lines that blur into the pixel gives the distance to them to second order.
  const auto half_way = [&](const V& at, int which) __attribute__((always_inline))->V {
    const V line = LoadLanes<V>(numbers + which * kLanes);
    return at + LoadLanes<V>(numbers + (which + 1) * kLanes) * (line - at);
  };
  const MappedPoint<V> there = MapPoint(map, params, half_way(x, 1), half_way(y, 3));
  // The sum is not a number if the map is undefined there.
  if (!(SumOfLanes<V>(1.0 / AbsLanes(Determinant(there))) < 1e12)) return false;
  const UnitByPixel<V> by_px = InverseOf(there);
  const double variance_px2 = params[kBlur] * params[kBlur];
  const double p = params[kStretch];
  const double q = params[kStretch + 1];
  const UnitBlur<V> blur = BlurOf(InUnits(by_px, variance_px2 * (1 + p), variance_px2 * q, variance_px2 * (1 - p)));
  const BlurredLanes<V> albedo = Blur(numbers, num_x, num_y, x, y, blur.inverse_x, blur.inverse_y, blur.correlation);
  const V light_x = LoadLanes<V>(task.light_x + i);
  const V light_y = LoadLanes<V>(task.light_y + i);
  const V light[kNumLight] = {light_x, light_y, light_x * light_x, light_x * light_y, light_y * light_y};
  V lit = AllLanes<V>(1);
  for (int k = 0; k < kNumLight; ++k) lit += params[kLight + k] * light[k];
  const double contrast = params[kWhite] - params[kBlack];
  const V level = params[kBlack] + albedo.value * contrast;
  const V scale = lit * contrast;
  const V residual = lit * level - LoadLanes<V>(task.grey + i);
  const V counts = LoadLanes<V>(task.counts + i);
  const WeightedLoss<V> loss = LossOfResidual(residual, counts, task.huber_grey);
  StoreLanes(residual, residuals + i);
  *cost += SumOfLanes<V>(counts * loss.rho);
  const V by_x = albedo.by_a * blur.inverse_x * scale * loss.root;
  const V by_y = albedo.by_b * blur.inverse_y * scale * loss.root;
  // The pattern moves with the map while the pixel stays: the derivatives have the opposite sign of the image's
  // gradient.
  const V by_u = -(by_px.x_by_u * by_x + by_px.y_by_u * by_y);
  const V by_v = -(by_px.x_by_v * by_x + by_px.y_by_v * by_y);
  const V edge_weight = by_u * by_u + by_v * by_v;
  const V size = loss.root * AbsLanes(residual);
  at_edges->weights += SumOfLanes<V>(edge_weight);
  at_edges->weights_squared += SumOfLanes<V>(edge_weight * edge_weight);
  at_edges->sizes += SumOfLanes<V>(edge_weight * size);
  at_edges->squares += SumOfLanes<V>(edge_weight * size * size);
  const auto add = [&](const V& column) __attribute__((always_inline)) {
    StoreLanes(column, columns);
    columns += Rows::kStride;
  };
  const auto in_u = [&](const V& px) __attribute__((always_inline)) { add(by_u * px); };
  const auto in_v = [&](const V& px) __attribute__((always_inline)) { add(by_v * px); };
  ForEachDisplacement(
      map, x, y, in_u,
      in_v, [&](const V& u_px, const V& v_px) __attribute__((always_inline)) { add(by_u * u_px + by_v * v_px); });
  const V root_lit = loss.root * lit;
  add(root_lit * (1.0 - albedo.value));
  add(root_lit * albedo.value);
  add(loss.root * scale * (albedo.by_aa + 2.0 * blur.correlation * albedo.by_ab + albedo.by_bb) * (1 / params[kBlur]));
  const V root_level = loss.root * level;
  const int num_light = IsLightBent(map.form) ? kNumLight : kLightBend - kLight;
  for (int k = 0; k < num_light; ++k) add(root_level * light[k]);
  // Adds the derivative by a parameter of the blur by which its covariance changes like this.
  const auto add_blur = [&](double uu, double uv, double vv) __attribute__((always_inline)) {
    const UnitCovariance<V> change = InUnits(by_px, uu, uv, vv);
    add(loss.root * scale *
        (0.5 * (albedo.by_aa * blur.inverse_x * blur.inverse_x * change.xx +
                albedo.by_bb * blur.inverse_y * blur.inverse_y * change.yy) +
         albedo.by_ab * blur.inverse_x * blur.inverse_y * change.xy));
  };
  const auto add_stretch = [&]() __attribute__((always_inline)) {
    add_blur(variance_px2, 0, -variance_px2);
    add_blur(0, variance_px2, 0);
  };
  if (task.columns.stretch) add_stretch();
  add(loss.root * residual);
  if (!task.columns.additional) return true;
  ForEachPower(x, y, true, in_u);
  ForEachPower(x, y, true, in_v);
  if (!task.columns.stretch) add_stretch();
  return true;
}

template <int kLanes>
HEBA_INLINE bool FillRows(const PatternTask& task, size_t begin, size_t end, const double* numbers,
                          const PatternGroup* groups, double* residuals, Rows* rows) {
  for (size_t i = begin; i < end; i += kLanes, ++groups) {
    if (!FillRow<kLanes>(task, i, numbers + groups->begin, groups->num_x, groups->num_y, residuals,
                         rows->columns[0] + (i - begin), &rows->cost, &rows->at_edges)) {
      return false;
    }
  }
  return true;
}

bool FindReachBaseline(const PatternTask& task, size_t size, double* support_radius_x, double* support_radius_y) {
  return FindReach<kLanesOf<Simd::kBaseline>>(task, size, support_radius_x, support_radius_y);
}
HEBA_TARGET_AVX2 bool FindReachAvx2(const PatternTask& task, size_t size, double* support_radius_x,
                                    double* support_radius_y) {
  return FindReach<kLanesOf<Simd::kAvx2>>(task, size, support_radius_x, support_radius_y);
}
HEBA_TARGET_AVX512 bool FindReachAvx512(const PatternTask& task, size_t size, double* support_radius_x,
                                        double* support_radius_y) {
  return FindReach<kLanesOf<Simd::kAvx512>>(task, size, support_radius_x, support_radius_y);
}
bool FillRowsBaseline(const PatternTask& task, size_t begin, size_t end, const double* numbers,
                      const PatternGroup* groups, double* residuals, Rows* rows) {
  return FillRows<kLanesOf<Simd::kBaseline>>(task, begin, end, numbers, groups, residuals, rows);
}
HEBA_TARGET_AVX2 bool FillRowsAvx2(const PatternTask& task, size_t begin, size_t end, const double* numbers,
                                   const PatternGroup* groups, double* residuals, Rows* rows) {
  return FillRows<kLanesOf<Simd::kAvx2>>(task, begin, end, numbers, groups, residuals, rows);
}
HEBA_TARGET_AVX512 bool FillRowsAvx512(const PatternTask& task, size_t begin, size_t end, const double* numbers,
                                       const PatternGroup* groups, double* residuals, Rows* rows) {
  return FillRows<kLanesOf<Simd::kAvx512>>(task, begin, end, numbers, groups, residuals, rows);
}

// Returns the largest distance between the images of the pattern's corners, the midpoints of its sides and its centre
// under two maps.
double FarthestPx(const PatternMap& map, const PatternParams& a, const PatternParams& b) {
  double farthest_px = 0;
  for (const double x : {-1.0, 0.0, 1.0}) {
    for (const double y : {-1.0, 0.0, 1.0}) {
      const MappedPoint<double> at_a = MapPoint(map, a.data(), x, y);
      const MappedPoint<double> at_b = MapPoint(map, b.data(), x, y);
      farthest_px = std::max(farthest_px, std::hypot(at_a.u - at_b.u, at_a.v - at_b.v));
    }
  }
  return farthest_px;
}

}  // namespace

void PatternRows::SetPixels(PatternPixels pixels) {
  pixels_ = std::move(pixels);
  tried_x_ = pixels_.x_;
  tried_y_ = pixels_.y_;
  looked_.reset();
}

void PatternRows::Keep() {
  pixels_.x_.swap(tried_x_);
  pixels_.y_.swap(tried_y_);
}

bool PatternRows::FindEdgesWithin(const PatternTask& task) {
  const size_t padded = pixels_.u_.size();
  const Simd set = ActiveSimd();
  const auto lanes = static_cast<size_t>(NumLanes(set));
  std::vector<double> support_radius_x(padded);
  std::vector<double> support_radius_y(padded);
  if (!SelectForIsa(set, &FindReachBaseline, &FindReachAvx2, &FindReachAvx512)(task, padded, support_radius_x.data(),
                                                                               support_radius_y.data())) {
    return false;
  }
  groups_.clear();
  numbers_.clear();
  std::array<UnitCells::Window, kMaxLanes> windows;
  for (size_t begin = 0; begin < padded; begin += lanes) {
    size_t num_x = 0;
    size_t num_y = 0;
    for (size_t lane = 0; lane < lanes; ++lane) {
      const size_t i = begin + lane;
      cells_.FindEdgesWithin(tried_x_[i], tried_y_[i], support_radius_x[i], support_radius_y[i], &windows[lane]);
      num_x = std::max(num_x, windows[lane].num_x);
      num_y = std::max(num_y, windows[lane].num_y);
    }
    groups_.push_back({numbers_.size(), static_cast<int>(num_x), static_cast<int>(num_y)});
    numbers_.resize(numbers_.size() + lanes * UnitCells::Size(num_x, num_y), 0.0);
    for (size_t lane = 0; lane < lanes; ++lane) {
      const size_t i = begin + lane;
      cells_.Write(windows[lane], tried_x_[i], tried_y_[i], num_x, num_y, lanes,
                   numbers_.data() + groups_.back().begin + lane);
    }
  }
  return true;
}

std::optional<PatternSums> PatternRows::Sum(const PatternMap& map, const PatternParams& params, double huber_grey,
                                            PatternColumns columns) {
  const PatternTask task = {&map,
                            params.data(),
                            huber_grey,
                            columns,
                            pixels_.u_.data(),
                            pixels_.v_.data(),
                            pixels_.light_x_.data(),
                            pixels_.light_y_.data(),
                            pixels_.grey_.data(),
                            pixels_.counts_.data(),
                            pixels_.x_.data(),
                            pixels_.y_.data(),
                            tried_x_.data(),
                            tried_y_.data()};
  // The edges found for a larger blur include those of a smaller one.
  constexpr double kMaxGrowth = 1.1;
  constexpr double kMaxShrink = 0.6;
  const double blur_px = LargestBlurPx(params.data());
  const double looked_px = looked_ ? LargestBlurPx(looked_->data()) : 0;
  if (!looked_ || !(FarthestPx(map, params, *looked_) <= kMaxMovePx) ||
      !(blur_px <= kMaxGrowth * looked_px && blur_px >= kMaxShrink * looked_px)) {
    looked_.reset();
    if (!FindEdgesWithin(task)) return std::nullopt;
    looked_ = params;
  }
  CHECK(!columns.additional || map.form == MapForm::kLens);
  int num_columns = static_cast<int>(SoughtParams(map.form, columns.stretch).size()) + 1;
  if (columns.additional) num_columns += 2 * PatternMap::kNumPolynomial;
  if (columns.additional && !columns.stretch) num_columns += 2;
  const size_t padded = pixels_.u_.size();
  PatternSums sums;
  sums.residuals.resize(padded);
  const Simd set = ActiveSimd();
  const auto fill = SelectForIsa(set, &FillRowsBaseline, &FillRowsAvx2, &FillRowsAvx512);
  const auto lanes = static_cast<size_t>(NumLanes(set));
  GramMatrix products(num_columns, Rows::kStride);
  Rows rows;
  for (size_t begin = 0; begin < padded; begin += Rows::kStride) {
    const size_t end = std::min(padded, begin + Rows::kStride);
    const PatternGroup* const groups = groups_.data() + begin / lanes;
    if (!fill(task, begin, end, numbers_.data(), groups, sums.residuals.data(), &rows)) return std::nullopt;
    products.Add(rows.columns[0], static_cast<Eigen::Index>(end - begin));
  }
  if (!std::isfinite(rows.cost)) return std::nullopt;
  sums.products = products.Matrix();
  sums.cost = rows.cost;
  sums.at_edges = rows.at_edges;
  sums.residuals.resize(pixels_.size());
  return sums;
}

BlurredAlbedo Blurred(const CellPattern& pattern, const Eigen::Vector2d& at_m, const Eigen::Matrix2d& image_by_pattern,
                      double blur_sigma_px) {
  const UnitCells cells(pattern, Eigen::Vector2d::Zero(), Eigen::Vector2d::Ones());
  const Eigen::Matrix2d pattern_by_image = image_by_pattern.inverse();
  const double sigma_x = blur_sigma_px * pattern_by_image.row(0).norm();
  const double sigma_y = blur_sigma_px * pattern_by_image.row(1).norm();
  UnitCells::Window window;
  cells.FindEdgesWithin(at_m.x(), at_m.y(), kSupportRadius * sigma_x, kSupportRadius * sigma_y, &window);
  std::vector<double> numbers(UnitCells::Size(window.num_x, window.num_y), 0.0);
  cells.Write(window, at_m.x(), at_m.y(), window.num_x, window.num_y, 1, numbers.data());
  const double correlation = std::clamp(
      blur_sigma_px * blur_sigma_px * pattern_by_image.row(0).dot(pattern_by_image.row(1)) / (sigma_x * sigma_y),
      -0.999, 0.999);
  const BlurredLanes<double> blurred =
      Blur(numbers.data(), static_cast<int>(window.num_x), static_cast<int>(window.num_y), at_m.x(), at_m.y(),
           1 / sigma_x, 1 / sigma_y, correlation);
  const double by_scale = blurred.by_aa + 2 * correlation * blurred.by_ab + blurred.by_bb;
  return {blurred.value, {blurred.by_a / sigma_x, blurred.by_b / sigma_y}, by_scale / blur_sigma_px};
}

}  // namespace heba
