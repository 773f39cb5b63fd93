#include "targets/pattern_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

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
// the angle (Plackett 1954), by Gauss-Legendre.
double Cdf2(double a, double b, double cdf_a, double cdf_b, double angle) {
  constexpr std::array<double, 3> kNodes = {0.2386191860831969, 0.6612093864662645, 0.9324695142031521};
  constexpr std::array<double, 3> kWeights = {0.4679139345726910, 0.3607615730481386, 0.1713244923791704};
  double sum = 0;
  for (size_t k = 0; k < kNodes.size(); ++k) {
    for (const double node : {kNodes[k], -kNodes[k]}) {
      const double s = std::sin(0.5 * angle * (1 + node));
      sum += kWeights[k] * std::exp(-(a * a + b * b - 2 * a * b * s) / (2 * (1 - s * s)));
    }
  }
  return cdf_a * cdf_b + sum * 0.5 * angle / (2 * std::numbers::pi);
}

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

BlurredAlbedo Blurred(const CellPattern& pattern, const Eigen::Vector2d& at_m,
                      const Eigen::Matrix2d& picture_by_pattern, double blur_sigma_px) {
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
  for (size_t i = x_range.begin; i < x_range.end; ++i) {
    const double step = albedo(y_range.begin, i + 1) - albedo(y_range.begin, i);
    if (step == 0) continue;
    const double a = (at_m.x() - pattern.x_m[i]) / sx;
    const double slope = step * Density(a);
    result.value += step * Cdf(a);
    by_a += slope;
    by_scale -= slope * a;
  }
  for (size_t j = y_range.begin; j < y_range.end; ++j) {
    const double step = albedo(j + 1, x_range.begin) - albedo(j, x_range.begin);
    if (step == 0) continue;
    const double b = (at_m.y() - pattern.y_m[j]) / sy;
    const double slope = step * Density(b);
    result.value += step * Cdf(b);
    by_b += slope;
    by_scale -= slope * b;
  }
  const double angle = std::asin(correlation);
  const double rest = std::sqrt(1 - correlation * correlation);
  for (size_t j = y_range.begin; j < y_range.end; ++j) {
    for (size_t i = x_range.begin; i < x_range.end; ++i) {
      const double twist = albedo(j + 1, i + 1) - albedo(j, i + 1) - albedo(j + 1, i) + albedo(j, i);
      if (twist == 0) continue;
      const double a = (at_m.x() - pattern.x_m[i]) / sx;
      const double b = (at_m.y() - pattern.y_m[j]) / sy;
      result.value += twist * Cdf2(a, b, Cdf(a), Cdf(b), angle);
      const double slope_a = twist * Density(a) * Cdf((b - correlation * a) / rest);
      const double slope_b = twist * Density(b) * Cdf((a - correlation * b) / rest);
      by_a += slope_a;
      by_b += slope_b;
      by_scale -= slope_a * a + slope_b * b;
    }
  }
  result.by_at = {by_a / sx, by_b / sy};
  result.by_blur = by_scale / blur_sigma_px;
  return result;
}

namespace {

int NumTerms(MapFreedom freedom) {
  constexpr std::array<int, 3> kTerms = {3, 6, 10};
  return kTerms[static_cast<size_t>(freedom)];
}

// The map from the pattern, its used rectangle scaled to [-1, 1] on both axes, into the picture: the start's homography
// plus a polynomial.
class PatternMap {
 public:
  PatternMap(const Eigen::Matrix3d& picture_from_pattern, const PatternFitOptions& options)
      : centre_m_(0.5 * (options.min_m + options.max_m)),
        half_m_(0.5 * (options.max_m - options.min_m)),
        num_terms_(NumTerms(std::min(options.freedom, MapFreedom::kQuadratic))) {
    Eigen::Matrix3d pattern_from_unit = Eigen::Matrix3d::Identity();
    pattern_from_unit(0, 0) = half_m_.x();
    pattern_from_unit(1, 1) = half_m_.y();
    pattern_from_unit.topRightCorner<2, 1>() = centre_m_;
    start_ = picture_from_pattern * pattern_from_unit;
  }

  void set_freedom(MapFreedom freedom) { num_terms_ = NumTerms(freedom); }
  int num_params() const { return 2 * num_terms_; }
  int num_terms() const { return num_terms_; }
  Eigen::Vector2d UnitOf(const Eigen::Vector2d& at_m) const { return (at_m - centre_m_).cwiseQuotient(half_m_); }
  Eigen::Vector2d InPattern(const Eigen::Vector2d& unit) const { return centre_m_ + unit.cwiseProduct(half_m_); }

  static constexpr int kMaxTerms = 10;
  using TermVector = Eigen::Matrix<double, kMaxTerms, 1>;

  // The polynomial's terms, by degree.
  static TermVector Terms(const Eigen::Vector2d& q) {
    const double x = q.x();
    const double y = q.y();
    TermVector terms;
    terms << 1, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y;
    return terms;
  }

  Eigen::Vector2d Pixel(const Eigen::VectorXd& params, const Eigen::Vector2d& q) const {
    const TermVector terms = Terms(q);
    return Map(start_, q) + Eigen::Vector2d(params.head(num_terms_).dot(terms.head(num_terms_)),
                                            params.segment(num_terms_, num_terms_).dot(terms.head(num_terms_)));
  }

  // Pixel's derivative by the unit coordinates.
  Eigen::Matrix2d Derivative(const Eigen::VectorXd& params, const Eigen::Vector2d& q) const {
    const Eigen::Vector3d h = start_ * q.homogeneous();
    Eigen::Matrix2d derivative =
        (start_.topLeftCorner<2, 2>() - h.head<2>() / h.z() * start_.bottomLeftCorner<1, 2>()) / h.z();
    const double x = q.x();
    const double y = q.y();
    Eigen::Matrix<double, kMaxTerms, 2> terms;
    terms << 0, 0, 1, 0, 0, 1, 2 * x, 0, y, x, 0, 2 * y, 3 * x * x, 0, 2 * x * y, x * x, y * y, 2 * x * y, 0, 3 * y * y;
    for (int row = 0; row < 2; ++row) {
      derivative.row(row) += params.segment(row * num_terms_, num_terms_).transpose() * terms.topRows(num_terms_);
    }
    return derivative;
  }

  // By unit coordinates -> by metres.
  Eigen::Matrix2d PerMetre(const Eigen::Matrix2d& by_unit) const {
    return by_unit * half_m_.cwiseInverse().asDiagonal();
  }

  // The unit coordinates that map to `pixel`, from a guess.
  std::optional<Eigen::Vector2d> Invert(const Eigen::VectorXd& params, const Eigen::Vector2d& pixel,
                                        const Eigen::Vector2d& guess) const {
    Eigen::Vector2d q = guess;
    for (int iteration = 0; iteration < 10; ++iteration) {
      const Eigen::Matrix2d derivative = Derivative(params, q);
      const Eigen::Vector2d step = derivative.inverse() * (pixel - Pixel(params, q));
      if (!step.allFinite() || step.norm() > 2) return std::nullopt;
      q += step;
      if (step.norm() < 1e-7) return q;
    }
    return std::nullopt;
  }

 private:
  Eigen::Vector2d centre_m_;
  Eigen::Vector2d half_m_;
  int num_terms_;
  Eigen::Matrix3d start_;
};

struct FitPixel {
  Eigen::Vector2d at_px;
  Eigen::Vector2d light;  // From the pattern's middle, in units of its size: where the light's gradient is taken.
  Eigen::Vector2d unit;
  double grey = 0;
};

// The unknowns beside the map: black, white, the light's gradient (two numbers), blur.
constexpr int kNumLevels = 5;
enum Level { kBlack, kWhite, kLightX, kLightY, kBlur };

class Fitter {
 public:
  Fitter(const cv::Mat& grey, const CellPattern& pattern, const Eigen::Matrix3d& start,
         const PatternFitOptions& options)
      : pattern_(pattern), map_(start, options), params_(Eigen::VectorXd::Zero(map_.num_params() + kNumLevels)) {
    CollectPixels(grey);
    if (is_usable_) StartLevels();
  }

  bool is_usable() const { return is_usable_; }
  const PatternMap& map() const { return map_; }
  const Eigen::VectorXd& params() const { return params_; }
  double level(Level which) const { return params_[map_.num_params() + which]; }
  double contrast() const { return level(kWhite) - level(kBlack); }

  // By least squares first; then what deviates counts less. False if a step leads nowhere that can be computed.
  bool Solve() {
    if (!Descend(std::numeric_limits<double>::infinity())) return false;
    constexpr double kHuber = 2.5;
    constexpr double kMinNoiseGrey = 0.3;  // A pixel's rounding.
    huber_ = kHuber * std::max(kMinNoiseGrey, NoiseOf(result_.residuals));
    return Descend(huber_);
  }

  // Goes on with more freedom if the grey values ask for it: if the cost would fall by more than chance lets it
  // (chi-square of the added numbers, 2 sigma).
  bool FreeIfAsked(MapFreedom freedom) {
    const PatternMap map = map_;
    const Eigen::VectorXd params = params_;
    Equations result = result_;
    const int few = map.num_terms();
    map_.set_freedom(freedom);
    const int many = map_.num_terms();
    const int num_added = 2 * (many - few);
    params_ = Eigen::VectorXd::Zero(map_.num_params() + kNumLevels);
    params_.head(few) = params.head(few);
    params_.segment(many, few) = params.segment(few, few);
    params_.tail<kNumLevels>() = params.tail<kNumLevels>();
    Equations wider;
    if (Linearise(params_, huber_, &wider)) {
      const double fall = wider.gradient.dot(wider.normal.ldlt().solve(wider.gradient));
      const double dof = static_cast<double>(pixels_.size()) - static_cast<double>(params_.size());
      const double variance = std::max(2 * wider.cost - fall, 0.0) / std::max(1.0, dof);
      if (fall > variance * (num_added + 2 * std::sqrt(2.0 * num_added))) return Descend(huber_);
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
  struct Equations {
    Eigen::MatrixXd normal;
    Eigen::VectorXd gradient;
    double cost = 0;  // Half the sum of Huber's rho.
    std::vector<double> residuals;
  };

  // Levenberg-Marquardt to where steps are too small to matter.
  bool Descend(double huber) {
    constexpr int kMaxIterations = 30;
    constexpr double kSmallStepPx = 1e-4;
    constexpr double kMaxDamping = 1e4;
    double damping = 1e-4;
    if (!Linearise(params_, huber, &result_)) return false;
    for (int iteration = 0; iteration < kMaxIterations && damping < kMaxDamping; ++iteration) {
      Eigen::MatrixXd normal = result_.normal;
      normal.diagonal() *= 1 + damping;
      const Eigen::VectorXd step = normal.ldlt().solve(-result_.gradient);
      if (!step.allFinite()) return false;
      if (step.head(map_.num_params()).cwiseAbs().maxCoeff() < kSmallStepPx) return true;
      const Eigen::VectorXd next = params_ + step;
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
    Eigen::Vector2d guess = Eigen::Vector2d::Zero();
    for (int v = static_cast<int>(std::floor(min_y)); v <= static_cast<int>(std::ceil(max_y)); ++v) {
      for (int u = static_cast<int>(std::floor(min_x)); u <= static_cast<int>(std::ceil(max_x)); ++u) {
        const Eigen::Vector2d at(u, v);
        std::optional<Eigen::Vector2d> unit = map_.Invert(params_, at, guess);
        if (!unit) unit = map_.Invert(params_, at, Eigen::Vector2d::Zero());
        if (!unit) continue;
        guess = *unit;
        if (unit->cwiseAbs().maxCoeff() > 1) continue;
        if (u < 0 || v < 0 || u >= grey.cols || v >= grey.rows) {
          ++num_outside;
          continue;
        }
        // Away from edges there is nothing but the two levels to see: few pixels tell them.
        constexpr double kWidestBlurPx = 1.5;
        constexpr double kFlat = 0.02;
        constexpr int kFlatShare = 7;
        const Eigen::Matrix2d per_metre = map_.PerMetre(map_.Derivative(params_, *unit));
        const Eigen::Vector2d slope =
            per_metre.transpose().inverse() * Blurred(pattern_, map_.InPattern(*unit), per_metre, kWidestBlurPx).by_at;
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
    params_[map_.num_params() + kBlur] = kStartBlurPx;
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
    params_[map_.num_params() + kBlack] = levels[0];
    params_[map_.num_params() + kWhite] = levels[1];
    is_usable_ = levels.allFinite();
  }

  bool IsPossible(const Eigen::VectorXd& params) const {
    const auto levels = params.tail<kNumLevels>();
    return params.allFinite() && levels[kBlur] > 0.2 && levels[kBlur] < 20 && levels[kWhite] > levels[kBlack] &&
           std::abs(levels[kLightX]) < 1 && std::abs(levels[kLightY]) < 1;
  }

  bool Linearise(const Eigen::VectorXd& params, double huber, Equations* equations) {
    const int num_map = map_.num_params();
    const int num_terms = map_.num_terms();
    const int n = static_cast<int>(params.size());
    equations->normal.setZero(n, n);
    equations->gradient.setZero(n);
    equations->cost = 0;
    equations->residuals.resize(pixels_.size());
    const double black = params[num_map + kBlack];
    const double white = params[num_map + kWhite];
    const Eigen::Vector2d light(params[num_map + kLightX], params[num_map + kLightY]);
    const double blur = params[num_map + kBlur];
    Eigen::VectorXd row(n);
    for (size_t k = 0; k < pixels_.size(); ++k) {
      FitPixel& pixel = pixels_[k];
      const std::optional<Eigen::Vector2d> unit = map_.Invert(params, pixel.at_px, pixel.unit);
      if (!unit) return false;
      pixel.unit = *unit;
      const Eigen::Matrix2d derivative = map_.Derivative(params, *unit);
      if (!(std::abs(derivative.determinant()) > 1e-12)) return false;
      const Eigen::Matrix2d per_metre = map_.PerMetre(derivative);
      const BlurredAlbedo albedo = Blurred(pattern_, map_.InPattern(*unit), per_metre, blur);
      const double lit = 1 + light.dot(pixel.light);
      const double level = black + albedo.value * (white - black);
      // The pattern moves with the map, the pixel stays: the derivative has the opposite sign of the picture's slope.
      const Eigen::Vector2d slope = per_metre.transpose().inverse() * albedo.by_at * (lit * (white - black));
      const PatternMap::TermVector terms = PatternMap::Terms(*unit);
      row.head(num_terms) = -slope.x() * terms.head(num_terms);
      row.segment(num_terms, num_terms) = -slope.y() * terms.head(num_terms);
      row[num_map + kBlack] = lit * (1 - albedo.value);
      row[num_map + kWhite] = lit * albedo.value;
      row[num_map + kLightX] = level * pixel.light.x();
      row[num_map + kLightY] = level * pixel.light.y();
      row[num_map + kBlur] = lit * (white - black) * albedo.by_blur;
      const double residual = lit * level - pixel.grey;
      const double size = std::abs(residual);
      const double weight = size <= huber ? 1 : huber / size;
      equations->residuals[k] = residual;
      equations->cost += size <= huber ? 0.5 * residual * residual : huber * (size - 0.5 * huber);
      equations->normal.selfadjointView<Eigen::Lower>().rankUpdate(row, weight);
      equations->gradient += weight * residual * row;
    }
    equations->normal = Eigen::MatrixXd(equations->normal.selfadjointView<Eigen::Lower>());
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
  if (options.freedom == MapFreedom::kCubic && !fitter.FreeIfAsked(MapFreedom::kCubic)) return std::nullopt;
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
    const PatternMap::TermVector terms = PatternMap::Terms(unit);
    const Eigen::Index row = 2 * static_cast<Eigen::Index>(k);
    by_params.row(row).head(num_terms) = terms.head(num_terms).transpose();
    by_params.row(row + 1).segment(num_terms, num_terms) = terms.head(num_terms).transpose();
  }
  fit.covariance_px2 = by_params * fitter.Covariance() * by_params.transpose();
  if (!fit.covariance_px2.allFinite()) return std::nullopt;
  return fit;
}

}  // namespace heba
