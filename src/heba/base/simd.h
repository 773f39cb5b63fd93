// Arithmetic on several numbers at once, and the instruction sets that kernels are compiled for.
//
// A kernel is written once, as a template over its number of lanes, all of it HEBA_INLINE, and called from functions
// with a target attribute, one for each set (camera/batched_camera_model.h shows how). Which of them runs is decided
// when the program starts. Results of different sets differ by rounding.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstring>
#include <type_traits>

namespace heba {

// Kernels must be inlined into the function whose instruction set they are compiled for.
#define HEBA_INLINE [[gnu::always_inline]] inline

#if defined(__x86_64__)
#define HEBA_TARGET_AVX2 __attribute__((target("avx2,fma")))
#define HEBA_TARGET_AVX512 __attribute__((target("avx512f,avx512dq,avx512vl,avx512bw,avx2,fma")))
#else
// One set only: the compiler's own.
#define HEBA_TARGET_AVX2
#define HEBA_TARGET_AVX512
#endif

enum class Simd { kBaseline, kAvx2, kAvx512 };

// The best that this machine has, or less if the environment variable HEBA_SIMD says `baseline` or `avx2`: machines
// of several kinds give the same digits then.
Simd ActiveSimd();
// For benchmarks and tests: from now on at most `most`. Not while kernels run.
void LimitSimd(Simd most);

// One thing of three, by set.
template <class T>
constexpr T OfSet(Simd set, T baseline, T avx2, T avx512) {
  return set == Simd::kAvx512 ? avx512 : set == Simd::kAvx2 ? avx2 : baseline;
}

// Lanes of each set.
constexpr int NumLanes(Simd set) { return OfSet(set, 2, 4, 8); }
template <Simd kSet>
inline constexpr int kLanesOf = NumLanes(kSet);
inline constexpr int kMaxLanes = 8;

// The next multiple of the most lanes that kernels take at once: columns for them are that long.
template <class Size>
constexpr Size PaddedToLanes(Size size) {
  constexpr Size kMost = kMaxLanes;
  return (size + kMost - 1) / kMost * kMost;
}

template <int kLanes>
struct LanesType;
template <>
struct LanesType<2> {
  typedef double Type __attribute__((vector_size(16)));  // NOLINT(modernize-use-using): attributes need it.
};
template <>
struct LanesType<4> {
  typedef double Type __attribute__((vector_size(32)));  // NOLINT(modernize-use-using)
};
template <>
struct LanesType<8> {
  typedef double Type __attribute__((vector_size(64)));  // NOLINT(modernize-use-using)
};
template <int kLanes>
using Lanes = typename LanesType<kLanes>::Type;
// The other way round; 1 of a double.
template <class V>
inline constexpr int kLanesIn = static_cast<int>(sizeof(V) / sizeof(double));
template <>
inline constexpr int kLanesIn<double> = 1;

template <class V>
HEBA_INLINE V LoadLanes(const double* from) {
  V lanes;
  std::memcpy(&lanes, from, sizeof lanes);
  return lanes;
}
template <class V>
HEBA_INLINE void StoreLanes(const V& lanes, double* to) {
  std::memcpy(to, &lanes, sizeof lanes);
}
// All lanes the same.
template <class V>
HEBA_INLINE V AllLanes(double value) {
  return V{} + value;
}
template <class V>
HEBA_INLINE double SumOfLanes(const V& lanes) {
  if constexpr (std::is_same_v<V, double>) {
    return lanes;
  } else {
    double sum = 0;
    for (int i = 0; i < kLanesIn<V>; ++i) sum += lanes[i];
    return sum;
  }
}
// f of each lane (and of b's).
template <class V, class F>
HEBA_INLINE V EachLane(const V& a, const V& b, const F& f) {
  if constexpr (std::is_same_v<V, double>) {
    return f(a, b);
  } else {
    V result = a;
    for (int i = 0; i < kLanesIn<V>; ++i) result[i] = f(a[i], b[i]);
    return result;
  }
}

}  // namespace heba
