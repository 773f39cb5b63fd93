#include "targets/pattern_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>

#include <Eigen/Dense>

#include "heba/base/error.h"
#include "targets/homography.h"

namespace heba {
namespace {

// Beyond this many standard deviations a Gaussian has no weight worth counting (6e-5).
constexpr double kReach = 4.0;

double Cdf(double x) { return 0.5 * std::erfc(-x * std::numbers::sqrt2 / 2); }
double Density(double x) { return std::exp(-0.5 * x * x) * (std::numbers::inv_sqrtpi / std::numbers::sqrt2); }

// The bivariate normal distribution function of correlation sin(angle): the product of the two plus an integral over
// the angle (Plackett 1954), by Gauss-Legendre, of as many pairs of nodes as the angle asks for (to 1e-8).
double Cdf2(double a, double b, double cdf_a, double cdf_b, double angle) {
  struct Pair {
    double node;
    double weight;
  };
  static constexpr Pair kTwo[] = {{0.5773502691896257, 1.0}};
  static constexpr Pair kFour[] = {{0.3399810435848563, 0.6521451548625461}, {0.8611363115940526, 0.3478548451374538}};
  static constexpr Pair kSix[] = {{0.2386191860831969, 0.4679139345726910},
                                  {0.6612093864662645, 0.3607615730481386},
                                  {0.9324695142031521, 0.1713244923791704}};
  const double size = std::abs(angle);
  const std::span<const Pair> pairs = size < 0.05  ? std::span<const Pair>(kTwo)
                                      : size < 0.4 ? std::span<const Pair>(kFour)
                                                   : std::span<const Pair>(kSix);
  double sum = 0;
  for (const Pair& pair : pairs) {
    for (const double node : {pair.node, -pair.node}) {
      const double s = std::sin(0.5 * angle * (1 + node));
      sum += pair.weight * std::exp(-(a * a + b * b - 2 * a * b * s) / (2 * (1 - s * s)));
    }
  }
  return cdf_a * cdf_b + sum * 0.5 * angle / (2 * std::numbers::pi);
}

constexpr size_t kMaxLines = 64;  // Of a pattern, along either axis.

// The lines within reach of `at`: the first and the one past the last.
struct LineRange {
  size_t begin = 0;
  size_t end = 0;
};
LineRange LinesNear(const std::vector<double>& lines, double at, double reach) {
  const auto begin = std::lower_bound(lines.begin(), lines.end(), at - reach);
  const auto end = std::upper_bound(begin, lines.end(), at + reach);
  return {static_cast<size_t>(begin - lines.begin()), static_cast<size_t>(end - lines.begin())};
}

// The line nearest to `at`; `at` itself if none is within `reach`.
double NearestOf(const std::vector<double>& lines, double at, double reach) {
  double nearest = at;
  double distance = reach;
  const auto above = std::lower_bound(lines.begin(), lines.end(), at);
  if (above != lines.end() && *above - at < distance) {
    nearest = *above;
    distance = *above - at;
  }
  if (above != lines.begin() && at - *(above - 1) < distance) nearest = *(above - 1);
  return nearest;
}

// Cells that are lines closer than this together are drawing round-off.
constexpr double kSameLineRatio = 1e-6;

std::vector<double> Lines(std::vector<double> at, double min, double max) {
  std::sort(at.begin(), at.end());
  const double tolerance = kSameLineRatio * (max - min);
  std::vector<double> lines;
  for (const double line : at) {
    if (line <= min + tolerance || line >= max - tolerance) continue;
    if (lines.empty() || line > lines.back() + tolerance) lines.push_back(line);
  }
  return lines;
}

double CellMiddle(const std::vector<double>& lines, size_t cell, double min, double max) {
  const double low = cell == 0 ? min : lines[cell - 1];
  const double high = cell == lines.size() ? max : lines[cell];
  return 0.5 * (low + high);
}

bool Covers(const Shape& rectangle, const Eigen::Vector2d& at_m) {
  Eigen::Vector2d low = rectangle.points_m.front();
  Eigen::Vector2d high = low;
  for (const Eigen::Vector2d& corner : rectangle.points_m) {
    low = low.cwiseMin(corner);
    high = high.cwiseMax(corner);
  }
  return (at_m.array() > low.array()).all() && (at_m.array() < high.array()).all();
}

}  // namespace

CellPattern CellsOf(const Drawing& drawing, const Eigen::Vector2d& min_m, const Eigen::Vector2d& max_m) {
  std::vector<const Shape*> near;
  std::vector<double> x_m;
  std::vector<double> y_m;
  for (const Shape& shape : drawing.shapes) {
    CHECK_EQ(shape.points_m.size(), 4U) << "a pattern of cells is drawn in rectangles";
    Eigen::Vector2d low = shape.points_m.front();
    Eigen::Vector2d high = low;
    for (const Eigen::Vector2d& corner : shape.points_m) {
      low = low.cwiseMin(corner);
      high = high.cwiseMax(corner);
    }
    if ((high.array() <= min_m.array()).any() || (low.array() >= max_m.array()).any()) continue;
    near.push_back(&shape);
    x_m.insert(x_m.end(), {low.x(), high.x()});
    y_m.insert(y_m.end(), {low.y(), high.y()});
  }
  CellPattern pattern;
  pattern.x_m = Lines(std::move(x_m), min_m.x(), max_m.x());
  pattern.y_m = Lines(std::move(y_m), min_m.y(), max_m.y());
  CHECK(std::max(pattern.x_m.size(), pattern.y_m.size()) <= kMaxLines) << "a pattern of too many cells";
  pattern.albedo.setConstant(static_cast<Eigen::Index>(pattern.y_m.size()) + 1,
                             static_cast<Eigen::Index>(pattern.x_m.size()) + 1, drawing.ground);
  for (Eigen::Index j = 0; j < pattern.albedo.rows(); ++j) {
    for (Eigen::Index i = 0; i < pattern.albedo.cols(); ++i) {
      const Eigen::Vector2d middle_m(CellMiddle(pattern.x_m, static_cast<size_t>(i), min_m.x(), max_m.x()),
                                     CellMiddle(pattern.y_m, static_cast<size_t>(j), min_m.y(), max_m.y()));
      for (const Shape* shape : near) {
        if (Covers(*shape, middle_m)) pattern.albedo(j, i) = shape->albedo;
      }
    }
  }
  return pattern;
}

namespace {

// `with_value`: or derivatives only.
BlurredAlbedo Blur(const CellPattern& pattern, const Eigen::Vector2d& at_m, const Eigen::Matrix2d& picture_by_pattern,
                   double blur_sigma_px, bool with_value) {
  // The blur as seen in the pattern.
  const Eigen::Matrix2d pattern_by_picture = picture_by_pattern.inverse();
  const double sx = blur_sigma_px * pattern_by_picture.row(0).norm();
  const double sy = blur_sigma_px * pattern_by_picture.row(1).norm();
  const double correlation =
      std::clamp(blur_sigma_px * blur_sigma_px * pattern_by_picture.row(0).dot(pattern_by_picture.row(1)) / (sx * sy),
                 -0.999, 0.999);
  const LineRange x_range = LinesNear(pattern.x_m, at_m.x(), kReach * sx);
  const LineRange y_range = LinesNear(pattern.y_m, at_m.y(), kReach * sy);
  const auto albedo = [&](size_t j, size_t i) {
    return pattern.albedo(static_cast<Eigen::Index>(j), static_cast<Eigen::Index>(i));
  };
  BlurredAlbedo result;
  result.value = albedo(y_range.begin, x_range.begin);
  double by_a = 0;  // By at_m.x() / sx, and so on.
  double by_b = 0;
  double by_scale = 0;  // By log(blur).
  // Of each line within reach: how far away it is in sigma, and what the normal distribution makes of that.
  struct Line {
    double at;
    double cdf;
    double density;
  };
  // Not set to 0 first: this is called for every pixel.
  std::array<Line, kMaxLines> x_lines;
  std::array<Line, kMaxLines> y_lines;
  const auto look = [](const std::vector<double>& lines, const LineRange& range, double at, double sigma,
                       std::array<Line, kMaxLines>* seen) {
    const size_t size = range.end - range.begin;
    CHECK_LE(size, kMaxLines);
    for (size_t k = 0; k < size; ++k) {
      const double a = (at - lines[range.begin + k]) / sigma;
      (*seen)[k] = {a, Cdf(a), Density(a)};
    }
    return size;
  };
  const size_t num_x = look(pattern.x_m, x_range, at_m.x(), sx, &x_lines);
  const size_t num_y = look(pattern.y_m, y_range, at_m.y(), sy, &y_lines);
  for (size_t i = 0; i < num_x; ++i) {
    const double step = albedo(y_range.begin, x_range.begin + i + 1) - albedo(y_range.begin, x_range.begin + i);
    const double slope = step * x_lines[i].density;
    result.value += step * x_lines[i].cdf;
    by_a += slope;
    by_scale -= slope * x_lines[i].at;
  }
  for (size_t j = 0; j < num_y; ++j) {
    const double step = albedo(y_range.begin + j + 1, x_range.begin) - albedo(y_range.begin + j, x_range.begin);
    const double slope = step * y_lines[j].density;
    result.value += step * y_lines[j].cdf;
    by_b += slope;
    by_scale -= slope * y_lines[j].at;
  }
  const double angle = std::asin(correlation);
  const double rest = std::sqrt(1 - correlation * correlation);
  for (size_t j = 0; j < num_y; ++j) {
    for (size_t i = 0; i < num_x; ++i) {
      const size_t row = y_range.begin + j;
      const size_t column = x_range.begin + i;
      const double twist =
          albedo(row + 1, column + 1) - albedo(row, column + 1) - albedo(row + 1, column) + albedo(row, column);
      if (twist == 0) continue;
      const double a = x_lines[i].at;
      const double b = y_lines[j].at;
      if (with_value) result.value += twist * Cdf2(a, b, x_lines[i].cdf, y_lines[j].cdf, angle);
      const double slope_a = twist * x_lines[i].density * Cdf((b - correlation * a) / rest);
      const double slope_b = twist * y_lines[j].density * Cdf((a - correlation * b) / rest);
      by_a += slope_a;
      by_b += slope_b;
      by_scale -= slope_a * a + slope_b * b;
    }
  }
  result.by_at = {by_a / sx, by_b / sy};
  result.by_blur = by_scale / blur_sigma_px;
  return result;
}

}  // namespace

BlurredAlbedo Blurred(const CellPattern& pattern, const Eigen::Vector2d& at_m,
                      const Eigen::Matrix2d& picture_by_pattern, double blur_sigma_px) {
  return Blur(pattern, at_m, picture_by_pattern, blur_sigma_px, true);
}

namespace {

// The map from the pattern, its used rectangle scaled to [-1, 1] on both axes, into the picture: the start's homography
// plus a sum of displacements, which are a homography's six affine and two projective ones and two of a lens, radial
// about the picture's middle. Whatever a radial lens does to second order within the pattern is among them; for
// what it does beyond, a polynomial can be added.
class PatternMap {
 public:
  PatternMap(const Eigen::Matrix3d& picture_from_pattern, const PatternFitOptions& options,
             const Eigen::Vector2d& lens_px)
      : centre_m_(0.5 * (options.min_m + options.max_m)),
        half_m_(0.5 * (options.max_m - options.min_m)),
        num_terms_(NumTerms(options.freedom)),
        is_quadratic_(options.freedom == MapFreedom::kQuadratic),
        lens_px_(lens_px),
        lens_radius_px_(std::max(1.0, lens_px.norm())) {
    Eigen::Matrix3d pattern_from_unit = Eigen::Matrix3d::Identity();
    pattern_from_unit(0, 0) = half_m_.x();
    pattern_from_unit(1, 1) = half_m_.y();
    pattern_from_unit.topRightCorner<2, 1>() = centre_m_;
    start_ = picture_from_pattern * pattern_from_unit;
    start_inverse_ = start_.inverse();
    middle_px_ = Map(start_, Eigen::Vector2d::Zero());
    size_px_ = std::max({1.0, (Map(start_, Eigen::Vector2d(1, 0)) - middle_px_).norm(),
                         (Map(start_, Eigen::Vector2d(0, 1)) - middle_px_).norm()});
  }

  static constexpr int kAffineTerms = 6;
  static constexpr int kFirstLensTerm = 8;
  static constexpr int kLensTerms = 10;
  static constexpr int kSquares = 3;
  static constexpr int kPolynomial = kSquares + 4;  // And cubes.
  static constexpr int kMaxTerms = 24;
  using Displacements = Eigen::Matrix<double, 2, kMaxTerms>;

  int num_terms() const { return num_terms_; }
  // Perspective and lens then stay as they are.
  void AddPolynomial() { num_terms_ = kMaxTerms; }
  bool IsHeld(int term) const {
    if (num_terms_ < kMaxTerms || term < kAffineTerms) return false;
    return term < kLensTerms || (is_quadratic_ && (term - kLensTerms) % kPolynomial >= kSquares);
  }
  // The lens's two numbers are what it displaces at the picture's corner: hardly more than half the picture.
  double LensSigmaPx() const { return lens_radius_px_; }
  Eigen::Vector2d UnitOf(const Eigen::Vector2d& at_m) const { return (at_m - centre_m_).cwiseQuotient(half_m_); }
  Eigen::Vector2d InPattern(const Eigen::Vector2d& unit) const { return centre_m_ + unit.cwiseProduct(half_m_); }

  // Of a unit of each parameter, at unit coordinates q.
  // The first num_terms().
  Displacements DisplacementsAt(const Eigen::Vector2d& q) const {
    const Eigen::Vector2d start = Map(start_, q);
    const Eigen::Vector2d from_middle = (start - middle_px_) / size_px_;
    const Eigen::Vector2d from_lens = (start - lens_px_) / lens_radius_px_;
    const double r2 = from_lens.squaredNorm();
    Displacements terms;
    terms.leftCols<6>() << 1, q.x(), q.y(), 0, 0, 0, 0, 0, 0, 1, q.x(), q.y();
    if (is_quadratic_) {
      terms.rightCols<kMaxTerms - kAffineTerms>().setZero();
      terms.row(0).segment<kPolynomial>(kLensTerms) = Polynomial(q.x(), q.y());
      terms.row(1).tail<kPolynomial>() = terms.row(0).segment<kPolynomial>(kLensTerms);
      return terms;
    }
    terms.col(6) = from_middle * q.x();
    terms.col(7) = from_middle * q.y();
    terms.col(8) = from_lens * r2;
    terms.col(9) = from_lens * (r2 * r2);
    if (num_terms_ <= kLensTerms) return terms;
    terms.rightCols<2 * kPolynomial>().setZero();
    terms.row(0).segment<kPolynomial>(kLensTerms) = Polynomial(q.x(), q.y());
    terms.row(1).tail<kPolynomial>() = terms.row(0).segment<kPolynomial>(kLensTerms);
    return terms;
  }

  Eigen::Vector2d Pixel(const Eigen::VectorXd& params, const Eigen::Vector2d& q) const {
    const double x = q.x();
    const double y = q.y();
    const Eigen::Vector2d start = Map(start_, q);
    Eigen::Vector2d pixel =
        start + Eigen::Vector2d(params[0] + params[1] * x + params[2] * y, params[3] + params[4] * x + params[5] * y);
    if (num_terms_ == kAffineTerms) return pixel;
    if (is_quadratic_) {
      for (int axis = 0; axis < 2; ++axis) {
        const double* const p = params.data() + kLensTerms + axis * kPolynomial;
        pixel[axis] += x * x * p[0] + x * y * p[1] + y * y * p[2];
      }
      return pixel;
    }
    pixel += (params[6] * x + params[7] * y) / size_px_ * (start - middle_px_);
    const Eigen::Vector2d from_lens = (start - lens_px_) / lens_radius_px_;
    const double r2 = from_lens.squaredNorm();
    pixel += (params[8] + params[9] * r2) * r2 * from_lens;
    if (num_terms_ == kLensTerms) return pixel;
    const Eigen::Matrix<double, kPolynomial, 1> polynomial = Polynomial(x, y);
    pixel.x() += params.segment<kPolynomial>(kLensTerms).dot(polynomial);
    pixel.y() += params.segment<kPolynomial>(kLensTerms + kPolynomial).dot(polynomial);
    return pixel;
  }

  // Pixel's derivative by the unit coordinates.
  Eigen::Matrix2d Derivative(const Eigen::VectorXd& params, const Eigen::Vector2d& q) const {
    const Eigen::Vector3d h = start_ * q.homogeneous();
    const Eigen::Vector2d start = h.head<2>() / h.z();
    const Eigen::Matrix2d by_start = (start_.topLeftCorner<2, 2>() - start * start_.bottomLeftCorner<1, 2>()) / h.z();
    return WithTerms(params, q, start, by_start);
  }

  // By unit coordinates -> by metres.
  Eigen::Matrix2d PerMetre(const Eigen::Matrix2d& by_unit) const {
    return by_unit * half_m_.cwiseInverse().asDiagonal();
  }

  // The same for parameters of zero: the start's homography alone. Nothing beyond its horizon.
  std::optional<Eigen::Vector2d> InvertStart(const Eigen::Vector2d& pixel) const {
    const Eigen::Vector3d q = start_inverse_ * pixel.homogeneous();
    const Eigen::Vector2d unit = q.head<2>() / q.z();
    if (!unit.allFinite() || !((start_ * unit.homogeneous()).z() * start_(2, 2) > 0)) return std::nullopt;
    return unit;
  }

  // The unit coordinates that map to `pixel`, from a guess; `by_unit`, if not null, becomes the derivative near there.
  std::optional<Eigen::Vector2d> Invert(const Eigen::VectorXd& params, const Eigen::Vector2d& pixel,
                                        const Eigen::Vector2d& guess, Eigen::Matrix2d* by_unit = nullptr) const {
    Eigen::Vector2d q = guess;
    for (int iteration = 0; iteration < 10; ++iteration) {
      const Eigen::Matrix2d derivative = Derivative(params, q);
      const Eigen::Vector2d step = derivative.inverse() * (pixel - Pixel(params, q));
      if (!step.allFinite() || step.norm() > 2) return std::nullopt;
      q += step;
      // The error that is left goes with the step's square: 1e-4 px of a pattern that is strongly bent.
      if (step.norm() > 1e-3) continue;
      if (by_unit != nullptr) *by_unit = derivative;
      return q;
    }
    return std::nullopt;
  }

 private:
  static Eigen::Matrix<double, kPolynomial, 1> Polynomial(double x, double y) {
    return {x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y};
  }

  static int NumTerms(MapFreedom freedom) {
    switch (freedom) {
      case MapFreedom::kAffine:
        return kAffineTerms;
      case MapFreedom::kQuadratic:
        return kMaxTerms;
      case MapFreedom::kStrongLens:
        return kLensTerms;
    }
    return kLensTerms;
  }

  Eigen::Matrix2d WithTerms(const Eigen::VectorXd& params, const Eigen::Vector2d& q, const Eigen::Vector2d& start,
                            const Eigen::Matrix2d& by_start) const {
    Eigen::Matrix2d derivative = by_start;
    // Columns 0 to 5 of the displacements: (1, x, y) in u and in v.
    derivative.col(0) += Eigen::Vector2d(params[1], params[4]);
    derivative.col(1) += Eigen::Vector2d(params[2], params[5]);
    if (num_terms_ == kAffineTerms) return derivative;
    if (is_quadratic_) {
      for (int axis = 0; axis < 2; ++axis) {
        const double* const p = params.data() + kLensTerms + axis * kPolynomial;
        derivative(axis, 0) += 2 * q.x() * p[0] + q.y() * p[1];
        derivative(axis, 1) += q.x() * p[1] + 2 * q.y() * p[2];
      }
      return derivative;
    }
    const Eigen::Vector2d from_middle = (start - middle_px_) / size_px_;
    derivative += (params[6] * q.x() + params[7] * q.y()) / size_px_ * by_start;
    derivative += from_middle * Eigen::RowVector2d(params[6], params[7]);
    const Eigen::Vector2d from_lens = (start - lens_px_) / lens_radius_px_;
    const double r2 = from_lens.squaredNorm();
    const Eigen::Matrix2d outer = from_lens * from_lens.transpose();
    const Eigen::Matrix2d by_from_lens = params[8] * (r2 * Eigen::Matrix2d::Identity() + 2 * outer) +
                                         params[9] * (r2 * r2 * Eigen::Matrix2d::Identity() + 4 * r2 * outer);
    derivative += by_from_lens / lens_radius_px_ * by_start;
    if (num_terms_ == kLensTerms) return derivative;
    const double x = q.x();
    const double y = q.y();
    for (int axis = 0; axis < 2; ++axis) {
      const double* const p = params.data() + kLensTerms + axis * kPolynomial;
      derivative(axis, 0) += 2 * x * p[0] + y * p[1] + 3 * x * x * p[3] + 2 * x * y * p[4] + y * y * p[5];
      derivative(axis, 1) += x * p[1] + 2 * y * p[2] + x * x * p[4] + 2 * x * y * p[5] + 3 * y * y * p[6];
    }
    return derivative;
  }

  Eigen::Vector2d centre_m_;
  Eigen::Vector2d half_m_;
  int num_terms_;
  bool is_quadratic_;  // Perspective, lens and cubes are then 0.
  Eigen::Vector2d lens_px_;
  double lens_radius_px_;
  Eigen::Matrix3d start_;
  Eigen::Matrix3d start_inverse_;
  Eigen::Vector2d middle_px_;
  double size_px_ = 1;
};

// The middle of the whole picture, of which `grey` may be a part.
Eigen::Vector2d LensPx(const cv::Mat& grey) {
  cv::Size whole;
  cv::Point offset;
  grey.locateROI(whole, offset);
  return {0.5 * (whole.width - 1) - offset.x, 0.5 * (whole.height - 1) - offset.y};
}

struct FitPixel {
  Eigen::Vector2d at_px;
  Eigen::Vector2d light;  // From the pattern's middle, in units of its size: where the light's gradient is taken.
  Eigen::Vector2d unit;
  double grey = 0;
};

// The unknowns beside the map: black, white, blur, and the light's gradient and bend. A small pattern is taken to have
// no bend.
constexpr int kNumLight = 5;
constexpr int kNumLevels = 3 + kNumLight;
enum Level { kBlack, kWhite, kBlur, kLight, kLightBend = kLight + 2 };

Eigen::Matrix<double, kNumLight, 1> LightTerms(const Eigen::Vector2d& at) {
  return {at.x(), at.y(), at.x() * at.x(), at.x() * at.y(), at.y() * at.y()};
}

class Fitter {
 public:
  Fitter(const cv::Mat& grey, const CellPattern& pattern, const Eigen::Matrix3d& start,
         const PatternFitOptions& options)
      : pattern_(pattern),
        map_(start, options, LensPx(grey)),
        is_light_bent_(options.freedom == MapFreedom::kStrongLens),
        params_(Eigen::VectorXd::Zero(map_.num_terms() + kNumLevels)) {
    CollectPixels(grey);
    if (is_usable_) StartLevels();
  }

  bool is_usable() const { return is_usable_; }
  const PatternMap& map() const { return map_; }
  const Eigen::VectorXd& params() const { return params_; }
  double level(Level which) const { return params_[map_.num_terms() + which]; }
  double contrast() const { return level(kWhite) - level(kBlack); }

  // By least squares first; then what deviates counts less. False if a step leads nowhere that can be computed.
  bool Solve() {
    constexpr double kRoughPx = 0.02;
    if (!Descend(std::numeric_limits<double>::infinity(), kRoughPx)) return false;
    constexpr double kHuber = 2.5;
    constexpr double kMinNoiseGrey = 0.3;  // A pixel's rounding.
    huber_ = kHuber * std::max(kMinNoiseGrey, NoiseOf(result_.residuals));
    return Descend(huber_, kFinePx);
  }

  // Goes on with squares and cubes in place of perspective and lens if the grey values ask for them: if the cost would
  // fall by more than chance lets it (chi-square of the added numbers, 2 sigma).
  bool AddPolynomialIfAsked() {
    const PatternMap map = map_;
    const Eigen::VectorXd params = params_;
    Equations result = result_;
    const int num_before = map.num_terms();
    map_.AddPolynomial();
    const int num_added =
        map_.num_terms() - PatternMap::kLensTerms - (PatternMap::kLensTerms - PatternMap::kAffineTerms);
    params_ = Eigen::VectorXd::Zero(map_.num_terms() + kNumLevels);
    params_.head(num_before) = params.head(num_before);
    params_.tail<kNumLevels>() = params.tail<kNumLevels>();
    Equations wider;
    if (Linearise(params_, huber_, &wider)) {
      const double fall = wider.gradient.dot(wider.normal.ldlt().solve(wider.gradient));
      const double dof = static_cast<double>(pixels_.size()) - static_cast<double>(params_.size());
      const double variance = std::max(2 * wider.cost - fall, 0.0) / std::max(1.0, dof);
      if (fall > variance * (num_added + 2 * std::sqrt(2.0 * num_added))) return Descend(huber_, kFinePx);
    }
    map_ = map;
    params_ = params;
    result_ = std::move(result);
    return true;
  }

  // Of one grey value, freed from the number of unknowns.
  double noise_grey() const {
    const double dof = static_cast<double>(pixels_.size()) - static_cast<double>(params_.size());
    return std::sqrt(2 * result_.cost / std::max(1.0, dof));
  }
  // Of all unknowns.
  Eigen::MatrixXd Covariance() const {
    const Eigen::Index n = params_.size();
    return noise_grey() * noise_grey() * result_.normal.ldlt().solve(Eigen::MatrixXd::Identity(n, n));
  }

 private:
  static constexpr double kFinePx = 2e-3;

  struct Equations {
    Eigen::MatrixXd normal;
    Eigen::VectorXd gradient;
    double cost = 0;  // Half the sum of Huber's rho.
    std::vector<double> residuals;
  };

  // Levenberg-Marquardt to where steps are too small to matter.
  bool Descend(double huber, double small_step_px) {
    constexpr int kMaxIterations = 30;
    constexpr double kMaxDamping = 1e4;
    double damping = 1e-4;
    if (!Linearise(params_, huber, &result_)) return false;
    for (int iteration = 0; iteration < kMaxIterations && damping < kMaxDamping; ++iteration) {
      Eigen::MatrixXd normal = result_.normal;
      normal.diagonal() *= 1 + damping;
      const Eigen::VectorXd step = normal.ldlt().solve(-result_.gradient);
      if (!step.allFinite()) return false;
      const Eigen::VectorXd next = params_ + step;
      if (LargestMovePx(step) < small_step_px) {
        // What is left after it goes with the step's square.
        if (IsPossible(next)) params_ = next;
        return true;
      }
      Equations there;
      if (IsPossible(next) && Linearise(next, huber, &there) && there.cost <= result_.cost) {
        params_ = next;
        damping = std::max(1e-7, 0.1 * damping);
        result_ = std::move(there);
      } else {
        damping *= 10;
      }
    }
    return true;
  }

  // Of the pattern's corners.
  double LargestMovePx(const Eigen::VectorXd& step) const {
    double largest_px = 0;
    for (const double x : {-1.0, 1.0}) {
      for (const double y : {-1.0, 1.0}) {
        const Eigen::Vector2d move =
            map_.DisplacementsAt({x, y}).leftCols(map_.num_terms()) * step.head(map_.num_terms());
        largest_px = std::max(largest_px, move.cwiseAbs().maxCoeff());
      }
    }
    return largest_px;
  }

  void CollectPixels(const cv::Mat& grey) {
    double min_x = 1e9;
    double min_y = 1e9;
    double max_x = -1e9;
    double max_y = -1e9;
    for (const double x : {-1.0, 1.0}) {
      for (const double y : {-1.0, 1.0}) {
        const Eigen::Vector2d corner = map_.Pixel(params_, {x, y});
        if (!corner.allFinite() || !(map_.Derivative(params_, {x, y}).allFinite())) return;
        min_x = std::min(min_x, corner.x());
        min_y = std::min(min_y, corner.y());
        max_x = std::max(max_x, corner.x());
        max_y = std::max(max_y, corner.y());
      }
    }
    constexpr double kMaxSizePx = 2000;
    if (!(max_x - min_x < kMaxSizePx && max_y - min_y < kMaxSizePx)) return;
    const Eigen::Vector2d middle = map_.Pixel(params_, Eigen::Vector2d::Zero());
    const double size_px = std::max({max_x - min_x, max_y - min_y, 1.0});
    int num_outside = 0;
    // Of a large pattern every second, third, ... pixel is enough.
    constexpr double kEnoughPixels = 30000;
    const int step = 1 + static_cast<int>(std::sqrt((max_x - min_x) * (max_y - min_y) / kEnoughPixels));
    for (int v = static_cast<int>(std::floor(min_y)); v <= static_cast<int>(std::ceil(max_y)); ++v) {
      for (int u = static_cast<int>(std::floor(min_x)) + (step > 1 ? v * 5 % (step * step) : 0);
           u <= static_cast<int>(std::ceil(max_x)); u += step * step) {
        const Eigen::Vector2d at(u, v);
        const std::optional<Eigen::Vector2d> unit = map_.InvertStart(at);
        if (!unit || unit->cwiseAbs().maxCoeff() > 1) continue;
        if (u < 0 || v < 0 || u >= grey.cols || v >= grey.rows) {
          ++num_outside;
          continue;
        }
        // Away from edges there is nothing but the two levels to see: few pixels tell them.
        constexpr double kWidestBlurPx = 1.5;
        constexpr double kFlat = 0.02;
        constexpr int kFlatShare = 7;
        const Eigen::Matrix2d per_metre = map_.PerMetre(map_.Derivative(params_, *unit));
        const Eigen::Vector2d slope = per_metre.transpose().inverse() *
                                      Blur(pattern_, map_.InPattern(*unit), per_metre, kWidestBlurPx, false).by_at;
        if (slope.norm() * kWidestBlurPx < kFlat && (u + 3 * v) % kFlatShare != 0) continue;
        pixels_.push_back({at, 2 * (at - middle) / size_px, *unit, static_cast<double>(grey.at<uchar>(v, u))});
      }
    }
    // More would add time, and hardly precision.
    constexpr size_t kMaxPixels = 6000;
    const size_t stride = pixels_.size() / kMaxPixels + 1;
    if (stride > 1) {
      std::vector<FitPixel> thinned;
      for (size_t k = 0; k < pixels_.size(); k += stride) thinned.push_back(pixels_[k]);
      pixels_ = std::move(thinned);
    }
    is_usable_ =
        pixels_.size() > 2 * static_cast<size_t>(params_.size()) && 4 * num_outside < static_cast<int>(pixels_.size());
  }

  // Blur as a guess, levels by least squares.
  void StartLevels() {
    constexpr double kStartBlurPx = 0.9;
    params_[map_.num_terms() + kBlur] = kStartBlurPx;
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    for (const FitPixel& pixel : pixels_) {
      const double albedo = Blurred(pattern_, map_.InPattern(pixel.unit),
                                    map_.PerMetre(map_.Derivative(params_, pixel.unit)), kStartBlurPx)
                                .value;
      const Eigen::Vector2d row(1 - albedo, albedo);
      normal += row * row.transpose();
      right += row * pixel.grey;
    }
    const Eigen::Vector2d levels = normal.ldlt().solve(right);
    params_[map_.num_terms() + kBlack] = levels[0];
    params_[map_.num_terms() + kWhite] = levels[1];
    is_usable_ = levels.allFinite();
  }

  bool IsPossible(const Eigen::VectorXd& params) const {
    const auto levels = params.tail<kNumLevels>();
    return params.allFinite() && levels[kBlur] > 0.2 && levels[kBlur] < 20 && levels[kWhite] > levels[kBlack] &&
           levels.tail<kNumLight>().cwiseAbs().maxCoeff() < 1;
  }

  // Whether an unknown stays as it is.
  bool IsHeld(int k) const {
    const int num_map = map_.num_terms();
    return k < num_map ? map_.IsHeld(k) : !is_light_bent_ && k >= num_map + kLightBend;
  }

  bool Linearise(const Eigen::VectorXd& params, double huber, Equations* equations) {
    const int num_map = map_.num_terms();
    const int n = static_cast<int>(params.size());
    equations->normal.setZero(n, n);
    equations->gradient.setZero(n);
    equations->cost = 0;
    equations->residuals.resize(pixels_.size());
    const double black = params[num_map + kBlack];
    const double white = params[num_map + kWhite];
    const Eigen::Matrix<double, kNumLight, 1> light = params.segment<kNumLight>(num_map + kLight);
    const double blur = params[num_map + kBlur];
    Eigen::VectorXd row(n);
    // Some rows at a time, which is much faster than one by one.
    std::vector<int> free;
    for (int k = 0; k < n; ++k) {
      if (!IsHeld(k)) free.push_back(k);
    }
    const auto num_free = static_cast<Eigen::Index>(free.size());
    constexpr int kBatch = 128;
    Eigen::MatrixXd batch(num_free, kBatch);
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(num_free, num_free);
    int num_in_batch = 0;
    const auto add_batch = [&] {
      normal.selfadjointView<Eigen::Lower>().rankUpdate(batch.leftCols(num_in_batch));
      num_in_batch = 0;
    };
    for (size_t k = 0; k < pixels_.size(); ++k) {
      FitPixel& pixel = pixels_[k];
      Eigen::Matrix2d by_unit;
      const std::optional<Eigen::Vector2d> unit = map_.Invert(params, pixel.at_px, pixel.unit, &by_unit);
      if (!unit) return false;
      pixel.unit = *unit;
      // Half way to the lines that blur into the pixel: so taken, the map's derivative gives the distance to them to
      // second order.
      const Eigen::Vector2d at_m = map_.InPattern(*unit);
      const Eigen::Matrix2d metres_by_px = map_.PerMetre(by_unit).inverse();
      const Eigen::Vector2d half_way_m(
          0.5 * (at_m.x() + NearestOf(pattern_.x_m, at_m.x(), kReach * blur * metres_by_px.row(0).norm())),
          0.5 * (at_m.y() + NearestOf(pattern_.y_m, at_m.y(), kReach * blur * metres_by_px.row(1).norm())));
      const Eigen::Matrix2d derivative = map_.Derivative(params, map_.UnitOf(half_way_m));
      if (!(std::abs(derivative.determinant()) > 1e-12)) return false;
      const Eigen::Matrix2d per_metre = map_.PerMetre(derivative);
      const BlurredAlbedo albedo = Blurred(pattern_, at_m, per_metre, blur);
      const Eigen::Matrix<double, kNumLight, 1> light_terms = LightTerms(pixel.light);
      const double lit = 1 + light.dot(light_terms);
      const double level = black + albedo.value * (white - black);
      // The pattern moves with the map, the pixel stays: the derivative has the opposite sign of the picture's slope.
      const Eigen::Vector2d slope = per_metre.transpose().inverse() * albedo.by_at * (lit * (white - black));
      row.head(num_map) = -map_.DisplacementsAt(*unit).leftCols(num_map).transpose() * slope;
      row[num_map + kBlack] = lit * (1 - albedo.value);
      row[num_map + kWhite] = lit * albedo.value;
      row.segment<kNumLight>(num_map + kLight) = level * light_terms;
      row[num_map + kBlur] = lit * (white - black) * albedo.by_blur;
      const double residual = lit * level - pixel.grey;
      const double size = std::abs(residual);
      const double weight = size <= huber ? 1 : huber / size;
      equations->residuals[k] = residual;
      equations->cost += size <= huber ? 0.5 * residual * residual : huber * (size - 0.5 * huber);
      equations->gradient += weight * residual * row;
      const double root = std::sqrt(weight);
      for (Eigen::Index i = 0; i < num_free; ++i) batch(i, num_in_batch) = root * row[free[static_cast<size_t>(i)]];
      if (++num_in_batch == kBatch) add_batch();
    }
    add_batch();
    for (Eigen::Index i = 0; i < num_free; ++i) {
      for (Eigen::Index j = 0; j <= i; ++j) {
        const int row_of = free[static_cast<size_t>(i)];
        const int column_of = free[static_cast<size_t>(j)];
        equations->normal(row_of, column_of) = equations->normal(column_of, row_of) = normal(i, j);
      }
    }
    // Near the picture's middle the pattern says nothing of the lens, nor does it matter.
    constexpr double kTypicalNoiseGrey = 2;
    const double prior = kTypicalNoiseGrey / map_.LensSigmaPx();
    for (int k = 0; k < n; ++k) {
      if (!IsHeld(k)) continue;
      constexpr double kHeld = 1e12;
      equations->normal(k, k) = kHeld;
      equations->gradient[k] = 0;
    }
    for (int k = PatternMap::kFirstLensTerm; k < std::min(num_map, PatternMap::kLensTerms); ++k) {
      if (IsHeld(k)) continue;
      equations->normal(k, k) += prior * prior;
      equations->gradient[k] += prior * prior * params[k];
      equations->cost += 0.5 * prior * prior * params[k] * params[k];
    }
    return true;
  }

  // From the median of their sizes.
  static double NoiseOf(std::vector<double> residuals) {
    for (double& residual : residuals) residual = std::abs(residual);
    const auto middle = residuals.begin() + static_cast<std::ptrdiff_t>(residuals.size() / 2);
    std::nth_element(residuals.begin(), middle, residuals.end());
    return 1.4826 * *middle;
  }

  const CellPattern& pattern_;
  PatternMap map_;
  bool is_light_bent_;
  Eigen::VectorXd params_;
  std::vector<FitPixel> pixels_;
  bool is_usable_ = false;
  double huber_ = 0;
  Equations result_;
};

}  // namespace

std::optional<PatternFit> FitPattern(const cv::Mat& grey, const CellPattern& pattern,
                                     const Eigen::Matrix3d& start_picture_from_pattern,
                                     const std::vector<Eigen::Vector2d>& wanted_m, const PatternFitOptions& options) {
  CHECK_EQ(grey.type(), CV_8UC1);
  CHECK((options.max_m.array() > options.min_m.array()).all());
  Fitter fitter(grey, pattern, start_picture_from_pattern, options);
  if (!fitter.is_usable() || !fitter.Solve()) return std::nullopt;
  if (options.freedom == MapFreedom::kStrongLens && !fitter.AddPolynomialIfAsked()) return std::nullopt;
  PatternFit fit;
  fit.blur_sigma_px = fitter.level(kBlur);
  fit.contrast_grey = fitter.contrast();
  fit.residual_ratio = fitter.noise_grey() / fit.contrast_grey;
  if (!(fit.contrast_grey >= options.min_contrast_grey && fit.residual_ratio <= options.max_residual_ratio)) {
    return std::nullopt;
  }
  const PatternMap& map = fitter.map();
  const int num_terms = map.num_terms();
  Eigen::MatrixXd by_params =
      Eigen::MatrixXd::Zero(2 * static_cast<Eigen::Index>(wanted_m.size()), fitter.params().size());
  for (size_t k = 0; k < wanted_m.size(); ++k) {
    const Eigen::Vector2d unit = map.UnitOf(wanted_m[k]);
    fit.pixels.push_back(map.Pixel(fitter.params(), unit));
    if (!((fit.pixels.back() - Map(start_picture_from_pattern, wanted_m[k])).norm() <= options.max_move_px)) {
      return std::nullopt;
    }
    by_params.block(2 * static_cast<Eigen::Index>(k), 0, 2, num_terms) = map.DisplacementsAt(unit).leftCols(num_terms);
  }
  fit.covariance_px2 = by_params * fitter.Covariance() * by_params.transpose();
  if (!fit.covariance_px2.allFinite()) return std::nullopt;
  return fit;
}

}  // namespace heba
