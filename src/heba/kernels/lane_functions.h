// Functions that are evaluated on several numbers at once (heba/kernels/simd.h), as the kernels need them. V is double
// or a vector of lanes.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "heba/kernels/simd.h"

namespace heba {

// The type of 64-bit integers that corresponds to the lanes of V.
template <class V>
struct LaneBits {
  typedef uint64_t Type __attribute__((vector_size(sizeof(V))));  // NOLINT(modernize-use-using): attributes need it.
};
template <>
struct LaneBits<double> {
  using Type = uint64_t;
};

template <class V>
HEBA_INLINE V SqrtLanes(const V& x) {
  return EachLane(
      x, x, [](double value, double) __attribute__((always_inline)) { return __builtin_sqrt(value); });
}

template <class V>
HEBA_INLINE double LargestLane(const V& x) {
  if constexpr (std::is_same_v<V, double>) {
    return x;
  } else {
    double largest = x[0];
    for (int i = 1; i < kLanesIn<V>; ++i) largest = x[i] > largest ? x[i] : largest;
    return largest;
  }
}

template <class V>
HEBA_INLINE V AbsLanes(const V& x) {
  return x < 0.0 ? -x : x;
}

// Huber's cost of a residual, which is the square up to `huber_delta` and linear beyond, and the weight of the squared
// residual in the normal equations: 1 up to `huber_delta`, and huber_delta / |residual| beyond.
template <class V>
struct HuberLanes {
  V cost;
  V weight;
};
template <class V>
HEBA_INLINE HuberLanes<V> HuberOf(const V& residual, double huber_delta) {
  const V size = AbsLanes(residual);
  return {size <= huber_delta ? size * size : huber_delta * (2.0 * size - huber_delta),
          size <= huber_delta ? AllLanes<V>(1) : huber_delta / size};
}

// Returns e^x with a relative error of 1e-11, for x <= 700. If x is below -700 or NaN, the result is 1e-304.
template <class V>
HEBA_INLINE V ExpLanes(const V& x) {
  using Bits = typename LaneBits<V>::Type;
  const V least = AllLanes<V>(-700.0);
  const V bounded = x > least ? x : least;
  // Range reduction: x = k log 2 + r. After adding 3 * 2^51 to the integer k, it can be read from the low bits of the
  // double.
  constexpr double kLog2E = 1.4426950408889634;
  constexpr double kShift = 6755399441055744.0;
  constexpr double kLog2High = 0.693145751953125;
  constexpr double kLog2Low = 1.4286068203094173e-6;
  const V shifted = bounded * kLog2E + kShift;
  const V k = shifted - kShift;
  const V r = bounded - k * kLog2High - k * kLog2Low;
  // The Taylor polynomial of e^r, for |r| <= log(2) / 2.
  V power = AllLanes<V>(1.0 / 362880);
  power = power * r + 1.0 / 40320;
  power = power * r + 1.0 / 5040;
  power = power * r + 1.0 / 720;
  power = power * r + 1.0 / 120;
  power = power * r + 1.0 / 24;
  power = power * r + 1.0 / 6;
  power = power * r + 0.5;
  power = power * r + 1.0;
  power = power * r + 1.0;
  Bits exponent;
  Bits bits;
  std::memcpy(&exponent, &shifted, sizeof exponent);
  std::memcpy(&bits, &power, sizeof bits);
  bits += exponent << 52;
  V result;
  std::memcpy(&result, &bits, sizeof result);
  return result;
}

// The distribution function and the density of the standard normal distribution.
template <class V>
struct NormalLanes {
  V cdf;
  V density;
};

// Evaluates both to 1e-11, by Hart's rational function for the tail (Computer Approximations, 1968, no. 5666).
template <class V>
HEBA_INLINE NormalLanes<V> NormalOf(const V& x) {
  constexpr double kFarthest = 37;
  const V size = AbsLanes(x);
  const V far = AllLanes<V>(kFarthest);
  const V t = size < far ? size : far;
  const V weight = ExpLanes<V>(-0.5 * t * t);
  V top = 3.52624965998911e-2 * t + 0.700383064443688;
  top = top * t + 6.37396220353165;
  top = top * t + 33.912866078383;
  top = top * t + 112.079291497871;
  top = top * t + 221.213596169931;
  top = top * t + 220.206867912376;
  V bottom = 8.83883476483184e-2 * t + 1.75566716318264;
  bottom = bottom * t + 16.064177579207;
  bottom = bottom * t + 86.7807322029461;
  bottom = bottom * t + 296.564248779674;
  bottom = bottom * t + 637.333633378831;
  bottom = bottom * t + 793.826512519948;
  bottom = bottom * t + 440.413735824752;
  const V tail = weight * top / bottom;
  constexpr double kInverseRootOf2Pi = 0.39894228040143268;
  return {x > 0.0 ? 1.0 - tail : tail, kInverseRootOf2Pi * weight};
}

}  // namespace heba
