#include "targets/dots/ellipse_refinement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include <Eigen/Dense>

#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "heba/base/levenberg_marquardt.h"
#include "heba/base/median.h"
#include "heba/base/units.h"
#include "targets/dots/blurred_ellipse.h"
#include "targets/images/approximate_angle.h"

namespace heba {
namespace {

using Parameters = BlurredEllipseParameters;
using Normal = decltype(BlurredEllipseSums::normal);

// The fit of one dot, in coordinates relative to the centre of `start` and in units of its radius.
class BlurredEllipse {
 public:
  BlurredEllipse(const cv::Mat& grey, const Ellipse& start)
      : grey_(grey), origin_px_(start.centre_px), radius_px_(start.RadiusPx()) {
    const Eigen::Matrix2d shape = start.shape * radius_px_ * radius_px_;
    x_[kShapeXX] = shape(0, 0);
    x_[kShapeXY] = shape(0, 1);
    x_[kShapeYY] = shape(1, 1);
    x_[kLogSigma] = std::log(1.0 / radius_px_);
    // Slopes can be separated from the position of the dot only if it has enough area.
    num_free_ = radius_px_ < 3 ? kLightX : kInsideX;
  }

  Ellipse Outline() const {
    Eigen::Matrix2d shape;
    shape << x_[kShapeXX], x_[kShapeXY], x_[kShapeXY], x_[kShapeYY];
    return {origin_px_ + radius_px_ * x_.head<2>(), shape / (radius_px_ * radius_px_)};
  }
  double SigmaPx() const { return radius_px_ * std::exp(x_[kLogSigma]); }
  // Returns the contrast at the centre, which is the mean along the outline.
  double Contrast() const {
    const double light = 1 + x_[kLightX] * x_[kCentreX] + x_[kLightY] * x_[kCentreY];
    return light * (x_[kInside] - x_[kOutside] + x_[kInsideX] * x_[kCentreX] + x_[kInsideY] * x_[kCentreY]);
  }

  // Returns whether the dot lies in the image; the border may cut off up to a tenth of its radius.
  bool IsInImage() const {
    const Ellipse outline = Outline();
    const Eigen::Vector2d extent = outline.ExtentPx();
    const double beyond_px = 0.5 + 0.1 * outline.RadiusPx();
    const Eigen::Vector2d first = outline.centre_px - extent;
    const Eigen::Vector2d last = outline.centre_px + extent;
    return (first.array() > -beyond_px).all() && last.x() < grey_.cols - 1 + beyond_px &&
           last.y() < grey_.rows - 1 + beyond_px;
  }

  // Collects the pixels within `margin_px` of the outline, at a stride if there are more than `max_samples`.
  void Sample(double margin_px, const RefineEllipseOptions& options, double max_samples) {
    const Ellipse outline = Outline();
    const double reach_px = options.next_reach_sigmas * SigmaPx();
    const double num_expected = 4 * kPi * outline.RadiusPx() * margin_px;
    const int stride = std::max(1, static_cast<int>(std::sqrt(num_expected / max_samples)));
    const Eigen::Vector2d semi_axes_px = outline.SemiAxesPx();
    // A larger and a smaller ellipse bound the pixels to collect.
    const double slack_px = 1 + 0.1 * margin_px;
    const Ellipse outer = outline.Grown(margin_px + slack_px);
    const double inner_px = semi_axes_px.y() - margin_px - slack_px;
    const std::optional<Ellipse> inner =
        inner_px > 0 ? std::optional<Ellipse>(outline.Grown(-margin_px - slack_px)) : std::nullopt;
    const double extent_px = outer.ExtentPx().y();
    const int y0 = std::max(0, static_cast<int>(std::floor(outline.centre_px.y() - extent_px)));
    const int y1 = std::min(grey_.rows - 1, static_cast<int>(std::ceil(outline.centre_px.y() + extent_px)));
    pixels_.Clear();
    distances_px_.clear();
    sectors_.clear();
    for (int row = y0; row <= y1; row += stride) {
      const std::optional<Eigen::Vector2d> span = SpanOf(outer, row);
      if (!span) continue;
      const int x0 = std::max(0, static_cast<int>(std::floor(span->x())));
      const int x1 = std::min(grey_.cols - 1, static_cast<int>(std::ceil(span->y())));
      const std::optional<Eigen::Vector2d> hole = inner ? SpanOf(*inner, row) : std::nullopt;
      int column = (x0 + stride - 1) / stride * stride;
      for (; column <= x1; column += stride) {
        if (hole && column > hole->x() && column < hole->y()) {
          column = static_cast<int>(std::ceil(hole->y())) / stride * stride;
          if (column < hole->y()) column += stride;
          if (column > x1) break;
        }
        AddPixel(row, column, outline, margin_px, reach_px, options.next_outline_ratio);
      }
    }
    pixels_.Pad();
    HidePixels();
  }

  // Initialises the grey values inside and outside from the samples. Returns false if there are too few.
  bool StartLevels(double margin_px) {
    const double inside_px = std::min(0.5 * margin_px, 0.3 * Outline().SemiAxesPx().y());
    double outside_px = 0;
    for (const double distance_px : distances_px_) outside_px = std::max(outside_px, 0.5 * distance_px);
    double sum_inside = 0;
    double sum_outside = 0;
    int num_inside = 0;
    int num_outside = 0;
    for (size_t i = 0; i < pixels_.size(); ++i) {
      if (distances_px_[i] < -inside_px) {
        sum_inside += pixels_.grey()[i];
        ++num_inside;
      } else if (distances_px_[i] > outside_px) {
        sum_outside += pixels_.grey()[i];
        ++num_outside;
      }
    }
    if (num_inside < 1 || num_outside < 4) return false;
    x_[kInside] = sum_inside / num_inside;
    x_[kOutside] = sum_outside / num_outside;
    return true;
  }

  // Fits to within `tolerance` of the cost. Returns false if there are too few pixels or the fit fails.
  bool Fit(double tolerance) {
    if (pixels_.size() < kNumBlurredEllipseParameters + 4u) return false;
    const std::optional<Minimum> minimum = MinimumNear(x_, num_free_, tolerance);
    if (!minimum) return false;
    x_ = minimum->x;
    sums_ = minimum->sums;
    return true;
  }

  // Fits with a slope of the inside (gloss, a dirty dot) if the image requires it.
  bool FitWithNeededSlopes(double tolerance) {
    if (!Fit(tolerance)) return false;
    if (num_free_ != kInsideX) return true;
    const std::optional<Minimum> sloping = MinimumNear(x_, kNumBlurredEllipseParameters, tolerance);
    if (!sloping) return true;
    // The gain is a chi-square variable with two degrees of freedom, which exceeds this by chance once in 3000:
    // rarely enough not to increase the scatter of evenly coloured dots.
    constexpr double kMinGain = 16;
    if (static_cast<double>(pixels_.size()) * (sums_.cost / sloping->sums.cost - 1) > kMinGain) {
      x_ = sloping->x;
      sums_ = sloping->sums;
      num_free_ = kNumBlurredEllipseParameters;
    }
    return true;
  }

  // Determines from the residuals the Huber threshold and the sectors of the outline that do not agree with the rest.
  // Returns whether these sectors have changed.
  bool Judge() {
    std::vector<double> sizes = EdgeResiduals(pixels_, x_);
    std::array<double, kNumSectors> sums{};
    std::array<int, kNumSectors> counts{};
    for (size_t i = 0; i < pixels_.size(); ++i) {
      sums[sectors_[i]] += sizes[i] * sizes[i];
      ++counts[sectors_[i]];
      sizes[i] = std::abs(sizes[i]);
    }
    // A part of the residuals suffices for the median.
    constexpr size_t kEnough = 500;
    const size_t stride = std::max<size_t>(1, sizes.size() / kEnough);
    size_t num_sizes = 0;
    for (size_t i = 0; i < sizes.size(); i += stride) sizes[num_sizes++] = sizes[i];
    sizes.resize(num_sizes);
    // If the flat parts are saturated, only the edge has residuals, which must not count as outliers.
    bend_ = std::max(2.5 * 1.4826 * Median(std::move(sizes)), 0.05 * std::abs(Contrast()));

    std::vector<double> squares;
    for (int i = 0; i < kNumSectors; ++i) {
      sums[i] /= std::max(counts[i], 1);
      squares.push_back(sums[i]);
    }
    const double limit = std::max(4 * Median(std::move(squares)), std::pow(0.12 * Contrast(), 2));
    bool changed = false;
    for (int i = 0; i < kNumSectors; ++i) {
      const bool hidden = sums[i] > limit;
      changed = changed || hidden != hidden_[i];
      hidden_[i] = hidden;
    }
    HidePixels();
    return changed;
  }

  RefinedEllipse Result() const {
    RefinedEllipse refined;
    refined.ellipse = Outline();
    refined.blur_sigma_px = SigmaPx();
    refined.contrast_grey = Contrast();
    refined.visible_ratio =
        1 - static_cast<double>(std::count(hidden_.begin(), hidden_.end(), true)) / static_cast<double>(kNumSectors);
    const std::vector<double> residuals = EdgeResiduals(pixels_, x_);
    double sum_square = 0;
    double sum_weighted = 0;
    double num_samples = 0;
    for (size_t i = 0; i < residuals.size(); ++i) {
      if (hidden_[sectors_[i]]) continue;
      const double square = residuals[i] * residuals[i];
      sum_square += square;
      sum_weighted += square <= bend_ * bend_ ? square : bend_ * std::abs(residuals[i]);
      num_samples += 1;
    }
    refined.residual_ratio = std::sqrt(sum_square / num_samples) / std::abs(refined.contrast_grey);
    const Normal covariance = InverseOfSymmetric(sums_.normal);
    // Rounding alone has a variance of 1/12.
    const double variance = std::max(sum_weighted / std::max(num_samples - num_free_, 1.0), 1.0 / 12);
    refined.centre_covariance_px2 = radius_px_ * radius_px_ * variance * covariance.topLeftCorner<2, 2>();
    return refined;
  }

 private:
  static constexpr int kNumSectors = 24;

  // Returns the columns between which a row is inside the ellipse.
  static std::optional<Eigen::Vector2d> SpanOf(const Ellipse& ellipse, int row) {
    const double v = row - ellipse.centre_px.y();
    const double a = ellipse.shape(0, 0);
    const double b = ellipse.shape(0, 1) * v;
    const double square = b * b - a * (ellipse.shape(1, 1) * v * v - 1);
    if (!(square > 0)) return std::nullopt;
    const double middle = ellipse.centre_px.x() - b / a;
    const double half = std::sqrt(square) / a;
    return Eigen::Vector2d(middle - half, middle + half);
  }

  void AddPixel(int row, int column, const Ellipse& outline, double margin_px, double reach_px,
                double next_outline_ratio) {
    const double ux = column - outline.centre_px.x();
    const double uy = row - outline.centre_px.y();
    const double mx = outline.shape(0, 0) * ux + outline.shape(0, 1) * uy;
    const double my = outline.shape(0, 1) * ux + outline.shape(1, 1) * uy;
    const double rho = std::sqrt(ux * mx + uy * my);
    const double g = std::sqrt(mx * mx + my * my);
    const double distance_px = rho > 1e-6 ? (rho - 1) * rho / g : -radius_px_;
    if (std::abs(distance_px) > margin_px) return;
    if (next_outline_ratio > 0 && rho > 1) {
      const double gradient = g / rho;  // Norm of the gradient of rho, 1/px.
      const double gap_px = (next_outline_ratio - 1) / gradient;
      if ((next_outline_ratio - rho) / gradient < std::min(reach_px, 0.5 * gap_px)) return;
    }
    const double grey = grey_.type() == CV_32FC1 ? grey_.at<float>(row, column) : grey_.ptr<uchar>(row)[column];
    pixels_.Add((column - origin_px_.x()) / radius_px_, (row - origin_px_.y()) / radius_px_, grey);
    distances_px_.push_back(distance_px);
    sectors_.push_back(static_cast<size_t>(ApproximateAngle(ux, uy) * kNumSectors));
  }

  // Sets the weights of pixels in hidden sectors to zero.
  void HidePixels() {
    for (size_t i = 0; i < pixels_.size(); ++i) pixels_.SetWeight(i, hidden_[sectors_[i]] ? 0 : 1);
  }

  // The width of a pixel is that of a Gaussian with a sigma of 0.29 px.
  double MinLogSigma() const { return std::log(0.29 / radius_px_); }

  // A point of the minimisation. In its normal equations, the blur is held if it is at its lower bound and would
  // decrease further; in its sums it is free.
  struct FitPoint {
    Parameters x;
    BlurredEllipseSums sums;
    Normal normal;
    Parameters gradient;
    double cost = 0;

    // Holds a parameter at its current value.
    void Hold(int parameter) {
      normal.row(parameter).setZero();
      normal.col(parameter).setZero();
      normal(parameter, parameter) = 1;
      gradient[parameter] = 0;
    }
  };

  FitPoint PointAt(const Parameters& x, int num_free) const {
    const BlurredEllipseSums sums = SumEdge(pixels_, x, num_free, bend_);
    FitPoint point{x, sums, sums.normal, sums.gradient, sums.cost};
    if (x[kLogSigma] <= MinLogSigma() && sums.gradient[kLogSigma] > 0) point.Hold(kLogSigma);
    return point;
  }

  // Returns the parameters after a step, or nothing if they do not describe an ellipse near the start.
  std::optional<Parameters> Moved(const Parameters& x, const Parameters& step) const {
    Parameters next = x + step;
    next[kLogSigma] = std::max(next[kLogSigma], MinLogSigma());
    const bool is_ellipse = next[kShapeXX] > 0.05 &&
                            next[kShapeXX] * next[kShapeYY] - next[kShapeXY] * next[kShapeXY] > 0.05 &&
                            next.head<2>().norm() < 0.7 && next[kLogSigma] < 1;
    return is_ellipse ? std::optional<Parameters>(next) : std::nullopt;
  }

  struct Minimum {
    Parameters x;
    BlurredEllipseSums sums;  // The sums are those before the last step.
  };
  // Minimises the cost until the predicted gain of a step is less than `tolerance` of the cost, and takes that step.
  // Returns nothing if a step cannot be computed.
  std::optional<Minimum> MinimumNear(const Parameters& x, int num_free, double tolerance) const {
    LevenbergMarquardtOptions options;
    options.max_iterations = 30;
    options.initial_damping = 1e-3;
    options.least_damping = 1e-9;
    options.small_drop = tolerance;
    options.trusted_damping = 1;
    options.ends_after_small_drop = false;
    const auto try_step = [&](const FitPoint& from, const Parameters& step) {
      const std::optional<Parameters> next = Moved(from.x, step);
      return next ? std::optional<FitPoint>(PointAt(*next, num_free)) : std::nullopt;
    };
    FitPoint point = PointAt(x, num_free);
    const auto end = MinimiseSquares(options, try_step, &point);
    if (!end.is_finite) return std::nullopt;
    Minimum minimum{point.x, point.sums};
    if (end.remaining_step) minimum.x = Moved(point.x, *end.remaining_step).value_or(point.x);
    return minimum;
  }

  const cv::Mat& grey_;
  const Eigen::Vector2d origin_px_;
  const double radius_px_;
  Parameters x_ = Parameters::Zero();
  int num_free_ = kNumBlurredEllipseParameters;
  double bend_ = 1e6;  // Huber threshold in grey levels; there are no outliers at first.
  std::array<bool, kNumSectors> hidden_{};
  EdgePixels pixels_;
  std::vector<double> distances_px_;  // Distance of each pixel from the outline around which it was collected.
  std::vector<size_t> sectors_;
  BlurredEllipseSums sums_;  // Sums of the last fit.
};

}  // namespace

std::optional<RefinedEllipse> RefineEllipse(const cv::Mat& grey, const Ellipse& start,
                                            const RefineEllipseOptions& options) {
  CHECK(grey.type() == CV_8UC1 || grey.type() == CV_32FC1);
  const double radius_px = start.RadiusPx();
  if (!(radius_px > 1) || !start.centre_px.allFinite()) return std::nullopt;
  const double max_margin_px = std::max(options.max_margin_px, 1.5);
  BlurredEllipse fit(grey, start);
  if (!fit.IsInImage()) return std::nullopt;

  // The first fit is coarse and uses some of the pixels in a wide margin.
  const double first_margin_px = std::min(std::max(3.0, 0.15 * radius_px), max_margin_px);
  constexpr double kMaxFirstSamples = 800;
  constexpr double kCoarsely = 1e-3;
  constexpr double kExactly = 1e-7;
  fit.Sample(first_margin_px, options, kMaxFirstSamples);
  if (!fit.StartLevels(first_margin_px) || !fit.Fit(kCoarsely)) return std::nullopt;
  fit.Judge();
  // The next fits use the pixels near the blurred edge, and are repeated until the hidden parts and the margin
  // settle.
  constexpr int kMaxRounds = 5;
  const auto margin_px = [&] {
    return std::min(std::clamp(4 * fit.SigmaPx(), 3.0, std::max(radius_px, 3.0)), max_margin_px);
  };
  for (int round = 0; round < kMaxRounds; ++round) {
    if (!fit.IsInImage()) return std::nullopt;
    const double used_px = margin_px();
    fit.Sample(used_px, options, std::numeric_limits<double>::infinity());
    if (!fit.Fit(kCoarsely)) return std::nullopt;
    const bool other_parts = fit.Judge();
    if (!other_parts && std::abs(margin_px() - used_px) < 0.2 * used_px) break;
  }
  if (!fit.FitWithNeededSlopes(kExactly) || !fit.IsInImage()) return std::nullopt;
  if (!(std::abs(fit.Contrast()) > 1)) return std::nullopt;
  const RefinedEllipse refined = fit.Result();
  if (!refined.centre_covariance_px2.allFinite() || !std::isfinite(refined.residual_ratio)) return std::nullopt;
  return refined;
}

}  // namespace heba
