#include "targets/dots/blurred_ellipse.h"

#include <algorithm>
#include <cmath>

#include "heba/kernels/gram_matrix.h"
#include "heba/kernels/lane_functions.h"
#include "heba/kernels/simd.h"

namespace heba {

void EdgePixels::Clear() {
  size_ = 0;
  for (std::vector<double>* column : {&x_, &y_, &grey_, &weights_}) column->clear();
}

void EdgePixels::Add(double x, double y, double grey) {
  x_.push_back(x);
  y_.push_back(y);
  grey_.push_back(grey);
  ++size_;
}

void EdgePixels::Pad() {
  const size_t padded = PaddedToLanes(size_);
  for (std::vector<double>* column : {&x_, &y_, &grey_}) column->resize(padded, 0.0);
  weights_.assign(size_, 1.0);
  weights_.resize(padded, 0.0);
}

namespace {

constexpr int kMostColumns = kNumBlurredEllipseParameters + 2;
constexpr int kChunk = 64;

// The grey value that the model predicts at a pixel. The distance from the outline, to first order (exact on the
// outline and for circles), is (rho - 1) rho / |M u| with rho^2 = u' M u.
template <class V>
struct Edge {
  V ux;
  V uy;
  V mu_x;
  V mu_y;
  V by_g;  // 1 / |M u|
  V rho;
  V distance;
  V z;
  V share;  // Share of the inside.
  V density;
  V light;
  V inside;
  V evenly_lit;
};

template <class V>
HEBA_INLINE Edge<V> EdgeAt(const double* p, double by_sigma, const V& x, const V& y) {
  Edge<V> edge;
  edge.ux = x - p[kCentreX];
  edge.uy = y - p[kCentreY];
  edge.mu_x = p[kShapeXX] * edge.ux + p[kShapeXY] * edge.uy;
  edge.mu_y = p[kShapeXY] * edge.ux + p[kShapeYY] * edge.uy;
  const V q = edge.ux * edge.mu_x + edge.uy * edge.mu_y;
  const V g_square = edge.mu_x * edge.mu_x + edge.mu_y * edge.mu_y;
  // The lower bound avoids a division by zero at the centre, which is far inside.
  const V least = AllLanes<V>(1e-16);
  edge.rho = SqrtLanes<V>(q > least ? q : least);
  edge.by_g = 1.0 / SqrtLanes<V>(g_square > least ? g_square : least);
  edge.distance = (edge.rho - 1.0) * edge.rho * edge.by_g;
  edge.z = edge.distance * by_sigma;
  const NormalLanes<V> normal = NormalOf<V>(-edge.z);
  edge.share = normal.cdf;
  edge.density = normal.density;
  edge.light = 1.0 + p[kLightX] * x + p[kLightY] * y;
  edge.inside = p[kInside] + p[kInsideX] * x + p[kInsideY] * y;
  edge.evenly_lit = p[kOutside] + (edge.inside - p[kOutside]) * edge.share;
  return edge;
}

// Stores the derivatives of the grey value multiplied by `scale`, one column of kChunk rows per parameter.
template <class V>
HEBA_INLINE void StoreJacobian(const double* p, double by_sigma, const Edge<V>& edge, const V& x, const V& y,
                               const V& scale, double* columns) {
  const V light = scale * edge.light;
  const V by_inside = light * edge.share;
  const V evenly_lit = scale * edge.evenly_lit;
  const V by_z = -light * (edge.inside - p[kOutside]) * edge.density;
  const V by_distance = by_z * by_sigma;
  const V by_q = by_distance * (1.0 - 0.5 / edge.rho) * edge.by_g;
  // The derivative of g = |M u| is dg = (M u)' d(M u) / g.
  const V by_g = -by_distance * edge.distance * edge.by_g * edge.by_g;
  const V m_mu_x = p[kShapeXX] * edge.mu_x + p[kShapeXY] * edge.mu_y;
  const V m_mu_y = p[kShapeXY] * edge.mu_x + p[kShapeYY] * edge.mu_y;
  StoreLanes<V>(-2.0 * by_q * edge.mu_x - by_g * m_mu_x, columns + kCentreX * kChunk);
  StoreLanes<V>(-2.0 * by_q * edge.mu_y - by_g * m_mu_y, columns + kCentreY * kChunk);
  StoreLanes<V>((by_q * edge.ux + by_g * edge.mu_x) * edge.ux, columns + kShapeXX * kChunk);
  StoreLanes<V>(2.0 * by_q * edge.ux * edge.uy + by_g * (edge.mu_x * edge.uy + edge.mu_y * edge.ux),
                columns + kShapeXY * kChunk);
  StoreLanes<V>((by_q * edge.uy + by_g * edge.mu_y) * edge.uy, columns + kShapeYY * kChunk);
  StoreLanes<V>(-by_z * edge.z, columns + kLogSigma * kChunk);
  StoreLanes<V>(light - by_inside, columns + kOutside * kChunk);
  StoreLanes<V>(by_inside, columns + kInside * kChunk);
  StoreLanes<V>(evenly_lit * x, columns + kLightX * kChunk);
  StoreLanes<V>(evenly_lit * y, columns + kLightY * kChunk);
  StoreLanes<V>(by_inside * x, columns + kInsideX * kChunk);
  StoreLanes<V>(by_inside * y, columns + kInsideY * kChunk);
}

struct KernelInput {
  const double* x;
  const double* y;
  const double* grey;
  const double* weights;
  int size;         // Padded size, a multiple of kMaxLanes.
  const double* p;  // Parameters.
  double by_sigma;
};

// Fills the columns of J and, after them, r, both multiplied by the square root of the weights, for `count` pixels
// from `first` on. Returns the cost of these pixels.
template <int kLanes>
HEBA_INLINE double FillColumns(const KernelInput& input, int first, int count, int num_free, double huber_delta,
                               double* columns) {
  using V = Lanes<kLanes>;
  V cost = AllLanes<V>(0);
  for (int i = 0; i < count; i += kLanes) {
    const V x = LoadLanes<V>(input.x + first + i);
    const V y = LoadLanes<V>(input.y + first + i);
    const V weight = LoadLanes<V>(input.weights + first + i);
    const Edge<V> edge = EdgeAt<V>(input.p, input.by_sigma, x, y);
    const V residual = edge.light * edge.evenly_lit - LoadLanes<V>(input.grey + first + i);
    const HuberLanes<V> huber = HuberOf(residual, huber_delta);
    cost += weight * huber.cost;
    const V scale = SqrtLanes<V>(weight * huber.weight);
    StoreJacobian<V>(input.p, input.by_sigma, edge, x, y, scale, columns + i);
    StoreLanes<V>(scale * residual, columns + num_free * kChunk + i);
  }
  return SumOfLanes(cost);
}

double FillColumnsBaseline(const KernelInput& input, int first, int count, int num_free, double huber_delta,
                           double* columns) {
  return FillColumns<kLanesOf<Simd::kBaseline>>(input, first, count, num_free, huber_delta, columns);
}
HEBA_TARGET_AVX2 double FillColumnsAvx2(const KernelInput& input, int first, int count, int num_free,
                                        double huber_delta, double* columns) {
  return FillColumns<kLanesOf<Simd::kAvx2>>(input, first, count, num_free, huber_delta, columns);
}
HEBA_TARGET_AVX512 double FillColumnsAvx512(const KernelInput& input, int first, int count, int num_free,
                                            double huber_delta, double* columns) {
  return FillColumns<kLanesOf<Simd::kAvx512>>(input, first, count, num_free, huber_delta, columns);
}

template <int kLanes>
HEBA_INLINE void FillResiduals(const KernelInput& input, double* residuals) {
  using V = Lanes<kLanes>;
  for (int i = 0; i < input.size; i += kLanes) {
    const Edge<V> edge = EdgeAt<V>(input.p, input.by_sigma, LoadLanes<V>(input.x + i), LoadLanes<V>(input.y + i));
    StoreLanes<V>(edge.light * edge.evenly_lit - LoadLanes<V>(input.grey + i), residuals + i);
  }
}

void FillResidualsBaseline(const KernelInput& input, double* residuals) {
  FillResiduals<kLanesOf<Simd::kBaseline>>(input, residuals);
}
HEBA_TARGET_AVX2 void FillResidualsAvx2(const KernelInput& input, double* residuals) {
  FillResiduals<kLanesOf<Simd::kAvx2>>(input, residuals);
}
HEBA_TARGET_AVX512 void FillResidualsAvx512(const KernelInput& input, double* residuals) {
  FillResiduals<kLanesOf<Simd::kAvx512>>(input, residuals);
}

KernelInput InputOf(const EdgePixels& pixels, const BlurredEllipseParameters& x) {
  return {pixels.x().data(),
          pixels.y().data(),
          pixels.grey().data(),
          pixels.weights().data(),
          static_cast<int>(pixels.weights().size()),
          x.data(),
          std::exp(-x[kLogSigma])};
}

}  // namespace

BlurredEllipseSums SumEdge(const EdgePixels& pixels, const BlurredEllipseParameters& x, int num_free,
                           double huber_delta) {
  const KernelInput input = InputOf(pixels, x);
  const auto fill = SelectForIsa(ActiveSimd(), &FillColumnsBaseline, &FillColumnsAvx2, &FillColumnsAvx512);
  alignas(64) double columns[kMostColumns * kChunk] = {};
  GramMatrix products(num_free + 1, kChunk, input.size);
  BlurredEllipseSums sums;
  for (int first = 0; first < input.size; first += kChunk) {
    const int count = std::min(kChunk, input.size - first);
    sums.cost += fill(input, first, count, num_free, huber_delta, columns);
    products.Add(columns, count);
  }
  const Eigen::MatrixXd all = products.Matrix();
  sums.normal.setIdentity();
  sums.normal.topLeftCorner(num_free, num_free) = all.topLeftCorner(num_free, num_free);
  sums.gradient.setZero();
  sums.gradient.head(num_free) = all.col(num_free).head(num_free);
  return sums;
}

std::vector<double> EdgeResiduals(const EdgePixels& pixels, const BlurredEllipseParameters& x) {
  const KernelInput input = InputOf(pixels, x);
  std::vector<double> residuals(pixels.weights().size());
  SelectForIsa(ActiveSimd(), &FillResidualsBaseline, &FillResidualsAvx2, &FillResidualsAvx512)(input, residuals.data());
  residuals.resize(pixels.size());
  return residuals;
}

}  // namespace heba
