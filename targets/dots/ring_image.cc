#include "targets/dots/ring_image.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "heba/base/units.h"
#include "heba/kernels/gram_matrix.h"
#include "heba/kernels/lane_functions.h"
#include "heba/kernels/simd.h"
#include "targets/dots/ring_code.h"
#include "targets/images/approximate_angle.h"

namespace heba {

RingPixels::RingPixels(const std::vector<RingPixel>& pixels, size_t stride, const Eigen::Matrix3d& ring_from_place,
                       const RingWord& word)
    : size_((pixels.size() + stride - 1) / stride) {
  const size_t padded = PaddedToLanes(size_);
  for (std::vector<double>& column : columns_) column.resize(padded);
  turns_.resize(size_);
  struct Sector {
    std::array<double, 7> columns;  // Columns from kHere on.
  };
  std::vector<Sector> sectors;
  for (int sector = 0; sector < word.bits; ++sector) {
    const double first_rad = 2 * kPi * sector / word.bits;
    const double last_rad = 2 * kPi * (sector + 1) / word.bits;
    const double here = word.Bit(sector);
    sectors.push_back({{here, word.Bit(sector - 1) - here, word.Bit(sector + 1) - here, std::cos(first_rad),
                        std::sin(first_rad), std::cos(last_rad), std::sin(last_rad)}});
  }
  for (size_t i = 0; i < size_; ++i) {
    const RingPixel& pixel = pixels[i * stride];
    const Eigen::Vector3d ring = ring_from_place * pixel.place.homogeneous();
    turns_[i] = ApproximateAngle(ring.x(), ring.y());
    const auto sector = std::min(static_cast<size_t>(turns_[i] * word.bits), sectors.size() - 1);
    columns_[kX][i] = pixel.place.x();
    columns_[kY][i] = pixel.place.y();
    columns_[kGrey][i] = pixel.grey;
    columns_[kWeight][i] = 1;
    for (size_t k = 0; k < 7; ++k) columns_[kHere + k][i] = sectors[sector].columns[k];
  }
  // Padding repeats a valid position, so that its radius is not zero.
  for (size_t i = size_; i < padded; ++i) {
    columns_[kX][i] = size_ > 0 ? columns_[kX][0] : 0;
    columns_[kY][i] = size_ > 0 ? columns_[kY][0] : 0;
  }
}

namespace {

constexpr int kChunk = 64;
constexpr int kMostColumns = kNumRingParameters + 2;

struct KernelInput {
  std::array<const double*, RingPixels::kNumColumns> columns;
  int size;                   // Padded size, a multiple of kMaxLanes.
  std::array<double, 9> map;  // Row-major.
  std::array<std::array<double, 9>, 3> derivatives;
  double sigma;
  const double* p;  // Parameters.
};

// The share of the dot's colour that a pixel sees, with its derivatives with respect to the position in the ring's
// plane and to the scale.
template <class V>
struct Coverage {
  V share;
  V by_x;
  V by_y;
  V by_scale;
  // Position in the ring's plane, inverse of the homogeneous coordinate w, and radius.
  V x;
  V y;
  V by_w;
  V radius;
};

template <class V>
HEBA_INLINE V Length(const V& x, const V& y) {
  return SqrtLanes<V>(x * x + y * y);
}

template <class V>
HEBA_INLINE Coverage<V> CoverageAt(const KernelInput& input, int i, const V& u, const V& v) {
  const auto& m = input.map;
  const double scale = input.p[kRingScale];
  Coverage<V> at;
  at.by_w = 1.0 / (m[6] * u + m[7] * v + m[8]);
  at.x = (m[0] * u + m[1] * v + m[2]) * at.by_w;
  at.y = (m[3] * u + m[4] * v + m[5]) * at.by_w;
  at.radius = Length<V>(at.x, at.y);
  const V radial_x = at.x / at.radius;
  const V radial_y = at.y / at.radius;
  // The Jacobian of the map converts the blur of the image to sigmas along and across the radius.
  const V xu = at.by_w * (m[0] - at.x * m[6]);
  const V xv = at.by_w * (m[1] - at.x * m[7]);
  const V yu = at.by_w * (m[3] - at.y * m[6]);
  const V yv = at.by_w * (m[4] - at.y * m[7]);
  const V by_radial_sigma =
      1.0 / (input.sigma * Length<V>(xu * radial_x + yu * radial_y, xv * radial_x + yv * radial_y));
  const V by_tangent_sigma =
      1.0 / (input.sigma * Length<V>(yu * radial_x - xu * radial_y, yv * radial_x - xv * radial_y));
  const NormalLanes<V> dot = NormalOf<V>((1.0 - at.radius) * by_radial_sigma);
  const NormalLanes<V> inner = NormalOf<V>((at.radius - kRingInner * scale) * by_radial_sigma);
  const NormalLanes<V> outer = NormalOf<V>((at.radius - kRingOuter * scale) * by_radial_sigma);
  // Distances from the two edges of the sector are positive outside of it.
  const V before = LoadLanes<V>(input.columns[RingPixels::kBefore] + i);
  const V after = LoadLanes<V>(input.columns[RingPixels::kAfter] + i);
  const V first_x = LoadLanes<V>(input.columns[RingPixels::kFirstX] + i);
  const V first_y = LoadLanes<V>(input.columns[RingPixels::kFirstY] + i);
  const V last_x = LoadLanes<V>(input.columns[RingPixels::kLastX] + i);
  const V last_y = LoadLanes<V>(input.columns[RingPixels::kLastY] + i);
  const NormalLanes<V> first = NormalOf<V>((first_y * at.x - first_x * at.y) * by_tangent_sigma);
  const NormalLanes<V> last = NormalOf<V>((last_x * at.y - last_y * at.x) * by_tangent_sigma);

  const V radial = inner.cdf - outer.cdf;
  const V angular = LoadLanes<V>(input.columns[RingPixels::kHere] + i) + before * first.cdf + after * last.cdf;
  at.share = dot.cdf + radial * angular;
  const V by_radius = (angular * (inner.density - outer.density) - dot.density) * by_radial_sigma;
  const V by_first = radial * before * first.density * by_tangent_sigma;
  const V by_last = radial * after * last.density * by_tangent_sigma;
  at.by_x = by_radius * radial_x + by_first * first_y - by_last * last_y;
  at.by_y = by_radius * radial_y - by_first * first_x + by_last * last_x;
  at.by_scale = angular * (kRingOuter * outer.density - kRingInner * inner.density) * by_radial_sigma;
  return at;
}

// Fills the columns of J and, after them, r, both multiplied by the square root of the weights, for `count` pixels
// from `first` on. Returns the cost of these pixels.
template <int kLanes>
HEBA_INLINE double FillColumns(const KernelInput& input, int first, int count, double unit, double huber_delta,
                               double* columns) {
  using V = Lanes<kLanes>;
  const double by_unit = 1 / unit;
  const double step = input.p[kRingStep];
  V cost = AllLanes<V>(0);
  for (int k = 0; k < count; k += kLanes) {
    const int i = first + k;
    const V u = LoadLanes<V>(input.columns[RingPixels::kX] + i);
    const V v = LoadLanes<V>(input.columns[RingPixels::kY] + i);
    const V weight = LoadLanes<V>(input.columns[RingPixels::kWeight] + i);
    const Coverage<V> at = CoverageAt<V>(input, i, u, v);
    const V light = 1.0 + input.p[kRingLightX] * u + input.p[kRingLightY] * v;
    const V evenly_lit = input.p[kRingBlank] + step * at.share;
    const V residual = (light * evenly_lit - LoadLanes<V>(input.columns[RingPixels::kGrey] + i)) * by_unit;
    const HuberLanes<V> huber = HuberOf(residual, huber_delta);
    cost += weight * huber.cost;
    const V scale = SqrtLanes<V>(weight * huber.weight);
    const V by_grey = scale * by_unit;
    const V by_share = by_grey * light * step;
    for (int d = 0; d < 3; ++d) {
      const auto& m = input.derivatives[d];
      const V w = m[6] * u + m[7] * v + m[8];
      const V x = (m[0] * u + m[1] * v + m[2] - at.x * w) * at.by_w;
      const V y = (m[3] * u + m[4] * v + m[5] - at.y * w) * at.by_w;
      StoreLanes<V>(by_share * (at.by_x * x + at.by_y * y), columns + d * kChunk + k);
    }
    StoreLanes<V>(by_share * at.by_scale, columns + kRingScale * kChunk + k);
    StoreLanes<V>(by_grey * light, columns + kRingBlank * kChunk + k);
    StoreLanes<V>(by_grey * light * at.share, columns + kRingStep * kChunk + k);
    StoreLanes<V>(by_grey * evenly_lit * u, columns + kRingLightX * kChunk + k);
    StoreLanes<V>(by_grey * evenly_lit * v, columns + kRingLightY * kChunk + k);
    StoreLanes<V>(scale * residual, columns + kNumRingParameters * kChunk + k);
  }
  return SumOfLanes(cost);
}

double FillColumnsBaseline(const KernelInput& input, int first, int count, double unit, double huber_delta,
                           double* columns) {
  return FillColumns<kLanesOf<Simd::kBaseline>>(input, first, count, unit, huber_delta, columns);
}
HEBA_TARGET_AVX2 double FillColumnsAvx2(const KernelInput& input, int first, int count, double unit, double huber_delta,
                                        double* columns) {
  return FillColumns<kLanesOf<Simd::kAvx2>>(input, first, count, unit, huber_delta, columns);
}
HEBA_TARGET_AVX512 double FillColumnsAvx512(const KernelInput& input, int first, int count, double unit,
                                            double huber_delta, double* columns) {
  return FillColumns<kLanesOf<Simd::kAvx512>>(input, first, count, unit, huber_delta, columns);
}

template <int kLanes>
HEBA_INLINE void FillResiduals(const KernelInput& input, double* residuals, double* radii) {
  using V = Lanes<kLanes>;
  const double step = input.p[kRingStep];
  for (int i = 0; i < input.size; i += kLanes) {
    const V u = LoadLanes<V>(input.columns[RingPixels::kX] + i);
    const V v = LoadLanes<V>(input.columns[RingPixels::kY] + i);
    const Coverage<V> at = CoverageAt<V>(input, i, u, v);
    const V light = 1.0 + input.p[kRingLightX] * u + input.p[kRingLightY] * v;
    const V grey = LoadLanes<V>(input.columns[RingPixels::kGrey] + i);
    StoreLanes<V>((light * (input.p[kRingBlank] + step * at.share) - grey) / (light * step), residuals + i);
    StoreLanes<V>(at.radius, radii + i);
  }
}

void FillResidualsBaseline(const KernelInput& input, double* residuals, double* radii) {
  FillResiduals<kLanesOf<Simd::kBaseline>>(input, residuals, radii);
}
HEBA_TARGET_AVX2 void FillResidualsAvx2(const KernelInput& input, double* residuals, double* radii) {
  FillResiduals<kLanesOf<Simd::kAvx2>>(input, residuals, radii);
}
HEBA_TARGET_AVX512 void FillResidualsAvx512(const KernelInput& input, double* residuals, double* radii) {
  FillResiduals<kLanesOf<Simd::kAvx512>>(input, residuals, radii);
}

std::array<double, 9> Entries(const Eigen::Matrix3d& matrix) {
  std::array<double, 9> entries;
  for (int i = 0; i < 9; ++i) entries[static_cast<size_t>(i)] = matrix(i / 3, i % 3);
  return entries;
}

KernelInput InputOf(const RingPixels& pixels, const RingMap& map, const RingParameters& x) {
  KernelInput input;
  for (int i = 0; i < RingPixels::kNumColumns; ++i) {
    input.columns[static_cast<size_t>(i)] = pixels.column(static_cast<RingPixels::Column>(i));
  }
  input.size = pixels.padded_size();
  input.map = Entries(map.ring_from_place);
  for (size_t d = 0; d < 3; ++d) input.derivatives[d] = Entries(map.derivatives[d]);
  input.sigma = map.sigma;
  input.p = x.data();
  return input;
}

}  // namespace

RingSums SumRing(const RingPixels& pixels, const RingMap& map, const RingParameters& x, double unit,
                 double huber_delta) {
  const KernelInput input = InputOf(pixels, map, x);
  const auto fill = SelectForIsa(ActiveSimd(), &FillColumnsBaseline, &FillColumnsAvx2, &FillColumnsAvx512);
  alignas(64) double columns[kMostColumns * kChunk] = {};
  GramMatrix products(kNumRingParameters + 1, kChunk, input.size);
  RingSums sums;
  for (int first = 0; first < input.size; first += kChunk) {
    const int count = std::min(kChunk, input.size - first);
    sums.cost += fill(input, first, count, unit, huber_delta, columns);
    products.Add(columns, count);
  }
  const Eigen::MatrixXd all = products.Matrix();
  sums.normal = all.topLeftCorner<kNumRingParameters, kNumRingParameters>();
  sums.gradient = all.col(kNumRingParameters).head<kNumRingParameters>();
  return sums;
}

std::vector<RingResidual> RingResiduals(const RingPixels& pixels, const RingMap& map, const RingParameters& x) {
  const KernelInput input = InputOf(pixels, map, x);
  std::vector<double> values(static_cast<size_t>(input.size));
  std::vector<double> radii(values.size());
  SelectForIsa(ActiveSimd(), &FillResidualsBaseline, &FillResidualsAvx2, &FillResidualsAvx512)(input, values.data(),
                                                                                               radii.data());
  std::vector<RingResidual> residuals(pixels.size());
  for (size_t i = 0; i < residuals.size(); ++i) residuals[i] = {values[i], radii[i]};
  return residuals;
}

}  // namespace heba
