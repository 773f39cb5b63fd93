#include "targets/ring_decoder.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Dense>

#include "heba/base/error.h"
#include "heba/base/units.h"
#include "targets/image.h"
#include "targets/ring_code.h"

namespace heba {
namespace {

constexpr int kMaxBits = 14;
// Radii of the dot: the quiet zone is looked at to here, as others' rings may begin where it ends.
constexpr double kLookedAt = kRingQuiet - 0.1;

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// The normal distribution.
double Phi(double z) {
  if (z > 5) return 1;
  if (z < -5) return 0;
  return 0.5 * std::erfc(-z / std::sqrt(2.0));
}

// Maps the unit circle onto the ellipse; the principal axes stay.
Eigen::Matrix3d PixelFromUnitCircle(const Ellipse& ellipse) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(ellipse.shape);
  Eigen::Matrix3d map = Eigen::Matrix3d::Identity();
  map.topLeftCorner<2, 2>() = axes.operatorInverseSqrt();
  map.topRightCorner<2, 1>() = ellipse.centre_px;
  return map;
}

// A homography that maps the unit circle onto itself and the origin to `boost`, |boost| < 1: what the dot's outline
// leaves open about perspective. (The maps that keep x^2 + y^2 - w^2 are the Lorentz transformations of the plane:
// rotations and these.)
Eigen::Matrix3d Boost(const Eigen::Vector2d& boost) {
  const double square = boost.squaredNorm();
  const double gamma = 1 / std::sqrt(1 - square);
  Eigen::Matrix3d map = Eigen::Matrix3d::Identity();
  // (gamma - 1) / square, which is 1/2 at 0.
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

// A ring with perspective and phase guessed from the middles of its sectors.
struct RingDecoder::Guess {
  Eigen::Vector2d boost = Eigen::Vector2d::Zero();
  double phase_rad = 0;  // Where the first sector of `word` begins.
  uint32_t word = 0;
  std::array<double, kMaxBits> margins{};  // Of each sector: |v - 0.5|, v being 0 for blank and 1 for the dot's colour.
  double score = -1;                       // Mean square of 2 v - 1 over the sectors, less the variance within them.
};

namespace {

using Guess = RingDecoder::Guess;

// The best phase under a perspective.
Guess GuessWord(const cv::Mat& grey, const Eigen::Matrix3d& pixel_from_unit, const Eigen::Vector2d& boost, int bits) {
  constexpr int kSamplesPerBit = 8;
  constexpr double kRadii[] = {2.25, 2.5, 2.75};
  const int num_angles = kSamplesPerBit * bits;
  const Eigen::Matrix3d pixel_from_ring = pixel_from_unit * Boost(boost);
  const auto sample = [&](double radius, double angle_rad) {
    const Eigen::Vector3d point(radius * std::cos(angle_rad), radius * std::sin(angle_rad), 1);
    const Eigen::Vector3d mapped = pixel_from_ring * point;
    if (mapped.z() <= 0.1) return -1.0;
    const Eigen::Vector2d pixel = mapped.hnormalized();
    return IsInPicture(grey, pixel) ? GreyAt(grey, pixel) : -1.0;
  };
  Guess best;
  double inside = 0;
  for (int i = 0; i < 8; ++i) {
    const double value = sample(0.4, 2 * kPi * i / 8);
    if (value < 0) return best;
    inside += value / 8;
  }
  std::vector<double> gap(num_angles);
  for (int i = 0; i < num_angles; ++i) {
    gap[i] = sample(1.5, 2 * kPi * i / num_angles);
    if (gap[i] < 0) return best;
  }
  const double blank = Median(gap);
  if (std::abs(blank - inside) < 4) return best;
  std::vector<double> sums(num_angles);
  std::vector<double> squares(num_angles);
  for (int i = 0; i < num_angles; ++i) {
    for (const double radius : kRadii) {
      const double value = sample(radius, 2 * kPi * i / num_angles);
      if (value < 0) return best;
      const double v = std::clamp((blank - value) / (blank - inside), -0.3, 1.3);
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
      constexpr int kFirst = 1;  // Without the sectors' edges.
      for (int k = kFirst; k < kSamplesPerBit - kFirst; ++k) {
        const int i = (shift + bit * kSamplesPerBit + k) % num_angles;
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

// How far perspective may go. The plane's horizon is f / tan(tilt) away: as many radii as 1 / |boost|.
double MaxBoost(const cv::Mat& grey, const Ellipse& dot) {
  const Eigen::Vector2d axes_px = dot.SemiAxesPx();
  const double steepness = std::sqrt(std::max(0.0, std::pow(axes_px.x() / axes_px.y(), 2) - 1));
  const double least_focal_px = 0.5 * std::max(grey.cols, grey.rows);
  return std::min(0.2, axes_px.y() * std::max(steepness, 0.3) / least_focal_px);
}

// The best guess of all perspectives, which lie along the shorter axis, mostly.
Guess BestGuess(const cv::Mat& grey, const Ellipse& dot, double max_boost, int bits) {
  const Eigen::Matrix3d pixel_from_unit = PixelFromUnitCircle(dot);
  const Eigen::Vector2d direction = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(dot.shape).eigenvectors().col(1);
  Guess guess = GuessWord(grey, pixel_from_unit, Eigen::Vector2d::Zero(), bits);
  constexpr double kBoostStep = 0.02;
  for (int i = 1; i * kBoostStep < max_boost + 0.5 * kBoostStep; ++i) {
    for (const double sign : {-1.0, 1.0}) {
      const Guess other = GuessWord(grey, pixel_from_unit, sign * i * kBoostStep * direction, bits);
      if (other.score > guess.score) guess = other;
    }
  }
  return guess;
}

// The picture of a ring with a known word, fitted to the pixels from the gap to the quiet zone.
class RingFit {
 public:
  enum Parameter { kBoostX, kBoostY, kPhase, kScale, kBlank, kStep, kLightX, kLightY, kNumParameters };
  using Parameters = Eigen::Matrix<double, kNumParameters, 1>;

  RingFit(const cv::Mat& grey, const RefinedEllipse& dot, int bits, const Guess& guess, double boost_stddev)
      : pixel_from_unit_(PixelFromUnitCircle(dot.ellipse)),
        centre_px_(dot.ellipse.centre_px),
        radius_px_(dot.ellipse.RadiusPx()),
        sigma_px_(dot.blur_sigma_px),
        bits_(bits),
        word_(guess.word),
        boost_stddev_(boost_stddev) {
    x_ << guess.boost, guess.phase_rad, 1, 0, dot.contrast_grey, 0, 0;
    TakePixels(grey);
  }

  // From a wide blur, whose edges draw from afar, to that of the picture. False if what comes out is no ring.
  bool Fit() {
    if (samples_.size() < 60) return false;
    const double blur_px = sigma_px_;
    for (const double share : {0.12, 0.03}) {
      sigma_px_ = share * radius_px_;
      if (sigma_px_ > 1.5 * blur_px && !Minimise()) return false;
    }
    sigma_px_ = blur_px;
    return Minimise();
  }

  const Parameters& x() const { return x_; }
  double num_samples() const { return static_cast<double>(samples_.size()); }
  // What the ring takes from a pixel's brightness (or adds to it), grey levels.
  double RingGrey(const Eigen::Matrix3d& ring_from_pixel, const Eigen::Vector2d& pixel) const {
    const Eigen::Vector2d offset = (pixel - centre_px_) / radius_px_;
    const double light = 1 + x_[kLightX] * offset.x() + x_[kLightY] * offset.y();
    return light * x_[kStep] * RingCoverage(PlaceOf(ring_from_pixel, pixel), x_[kScale]);
  }
  Eigen::Matrix3d PixelFromRing(const Parameters& x) const {
    return pixel_from_unit_ * Boost(x.head<2>()) * Turn(x[kPhase]);
  }

  struct Residuals {
    double rms = 0;           // By the step.
    double worst_sector = 0;  // The largest mean of one, by the step, and the largest of an eighth of
    double worst_blank = 0;   // the gap or the quiet zone.
    bool is_complete = true;  // Every sector has pixels.
  };
  Residuals Judge() const {
    Residuals residuals;
    std::vector<double> sector_sums(bits_);
    std::vector<double> sector_weights(bits_);
    std::array<double, 16> blank_sums{};
    std::array<double, 16> blank_weights{};
    const Eigen::Matrix3d ring_from_pixel = PixelFromRing(x_).inverse();
    double sum_square = 0;
    for (const PixelSample& sample : samples_) {
      const Place place = PlaceOf(ring_from_pixel, sample.pixel);
      const double light = 1 + x_[kLightX] * sample.offset.x() + x_[kLightY] * sample.offset.y();
      const double residual =
          (light * (x_[kBlank] + x_[kStep] * Coverage(place, x_[kScale])) - sample.grey) / (light * x_[kStep]);
      sum_square += residual * residual;
      const double middle = 0.5 * (kRingInner + kRingOuter);
      if (std::abs(place.radius - middle) < 0.5) {
        const double weight = 1.2 - 2 * std::abs(place.radius - middle);
        const int sector = std::min(static_cast<int>(place.turn * bits_), bits_ - 1);
        sector_sums[sector] += weight * residual;
        sector_weights[sector] += weight;
      } else {
        const int part = std::min(static_cast<int>(place.turn * 8), 7) + (place.radius < middle ? 0 : 8);
        blank_sums[part] += residual;
        blank_weights[part] += 1;
      }
    }
    residuals.rms = std::sqrt(sum_square / num_samples());
    for (int i = 0; i < bits_; ++i) {
      if (sector_weights[i] == 0) residuals.is_complete = false;
      residuals.worst_sector =
          std::max(residuals.worst_sector, std::abs(sector_sums[i]) / std::max(sector_weights[i], 1e-9));
    }
    for (int i = 0; i < 16; ++i) {
      residuals.worst_blank =
          std::max(residuals.worst_blank, std::abs(blank_sums[i]) / std::max(blank_weights[i], 1.0));
    }
    return residuals;
  }

 private:
  struct PixelSample {
    Eigen::Vector2d pixel;
    Eigen::Vector2d offset;  // From the dot's centre, in its radii.
    double grey;
  };
  // A pixel in the ring's plane.
  struct Place {
    double radius = 0;
    double turn = 0;           // Angle from the first sector's first edge, in turns, in [0, 1).
    double radial_sigma = 0;   // Of the blur, in radii of the dot: along the radius
    double tangent_sigma = 0;  // and across.
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

  double Bit(int sector) const { return (word_ >> (bits_ - 1 - (sector + bits_) % bits_)) & 1U ? 1 : 0; }

  // The share of the dot's colour that a pixel sees.
  double Coverage(const Place& place, double scale) const {
    return Phi((1 - place.radius) / place.radial_sigma) + RingCoverage(place, scale);
  }

  double RingCoverage(const Place& place, double scale) const {
    const double radial = Phi((place.radius - kRingInner * scale) / place.radial_sigma) -
                          Phi((place.radius - kRingOuter * scale) / place.radial_sigma);
    if (radial < 1e-6) return 0;
    const double at = place.turn * bits_;
    const int sector = std::min(static_cast<int>(at), bits_ - 1);
    const double sectors_per_sigma = place.tangent_sigma / place.radius * bits_ / (2 * kPi);
    const double here = Bit(sector);
    double angular = here;
    angular += (Bit(sector - 1) - here) * Phi((sector - at) / sectors_per_sigma);
    angular += (Bit(sector + 1) - here) * Phi((at - sector - 1) / sectors_per_sigma);
    return radial * angular;
  }

  void TakePixels(const cv::Mat& grey) {
    const Eigen::Matrix3d pixel_from_ring = PixelFromRing(x_);
    // The outermost circle's image.
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
    // Of a large ring blocks of pixels, which are then its pixels and blur it.
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
        samples_.push_back({pixel, (pixel - centre_px_) / radius_px_, mean});
        if (radius < 1.7) gap.push_back(mean);
      }
    }
    x_[kBlank] = gap.empty() ? 0 : Median(gap);
  }

  // Of a residual in units of the step.
  static constexpr double kBend = 0.15;
  static constexpr double kScaleStddev = 0.03;

  double Cost(const Parameters& x) const {
    const Eigen::Matrix3d ring_from_pixel = PixelFromRing(x).inverse();
    const double unit = std::abs(x_[kStep]);
    double cost = 0;
    for (const PixelSample& sample : samples_) {
      const double light = 1 + x[kLightX] * sample.offset.x() + x[kLightY] * sample.offset.y();
      const double coverage = Coverage(PlaceOf(ring_from_pixel, sample.pixel), x[kScale]);
      const double size = std::abs(light * (x[kBlank] + x[kStep] * coverage) - sample.grey) / unit;
      cost += size <= kBend ? size * size : kBend * (2 * size - kBend);
    }
    return cost + PriorWeight() * (x.head<2>().squaredNorm() / (boost_stddev_ * boost_stddev_) +
                                   std::pow((x[kScale] - 1) / kScaleStddev, 2));
  }
  // Variance of a residual that the priors are set against.
  static double PriorWeight() { return 0.03 * 0.03; }

  // Levenberg-Marquardt.
  bool Minimise() {
    double cost = Cost(x_);
    double damping = 1e-4;
    constexpr int kMaxIterations = 12;
    for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
      Eigen::Matrix<double, kNumParameters, kNumParameters> normal;
      Parameters gradient;
      Linearise(&normal, &gradient);
      bool improved = false;
      double gain = 0;
      while (!improved && damping < 1e3) {
        Eigen::Matrix<double, kNumParameters, kNumParameters> damped = normal;
        damped.diagonal() *= 1 + damping;
        const Parameters next = x_ - damped.ldlt().solve(gradient);
        if (!next.allFinite()) return false;
        const bool is_ring = next.head<2>().norm() < 0.25 && std::abs(next[kScale] - 1) < 0.3;
        const double next_cost = is_ring ? Cost(next) : cost;
        if (is_ring && next_cost < cost) {
          improved = true;
          gain = (cost - next_cost) / cost;
          x_ = next;
          cost = next_cost;
          damping *= 0.1;
        } else {
          damping *= 10;
        }
      }
      if (!improved || gain < 1e-4) break;
    }
    return true;
  }

  void Linearise(Eigen::Matrix<double, kNumParameters, kNumParameters>* normal, Parameters* gradient) const {
    normal->setZero();
    gradient->setZero();
    const double unit = std::abs(x_[kStep]);
    const Eigen::Matrix3d ring_from_pixel = PixelFromRing(x_).inverse();
    constexpr double kDelta = 1e-3;
    std::array<Eigen::Matrix3d, 3> moved;
    for (int i = 0; i < 3; ++i) {
      Parameters x = x_;
      x[i] += kDelta;
      moved[i] = PixelFromRing(x).inverse();
    }
    for (const PixelSample& sample : samples_) {
      const double light = 1 + x_[kLightX] * sample.offset.x() + x_[kLightY] * sample.offset.y();
      const Place place = PlaceOf(ring_from_pixel, sample.pixel);
      const double coverage = Coverage(place, x_[kScale]);
      const double evenly_lit = x_[kBlank] + x_[kStep] * coverage;
      const double residual = (light * evenly_lit - sample.grey) / unit;
      const double weight = std::abs(residual) <= kBend ? 1 : kBend / std::abs(residual);
      Parameters row;
      for (int i = 0; i < 3; ++i) {
        row[i] = light * x_[kStep] * (Coverage(PlaceOf(moved[i], sample.pixel), x_[kScale]) - coverage) / kDelta;
      }
      row[kScale] = light * x_[kStep] * (Coverage(place, x_[kScale] + kDelta) - coverage) / kDelta;
      row[kBlank] = light;
      row[kStep] = light * coverage;
      row[kLightX] = evenly_lit * sample.offset.x();
      row[kLightY] = evenly_lit * sample.offset.y();
      row /= unit;
      normal->selfadjointView<Eigen::Lower>().rankUpdate(row, weight);
      *gradient += weight * residual * row;
    }
    *normal = normal->selfadjointView<Eigen::Lower>();
    for (const int i : {kBoostX, kBoostY}) {
      const double prior = PriorWeight() / (boost_stddev_ * boost_stddev_);
      (*normal)(i, i) += prior;
      (*gradient)[i] += prior * x_[i];
    }
    (*normal)(kScale, kScale) += PriorWeight() / (kScaleStddev * kScaleStddev);
    (*gradient)[kScale] += PriorWeight() / (kScaleStddev * kScaleStddev) * (x_[kScale] - 1);
  }

  Eigen::Matrix3d pixel_from_unit_;
  Eigen::Vector2d centre_px_;
  double radius_px_;
  double sigma_px_;  // Of the blur.
  int bits_;
  uint32_t word_;
  double boost_stddev_;
  Parameters x_;
  std::vector<PixelSample> samples_;
};

// The dot in a picture from which its ring is taken away.
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
    // The word that reading yields when it starts `count` sectors before the code does.
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
      if (!IsInPicture(grey, pixel)) return false;
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
  CHECK_EQ(grey.type(), CV_8UC1);
  if (!IsAlone(grey, candidate)) return std::nullopt;
  // Most dots are not worth a fit: what is around them is clearly something else.
  const Guess guess = BestGuess(grey, candidate, MaxBoost(grey, candidate), bits_);
  const double least_margin = *std::min_element(guess.margins.begin(), guess.margins.begin() + bits_);
  const double clear_margin = candidate.SemiAxesPx().y() > 5 ? 0.2 : 0.3;
  if (guess.score < 0 || (rotations_[guess.word] < 0 && least_margin > clear_margin)) return std::nullopt;
  RefineEllipseOptions options;
  options.max_margin_px = 0.8 * candidate.SemiAxesPx().x();
  options.next_outline_ratio = kRingInner;
  const std::optional<RefinedEllipse> dot = RefineEllipse(grey, candidate, options);
  if (!dot || dot->visible_ratio < 0.7 || dot->residual_ratio > 0.25) return std::nullopt;
  if (polarity_ == DotPolarity::kDarkOnLight ? dot->contrast_grey > -6 : dot->contrast_grey < 6) return std::nullopt;
  if (std::abs(std::log(dot->ellipse.RadiusPx() / candidate.RadiusPx())) > 0.3 + 0.5 / candidate.RadiusPx()) {
    return std::nullopt;
  }
  return ReadWord(grey, *dot);
}

std::optional<RingReading> RingDecoder::ReadWord(const cv::Mat& grey, const RefinedEllipse& dot) const {
  const Eigen::Vector2d axes_px = dot.ellipse.SemiAxesPx();
  const double max_boost = MaxBoost(grey, dot.ellipse);
  const Guess guess = BestGuess(grey, dot.ellipse, max_boost, bits_);
  if (guess.score < 0) return std::nullopt;
  // Where the blur of the ring reaches the dot's, and a sector's the next one's.
  const bool is_small = axes_px.y() < 6 * dot.blur_sigma_px;
  if (rotations_[guess.word] >= 0) return ReadAs(grey, dot, guess, max_boost, is_small);
  // Neighbours may have blurred a sector into the wrong colour: what the ring then looks like decides.
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

std::optional<RingReading> RingDecoder::ReadAs(const cv::Mat& grey, const RefinedEllipse& dot, const Guess& guess,
                                               double max_boost, bool is_small) const {
  RingReading reading;
  reading.code = RingCodeOf(guess.word, bits_);
  reading.dot = dot;
  const double boost_stddev = 0.5 * max_boost + 0.003;
  RingFit fit(grey, dot, bits_, guess, boost_stddev);
  if (!fit.Fit()) return std::nullopt;
  if (is_small) {
    // The dot again, without the ring, and the ring about that.
    const std::optional<RefinedEllipse> alone = RefineWithoutRing(grey, dot, fit);
    if (!alone) return std::nullopt;
    reading.dot = *alone;
    Guess better = guess;
    better.boost.setZero();
    better.phase_rad = fit.x()[RingFit::kPhase];
    fit = RingFit(grey, *alone, bits_, better, boost_stddev);
    if (!fit.Fit()) return std::nullopt;
  }
  const RingFit::Residuals residuals = fit.Judge();
  const double small_px = 1 / reading.dot.ellipse.SemiAxesPx().y();
  const RingFit::Parameters& x = fit.x();
  const double step_ratio = x[RingFit::kStep] / reading.dot.contrast_grey;
  if (!residuals.is_complete || residuals.rms > 0.15 || residuals.worst_sector > 0.25 || residuals.worst_blank > 0.25 ||
      std::abs(x[RingFit::kScale] - 1) > 0.05 + 0.3 * small_px ||
      x.head<2>().norm() > 1.5 * max_boost + 0.02 + 0.05 * small_px || step_ratio < 0.6 || step_ratio > 1.6) {
    return std::nullopt;
  }
  reading.pixel_from_ring = fit.PixelFromRing(x) * Turn(2 * kPi * rotations_[guess.word] / bits_);
  reading.residual_ratio = residuals.rms;
  // About three times what the true rings of rendered pictures have.
  reading.is_clear = small_px < 0.25 && residuals.rms < 1.5 * reading.dot.residual_ratio + 0.015 + 0.1 * small_px &&
                     residuals.worst_sector < 0.06 + 0.2 * small_px && residuals.worst_blank < 0.06 + 0.2 * small_px &&
                     std::abs(x[RingFit::kScale] - 1) < 0.01 + 0.1 * small_px;
  return reading;
}

}  // namespace heba
