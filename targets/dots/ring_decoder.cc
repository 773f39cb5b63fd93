#include "targets/dots/ring_decoder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include <Eigen/Dense>

#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "heba/base/levenberg_marquardt.h"
#include "heba/base/median.h"
#include "heba/base/units.h"
#include "targets/dots/ring_code.h"
#include "targets/dots/ring_image.h"
#include "targets/images/image.h"

namespace heba {
namespace {

constexpr int kMaxBits = 14;
// Radius, in radii of the dot, to which the quiet zone is examined; other rings may begin where it ends.
constexpr double kLookedAt = kRingQuiet - 0.1;

// Computes the cumulative distribution function of the standard normal distribution.
double Phi(double z) {
  if (z > 5) return 1;
  if (z < -5) return 0;
  return 0.5 * std::erfc(-z / std::sqrt(2.0));
}

// Returns the map of the unit circle onto the ellipse that preserves its principal axes.
Eigen::Matrix3d PixelFromUnitCircle(const Ellipse& ellipse) {
  Eigen::Matrix3d map = Eigen::Matrix3d::Identity();
  map.topLeftCorner<2, 2>() = EigenOfSymmetric(ellipse.shape).InverseRoot();
  map.topRightCorner<2, 1>() = ellipse.centre_px;
  return map;
}

// Returns a homography that maps the unit circle onto itself and the origin to `boost`, |boost| < 1. It is the part
// of the perspective that the outline of the dot leaves undetermined. (The maps that preserve x^2 + y^2 - w^2 are the
// Lorentz transformations of the plane: rotations and these.)
Eigen::Matrix3d ConicPreservingHomography(const Eigen::Vector2d& boost) {
  const double square = boost.squaredNorm();
  const double gamma = 1 / std::sqrt(1 - square);
  Eigen::Matrix3d map = Eigen::Matrix3d::Identity();
  // This factor equals (gamma - 1) / square, and is 1/2 at 0.
  map.topLeftCorner<2, 2>() += gamma * gamma / (gamma + 1) * boost * boost.transpose();
  map.topRightCorner<2, 1>() = gamma * boost;
  map.bottomLeftCorner<1, 2>() = gamma * boost.transpose();
  map(2, 2) = gamma;
  return map;
}

Eigen::Matrix3d Turn(double angle_rad) {
  Eigen::Matrix3d map = Eigen::Matrix3d::Identity();
  map.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(angle_rad).toRotationMatrix();
  return map;
}

}  // namespace

// An initial guess of a ring's perspective and phase, from the middles of its sectors.
struct RingDecoder::Guess {
  Eigen::Vector2d boost = Eigen::Vector2d::Zero();
  double phase_rad = 0;  // Angle at which the first sector of `word` begins.
  uint32_t word = 0;
  std::array<double, kMaxBits> margins{};  // |v - 0.5| of each sector; v is 0 for blank and 1 for the dot's colour.
  double score = -1;                       // Mean square of 2 v - 1 over the sectors, minus the variance within them.
};

namespace {

using Guess = RingDecoder::Guess;

constexpr int kSamplesPerBit = 8;
using RingSamples = std::array<double, static_cast<size_t>(kSamplesPerBit) * kMaxBits>;

// Returns the directions of the samples on a circle, kSamplesPerBit for each sector.
std::vector<Eigen::Vector2d> RingDirections(int bits) {
  std::vector<Eigen::Vector2d> directions;
  const int num_angles = kSamplesPerBit * bits;
  for (int i = 0; i < num_angles; ++i) {
    const double angle = 2 * kPi * i / num_angles;
    directions.emplace_back(std::cos(angle), std::sin(angle));
  }
  return directions;
}

// Samples the grey values on a circle of `radius`, in every `step`-th direction; returns false if it leaves the
// image.
bool SampleCircle(const cv::Mat& grey, const Eigen::Matrix3d& pixel_from_ring,
                  const std::vector<Eigen::Vector2d>& directions, double radius, size_t step, double* values) {
  for (size_t i = 0; i < directions.size(); i += step) {
    const double x = radius * directions[i].x();
    const double y = radius * directions[i].y();
    const double w = pixel_from_ring(2, 0) * x + pixel_from_ring(2, 1) * y + pixel_from_ring(2, 2);
    if (w <= 0.1) return false;
    const double by_w = 1 / w;
    const Eigen::Vector2d pixel(by_w * (pixel_from_ring(0, 0) * x + pixel_from_ring(0, 1) * y + pixel_from_ring(0, 2)),
                                by_w * (pixel_from_ring(1, 0) * x + pixel_from_ring(1, 1) * y + pixel_from_ring(1, 2)));
    if (!IsInImage(grey, pixel)) return false;
    *values++ = GreyAt(grey, pixel);
  }
  return true;
}

// Returns the guess with the best phase for one perspective.
Guess GuessWord(const cv::Mat& grey, const Eigen::Matrix3d& pixel_from_unit, const Eigen::Vector2d& boost, int bits,
                const std::vector<Eigen::Vector2d>& directions) {
  constexpr double kRadii[] = {2.25, 2.5, 2.75};
  const int num_angles = kSamplesPerBit * bits;
  const Eigen::Matrix3d pixel_from_ring = pixel_from_unit * ConicPreservingHomography(boost);
  Guess best;
  RingSamples samples;
  if (!SampleCircle(grey, pixel_from_ring, directions, 0.4, static_cast<size_t>(bits), samples.data())) return best;
  const double inside = std::accumulate(samples.begin(), samples.begin() + kSamplesPerBit, 0.0) / kSamplesPerBit;
  if (!SampleCircle(grey, pixel_from_ring, directions, 1.5, 1, samples.data())) return best;
  std::nth_element(samples.begin(), samples.begin() + num_angles / 2, samples.begin() + num_angles);
  const double blank = samples[static_cast<size_t>(num_angles / 2)];
  if (std::abs(blank - inside) < 4) return best;
  RingSamples sums{};
  RingSamples squares{};
  for (const double radius : kRadii) {
    if (!SampleCircle(grey, pixel_from_ring, directions, radius, 1, samples.data())) return best;
    for (size_t i = 0; i < directions.size(); ++i) {
      const double v = std::clamp((blank - samples[i]) / (blank - inside), -0.3, 1.3);
      sums[i] += v / std::size(kRadii);
      squares[i] += v * v / std::size(kRadii);
    }
  }
  for (int shift = 0; shift < kSamplesPerBit; ++shift) {
    Guess guess;
    guess.boost = boost;
    guess.phase_rad = 2 * kPi * (shift - 0.5) / num_angles;
    double score = 0;
    for (int bit = 0; bit < bits; ++bit) {
      double sum = 0;
      double square = 0;
      constexpr int kFirst = 1;  // Samples at the sectors' edges are skipped.
      for (int k = kFirst; k < kSamplesPerBit - kFirst; ++k) {
        const auto i = static_cast<size_t>((shift + bit * kSamplesPerBit + k) % num_angles);
        sum += sums[i];
        square += squares[i];
      }
      constexpr int kCount = kSamplesPerBit - 2 * kFirst;
      const double mean = sum / kCount;
      const double variance = square / kCount - mean * mean;
      score += ((2 * mean - 1) * (2 * mean - 1) - 4 * variance) / bits;
      guess.margins[bit] = std::abs(mean - 0.5);
      guess.word = (guess.word << 1) | (mean > 0.5 ? 1U : 0U);
    }
    guess.score = score;
    if (guess.score > best.score) best = guess;
  }
  return best;
}

// Returns the maximum perspective. The plane's horizon is f / tan(tilt) away, which is 1 / |boost| radii of the dot.
double MaxBoost(const cv::Mat& grey, const Ellipse& dot) {
  const Eigen::Vector2d axes_px = dot.SemiAxesPx();
  const double steepness = std::sqrt(std::max(0.0, std::pow(axes_px.x() / axes_px.y(), 2) - 1));
  const double least_focal_px = 0.5 * std::max(grey.cols, grey.rows);
  return std::min(0.2, axes_px.y() * std::max(steepness, 0.3) / least_focal_px);
}

// Returns the best guess over perspectives along the shorter axis, where they mostly lie.
Guess BestGuess(const cv::Mat& grey, const Ellipse& dot, double max_boost, int bits) {
  const Eigen::Matrix3d pixel_from_unit = PixelFromUnitCircle(dot);
  const Eigen::Vector2d direction = EigenOfSymmetric(dot.shape).vectors.col(1);
  const std::vector<Eigen::Vector2d> directions = RingDirections(bits);
  Guess guess = GuessWord(grey, pixel_from_unit, Eigen::Vector2d::Zero(), bits, directions);
  constexpr double kBoostStep = 0.02;
  for (int i = 1; i * kBoostStep < max_boost + 0.5 * kBoostStep; ++i) {
    for (const double sign : {-1.0, 1.0}) {
      const Guess other = GuessWord(grey, pixel_from_unit, sign * i * kBoostStep * direction, bits, directions);
      if (other.score > guess.score) guess = other;
    }
  }
  return guess;
}

// The model of a ring with a known word, fitted to the pixels from the gap to the quiet zone.
class RingFit {
 public:
  using Parameters = RingParameters;

  RingFit(const cv::Mat& grey, const RefinedEllipse& dot, int bits, const Guess& guess, double boost_stddev)
      : pixel_from_unit_(PixelFromUnitCircle(dot.ellipse)),
        centre_px_(dot.ellipse.centre_px),
        radius_px_(dot.ellipse.RadiusPx()),
        sigma_px_(dot.blur_sigma_px),
        word_{guess.word, bits},
        boost_stddev_(boost_stddev) {
    x_ << guess.boost, guess.phase_rad, 1, 0, dot.contrast_grey, 0, 0;
    TakePixels(grey);
  }

  // Fits with a wide blur first, whose edges attract from afar, then with that of the image. Returns false if the
  // result is not a ring.
  bool Fit() {
    if (pixels_.size() < 60) return false;
    const double blur_px = sigma_px_;
    constexpr size_t kEvenMoreThanEnough = 240;
    constexpr double kCoarsely = 1e-3;
    for (const double share : {0.12, 0.03}) {
      sigma_px_ = share * radius_px_;
      const size_t stride = std::max<size_t>(1, pixels_.size() / kEvenMoreThanEnough);
      if (sigma_px_ > 1.5 * blur_px && !Minimise(stride, kCoarsely)) return false;
    }
    sigma_px_ = blur_px;
    constexpr double kExactly = 1e-4;
    return Minimise(1, kExactly);
  }

  const Parameters& x() const { return x_; }
  // Returns what the ring adds to the grey value of a pixel (negative for a dark ring), in grey levels.
  double RingGrey(const Eigen::Matrix3d& ring_from_pixel, const Eigen::Vector2d& pixel) const {
    const Eigen::Vector2d offset = (pixel - centre_px_) / radius_px_;
    const double light = 1 + x_[kRingLightX] * offset.x() + x_[kRingLightY] * offset.y();
    return light * x_[kRingStep] * RingCoverage(PlaceOf(ring_from_pixel, pixel), x_[kRingScale]);
  }
  Eigen::Matrix3d PixelFromRing(const Parameters& x) const {
    return pixel_from_unit_ * ConicPreservingHomography(x.head<2>()) * Turn(x[kRingPhase]);
  }

  struct Residuals {
    double rms = 0;           // RMS relative to the step.
    double worst_sector = 0;  // Largest mean over a sector, relative to the step.
    double worst_blank = 0;   // Largest mean over an eighth of the gap or the quiet zone, relative to the step.
    bool is_complete = true;  // Whether every sector has pixels.
  };
  Residuals Judge() const {
    Residuals residuals;
    const auto num_sectors = static_cast<size_t>(word_.bits);
    std::vector<double> sector_sums(num_sectors);
    std::vector<double> sector_weights(num_sectors);
    std::array<double, 16> blank_sums{};
    std::array<double, 16> blank_weights{};
    const RingMap map = MapOf(x_);
    const RingPixels columns(pixels_, 1, map.ring_from_place, word_);
    const std::vector<RingResidual> all = RingResiduals(columns, map, x_);
    double sum_square = 0;
    for (size_t i = 0; i < all.size(); ++i) {
      const double residual = all[i].residual;
      sum_square += residual * residual;
      const double middle = 0.5 * (kRingInner + kRingOuter);
      const double off_middle = std::abs(all[i].radius - middle);
      if (off_middle < 0.5) {
        const double weight = 1.2 - 2 * off_middle;
        const auto sector = std::min(static_cast<size_t>(columns.turns()[i] * word_.bits), num_sectors - 1);
        sector_sums[sector] += weight * residual;
        sector_weights[sector] += weight;
      } else {
        const size_t part = static_cast<size_t>(columns.turns()[i] * 8) + (all[i].radius < middle ? 0 : 8);
        blank_sums[part] += residual;
        blank_weights[part] += 1;
      }
    }
    residuals.rms = std::sqrt(sum_square / static_cast<double>(all.size()));
    for (size_t i = 0; i < num_sectors; ++i) {
      if (sector_weights[i] == 0) residuals.is_complete = false;
      residuals.worst_sector =
          std::max(residuals.worst_sector, std::abs(sector_sums[i]) / std::max(sector_weights[i], 1e-9));
    }
    for (size_t i = 0; i < 16; ++i) {
      residuals.worst_blank =
          std::max(residuals.worst_blank, std::abs(blank_sums[i]) / std::max(blank_weights[i], 1.0));
    }
    return residuals;
  }

 private:
  // The position of a pixel in the ring's plane.
  struct Place {
    double radius = 0;
    double turn = 0;           // Angle from the first sector's first edge, in turns, in [0, 1).
    double radial_sigma = 0;   // Sigma of the blur along the radius, in radii of the dot.
    double tangent_sigma = 0;  // Sigma of the blur across the radius.
  };

  static Place PlaceOf(const Eigen::Matrix3d& ring_from_pixel, const Eigen::Vector2d& pixel, double sigma_px) {
    const Eigen::Vector3d mapped = ring_from_pixel * pixel.homogeneous();
    const double by_w = 1 / mapped.z();
    const Eigen::Vector2d ring = by_w * mapped.head<2>();
    Place place;
    place.radius = ring.norm();
    place.turn = std::atan2(ring.y(), ring.x()) / (2 * kPi);
    if (place.turn < 0) place.turn += 1;
    const Eigen::Matrix2d slope =
        by_w * (ring_from_pixel.topLeftCorner<2, 2>() - ring * ring_from_pixel.bottomLeftCorner<1, 2>());
    const Eigen::Vector2d radial = ring / std::max(place.radius, 1e-9);
    place.radial_sigma = sigma_px * (slope.transpose() * radial).norm();
    place.tangent_sigma = sigma_px * (slope.transpose() * Eigen::Vector2d(-radial.y(), radial.x())).norm();
    return place;
  }
  Place PlaceOf(const Eigen::Matrix3d& ring_from_pixel, const Eigen::Vector2d& pixel) const {
    return PlaceOf(ring_from_pixel, pixel, sigma_px_);
  }

  double RingCoverage(const Place& place, double scale) const {
    const double radial = Phi((place.radius - kRingInner * scale) / place.radial_sigma) -
                          Phi((place.radius - kRingOuter * scale) / place.radial_sigma);
    if (radial < 1e-6) return 0;
    const double at = place.turn * word_.bits;
    const int sector = std::min(static_cast<int>(at), word_.bits - 1);
    const double sectors_per_sigma = place.tangent_sigma / place.radius * word_.bits / (2 * kPi);
    const double here = word_.Bit(sector);
    double angular = here;
    angular += (word_.Bit(sector - 1) - here) * Phi((sector - at) / sectors_per_sigma);
    angular += (word_.Bit(sector + 1) - here) * Phi((at - sector - 1) / sectors_per_sigma);
    return radial * angular;
  }

  void TakePixels(const cv::Mat& grey) {
    const Eigen::Matrix3d pixel_from_ring = PixelFromRing(x_);
    // The box bounds the image of the outermost circle.
    Eigen::Vector2d low = centre_px_;
    Eigen::Vector2d high = centre_px_;
    for (int i = 0; i < 24; ++i) {
      const double angle = 2 * kPi * i / 24;
      const Eigen::Vector2d pixel =
          (pixel_from_ring * Eigen::Vector3d(kLookedAt * std::cos(angle), kLookedAt * std::sin(angle), 1))
              .hnormalized();
      low = low.cwiseMin(pixel);
      high = high.cwiseMax(pixel);
    }
    const double area_px = (high - low).prod();
    constexpr double kMaxPixels = 1600;
    const int stride = std::max(1, static_cast<int>(std::sqrt(area_px / kMaxPixels)));
    const Eigen::Matrix3d ring_from_pixel = pixel_from_ring.inverse();
    const int x0 = std::max(0, static_cast<int>(low.x()));
    const int y0 = std::max(0, static_cast<int>(low.y()));
    const int x1 = std::min(grey.cols - 1, static_cast<int>(high.x()) + 1);
    const int y1 = std::min(grey.rows - 1, static_cast<int>(high.y()) + 1);
    std::vector<double> gap;
    // For a large ring, the means of blocks of pixels serve as pixels, which adds to the blur.
    sigma_px_ = std::sqrt(sigma_px_ * sigma_px_ + (stride * stride - 1) / 12.0);
    for (int row = y0; row + stride <= y1 + 1; row += stride) {
      for (int column = x0; column + stride <= x1 + 1; column += stride) {
        const Eigen::Vector2d pixel(column + 0.5 * (stride - 1), row + 0.5 * (stride - 1));
        const Eigen::Vector3d mapped = ring_from_pixel * pixel.homogeneous();
        if (mapped.z() <= 0) continue;
        const double radius = mapped.hnormalized().norm();
        if (radius < 1.4 || radius > kLookedAt) continue;
        int sum = 0;
        for (int i = 0; i < stride; ++i) {
          const uchar* const line = grey.ptr<uchar>(row + i) + column;
          for (int j = 0; j < stride; ++j) sum += line[j];
        }
        const double mean = static_cast<double>(sum) / (stride * stride);
        pixels_.push_back({(pixel - centre_px_) / radius_px_, mean});
        if (radius < 1.7) gap.push_back(mean);
      }
    }
    x_[kRingBlank] = gap.empty() ? 0 : Median(gap);
  }

  // Huber threshold of a residual in units of the step, and prior sigma of the ring's scale.
  static constexpr double kBend = 0.15;
  static constexpr double kScaleStddev = 0.03;

  // Variance of a residual against which the priors are weighted.
  static constexpr double kPriorWeight = 0.03 * 0.03;

  RingMap MapOf(const Parameters& x) const {
    Eigen::Matrix3d pixel_from_place = Eigen::Matrix3d::Identity();
    pixel_from_place.topLeftCorner<2, 2>() *= radius_px_;
    pixel_from_place.topRightCorner<2, 1>() = centre_px_;
    RingMap map;
    map.ring_from_place = PixelFromRing(x).inverse() * pixel_from_place;
    constexpr double kDelta = 1e-4;
    for (int i = 0; i < 3; ++i) {
      Parameters moved = x;
      moved[i] += kDelta;
      map.derivatives[static_cast<size_t>(i)] =
          (PixelFromRing(moved).inverse() * pixel_from_place - map.ring_from_place) / kDelta;
    }
    map.sigma = sigma_px_ / radius_px_;
    return map;
  }

  // Returns the sums for residuals in units of `unit`, including the priors.
  RingSums SumsOf(const RingPixels& pixels, const Parameters& x, double unit) const {
    RingSums sums = SumRing(pixels, MapOf(x), x, unit, kBend);
    const auto add_prior = [&](int i, double mean, double stddev) {
      const double weight = kPriorWeight / (stddev * stddev);
      sums.cost += weight * (x[i] - mean) * (x[i] - mean);
      sums.normal(i, i) += weight;
      sums.gradient[i] += weight * (x[i] - mean);
    };
    add_prior(kRingBoostX, 0, boost_stddev_);
    add_prior(kRingBoostY, 0, boost_stddev_);
    add_prior(kRingScale, 1, kScaleStddev);
    return sums;
  }

  // A point of the minimisation.
  struct FitPoint : RingSums {
    Parameters x;
  };

  // Returns the parameters after a step, or nothing if they do not describe a ring around the dot.
  static std::optional<Parameters> Moved(const Parameters& x, const Parameters& step) {
    const Parameters next = x + step;
    const bool is_ring = next.head<2>().norm() < 0.25 && std::abs(next[kRingScale] - 1) < 0.3;
    return is_ring ? std::optional<Parameters>(next) : std::nullopt;
  }

  // Minimises the cost over every `stride`-th pixel until the predicted gain of a step is less than `tolerance` of the
  // cost, and takes that step. Returns false if a step is not finite.
  bool Minimise(size_t stride, double tolerance) {
    const double unit = std::abs(x_[kRingStep]);
    const RingPixels pixels(pixels_, stride, MapOf(x_).ring_from_place, word_);
    LevenbergMarquardtOptions options;
    options.max_iterations = 12;
    options.most_damping = 1e3;
    options.small_drop = tolerance;
    options.trusted_damping = 0.1;
    options.ends_after_small_drop = false;
    const auto point_at = [&](const Parameters& x) { return FitPoint{SumsOf(pixels, x, unit), x}; };
    const auto try_step = [&](const FitPoint& from, const Parameters& step) {
      const std::optional<Parameters> next = Moved(from.x, step);
      return next ? std::optional<FitPoint>(point_at(*next)) : std::nullopt;
    };
    FitPoint point = point_at(x_);
    const auto end = MinimiseSquares(options, try_step, &point);
    x_ = point.x;
    if (end.remaining_step) x_ = Moved(point.x, *end.remaining_step).value_or(point.x);
    return end.is_finite;
  }

  Eigen::Matrix3d pixel_from_unit_;
  Eigen::Vector2d centre_px_;
  double radius_px_;
  double sigma_px_;  // Sigma of the blur.
  RingWord word_;
  double boost_stddev_;
  Parameters x_;
  std::vector<RingPixel> pixels_;
};

// Refines the dot in an image from which its ring has been subtracted.
std::optional<RefinedEllipse> RefineWithoutRing(const cv::Mat& grey, const RefinedEllipse& dot, const RingFit& fit) {
  const Eigen::Vector2d reach = 2 * dot.ellipse.ExtentPx().array() + 2;
  const Eigen::Vector2i low = (dot.ellipse.centre_px - reach).array().floor().cast<int>().max(0);
  const Eigen::Vector2i high = (dot.ellipse.centre_px + reach).array().ceil().cast<int>();
  const cv::Rect box(low.x(), low.y(), std::min(high.x(), grey.cols - 1) - low.x() + 1,
                     std::min(high.y(), grey.rows - 1) - low.y() + 1);
  cv::Mat patch(box.size(), CV_32FC1);
  const Eigen::Matrix3d ring_from_pixel = fit.PixelFromRing(fit.x()).inverse();
  for (int row = 0; row < box.height; ++row) {
    for (int column = 0; column < box.width; ++column) {
      const Eigen::Vector2d pixel(column + box.x, row + box.y);
      patch.at<float>(row, column) =
          static_cast<float>(grey.at<uchar>(row + box.y, column + box.x) - fit.RingGrey(ring_from_pixel, pixel));
    }
  }
  const Eigen::Vector2d corner(box.x, box.y);
  Ellipse start = dot.ellipse;
  start.centre_px -= corner;
  RefineEllipseOptions options;
  options.max_margin_px = 0.9 * start.SemiAxesPx().x();
  options.next_outline_ratio = kRingInner;
  options.next_reach_sigmas = 0.7;
  std::optional<RefinedEllipse> refined = RefineEllipse(patch, start, options);
  if (refined) refined->ellipse.centre_px += corner;
  return refined;
}

}  // namespace

RingDecoder::RingDecoder(int bits, DotPolarity polarity, const std::vector<uint32_t>& codes)
    : bits_(bits), polarity_(polarity), rotations_(1U << bits, -1) {
  CHECK(IsRingSize(bits)) << bits;
  for (const uint32_t code : codes) {
    CHECK_EQ(RingCodeOf(code, bits), code);
    // The rotation yields the word that is read if reading starts `count` sectors before the code does.
    for (int count = bits - 1; count >= 0; --count) rotations_[RotateRing(code, (bits - count) % bits, bits)] = count;
  }
}

bool RingDecoder::IsAlone(const cv::Mat& grey, const Ellipse& dot) const {
  constexpr int kNumAngles = 32;
  const Eigen::Matrix3d pixel_from_unit = PixelFromUnitCircle(dot);
  std::vector<double> inside;
  std::vector<double> gap;
  for (int i = 0; i < kNumAngles; ++i) {
    const Eigen::Vector2d direction(std::cos(2 * kPi * i / kNumAngles), std::sin(2 * kPi * i / kNumAngles));
    for (const double radius : {0.4, 1.5}) {
      const Eigen::Vector2d pixel = (pixel_from_unit * (radius * direction).homogeneous()).hnormalized();
      if (!IsInImage(grey, pixel)) return false;
      (radius < 1 ? inside : gap).push_back(GreyAt(grey, pixel));
    }
  }
  const double blank = Median(gap);
  const double step = Median(inside) - blank;
  if (polarity_ == DotPolarity::kDarkOnLight ? step > -4 : step < 4) return false;
  int num_blank = 0;
  for (const double value : gap) num_blank += std::abs(value - blank) < 0.45 * std::abs(step) ? 1 : 0;
  return num_blank > 0.8 * kNumAngles;
}

std::optional<RingReading> RingDecoder::Read(const cv::Mat& grey, const Ellipse& candidate) const {
  if (!MayRead(grey, candidate)) return std::nullopt;
  const std::optional<RefinedEllipse> dot = FitDot(grey, candidate);
  return dot ? ReadAround(grey, *dot) : std::nullopt;
}

bool RingDecoder::MayRead(const cv::Mat& grey, const Ellipse& candidate) const {
  CHECK_EQ(grey.type(), CV_8UC1);
  if (!IsAlone(grey, candidate)) return false;
  // Most dots are not worth a fit, since something else clearly surrounds them.
  const Guess guess = BestGuess(grey, candidate, MaxBoost(grey, candidate), bits_);
  const double least_margin = *std::min_element(guess.margins.begin(), guess.margins.begin() + bits_);
  const double clear_margin = candidate.SemiAxesPx().y() > 5 ? 0.2 : 0.3;
  return guess.score >= 0 && (rotations_[guess.word] >= 0 || least_margin <= clear_margin);
}

std::optional<RefinedEllipse> RingDecoder::FitDot(const cv::Mat& grey, const Ellipse& candidate) const {
  RefineEllipseOptions options;
  options.max_margin_px = 0.8 * candidate.SemiAxesPx().x();
  options.next_outline_ratio = kRingInner;
  std::optional<RefinedEllipse> dot = RefineEllipse(grey, candidate, options);
  if (!dot || dot->visible_ratio < 0.7 || dot->residual_ratio > 0.25) return std::nullopt;
  if (polarity_ == DotPolarity::kDarkOnLight ? dot->contrast_grey > -6 : dot->contrast_grey < 6) return std::nullopt;
  if (std::abs(std::log(dot->ellipse.RadiusPx() / candidate.RadiusPx())) > 0.3 + 0.5 / candidate.RadiusPx()) {
    return std::nullopt;
  }
  return dot;
}

bool RingDecoder::IsLikely(const cv::Mat& grey, const Ellipse& candidate) const {
  CHECK_EQ(grey.type(), CV_8UC1);
  if (candidate.SemiAxesPx().y() < kLeastLikelyRadiusPx || !IsAlone(grey, candidate)) return false;
  const Guess guess = BestGuess(grey, candidate, MaxBoost(grey, candidate), bits_);
  // The maximum is 0.5; true rings have more than 0.4 unless their sectors are blurred into each other.
  constexpr double kMinMargin = 0.25;
  return guess.score >= 0 && rotations_[guess.word] >= 0 &&
         *std::min_element(guess.margins.begin(), guess.margins.begin() + bits_) > kMinMargin;
}

std::optional<RingReading> RingDecoder::ReadAround(const cv::Mat& grey, const RefinedEllipse& dot) const {
  const Eigen::Vector2d axes_px = dot.ellipse.SemiAxesPx();
  const double max_boost = MaxBoost(grey, dot.ellipse);
  const Guess guess = BestGuess(grey, dot.ellipse, max_boost, bits_);
  if (guess.score < 0) return std::nullopt;
  // The blur of a small ring reaches the dot's edge, and that of a sector reaches the next one.
  const bool is_small = axes_px.y() < 6 * dot.blur_sigma_px;
  if (rotations_[guess.word] >= 0) return ReadAs(grey, dot, guess, max_boost, is_small);
  // Neighbours may have blurred a sector into the wrong colour, so the doubtful bits are flipped one by one and
  // the best fit decides.
  std::optional<RingReading> best;
  for (int bit = 0; is_small && bit < bits_; ++bit) {
    Guess other = guess;
    other.word ^= 1U << (bits_ - 1 - bit);
    if (guess.margins[bit] > 0.2 || rotations_[other.word] < 0) continue;
    const std::optional<RingReading> reading = ReadAs(grey, dot, other, max_boost, is_small);
    if (reading && (!best || reading->residual_ratio < best->residual_ratio)) best = reading;
  }
  return best;
}

namespace {

// The limits on the fit of a ring. Residuals are ratios to the contrast of the dot. Blur hides the shape of small
// rings, so that each limit grows with the inverse of the dot's minor semi-axis, in 1 / px.
struct RingLimits {
  double rms;  // RMS of all residuals; the second number multiplies the inverse, the third the residual of the dot.
  double rms_per_inverse_px;
  double rms_per_dot_residual;
  double sector;  // Mean residual over the worst sector, or over the worst eighth of the gap or the quiet zone.
  double sector_per_inverse_px;
  double scale_error;  // Difference between the sizes of the ring and of the design, as a ratio.
  double scale_error_per_inverse_px;

  bool Holds(const RingFit::Residuals& residuals, double ring_scale_error, double inverse_px,
             double dot_residual) const {
    const double sector_limit = sector + sector_per_inverse_px * inverse_px;
    return residuals.rms <= rms + rms_per_inverse_px * inverse_px + rms_per_dot_residual * dot_residual &&
           residuals.worst_sector <= sector_limit && residuals.worst_blank <= sector_limit &&
           ring_scale_error <= scale_error + scale_error_per_inverse_px * inverse_px;
  }
};

// A ring beyond these limits is another object: stains, letters and other programs' codes stay outside of them.
constexpr RingLimits kAcceptedRing = {0.15, 0, 0, 0.25, 0, 0.05, 0.3};
// Clear rings are trusted without neighbours. The limits are about three times the values of true rings in rendered
// images.
constexpr RingLimits kClearRing = {0.015, 0.1, 1.5, 0.06, 0.2, 0.01, 0.1};
// The dots of clear rings have a minor semi-axis of more than 4 px.
constexpr double kMaxClearInversePx = 0.25;
// The boost of the ring's homography may exceed the largest boost that the pose allows by noise.
constexpr double kMaxBoostRatio = 1.5;
constexpr double kMaxBoostExcess = 0.02;
constexpr double kMaxBoostExcessPx = 0.05;
// Ring and dot are printed with the same ink, so their contrasts agree up to uneven light and blur.
constexpr double kMinStepRatio = 0.6;
constexpr double kMaxStepRatio = 1.6;

}  // namespace

std::optional<RingReading> RingDecoder::ReadAs(const cv::Mat& grey, const RefinedEllipse& dot, const Guess& guess,
                                               double max_boost, bool is_small) const {
  RingReading reading;
  reading.code = RingCodeOf(guess.word, bits_);
  reading.dot = dot;
  const double boost_stddev = 0.5 * max_boost + 0.003;
  RingFit fit(grey, dot, bits_, guess, boost_stddev);
  if (!fit.Fit()) return std::nullopt;
  if (is_small) {
    // The dot is refined without the ring, then the ring is fitted around the new outline.
    const std::optional<RefinedEllipse> alone = RefineWithoutRing(grey, dot, fit);
    if (!alone) return std::nullopt;
    reading.dot = *alone;
    Guess better = guess;
    better.boost.setZero();
    better.phase_rad = fit.x()[kRingPhase];
    fit = RingFit(grey, *alone, bits_, better, boost_stddev);
    if (!fit.Fit()) return std::nullopt;
  }
  const RingFit::Residuals residuals = fit.Judge();
  const double inverse_px = 1 / reading.dot.ellipse.SemiAxesPx().y();
  const RingFit::Parameters& x = fit.x();
  const double step_ratio = x[kRingStep] / reading.dot.contrast_grey;
  const double scale_error = std::abs(x[kRingScale] - 1);
  const double boost_limit = kMaxBoostRatio * max_boost + kMaxBoostExcess + kMaxBoostExcessPx * inverse_px;
  if (!residuals.is_complete || !kAcceptedRing.Holds(residuals, scale_error, inverse_px, reading.dot.residual_ratio) ||
      !(x.head<2>().norm() <= boost_limit) || !(step_ratio >= kMinStepRatio && step_ratio <= kMaxStepRatio)) {
    return std::nullopt;
  }
  reading.pixel_from_ring = fit.PixelFromRing(x) * Turn(2 * kPi * rotations_[guess.word] / bits_);
  reading.residual_ratio = residuals.rms;
  reading.is_clear = inverse_px < kMaxClearInversePx &&
                     kClearRing.Holds(residuals, scale_error, inverse_px, reading.dot.residual_ratio);
  return reading;
}

}  // namespace heba
