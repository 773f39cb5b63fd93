// SIMD arithmetic and the instruction sets that kernels are compiled for.
//
// A kernel is written once, as a template over its number of lanes. All of it is HEBA_INLINE, and it is called from one
// function with a target attribute for each instruction set (camera/batched_camera_model.h shows how). Which of these
// functions runs is decided when the program starts. The results of different instruction sets differ by rounding.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstring>
#include <string>
#include <type_traits>

namespace heba {

// Kernels must be inlined into the function whose instruction set they are compiled for.
#define HEBA_INLINE [[gnu::always_inline]] inline

#if defined(__x86_64__)
#define HEBA_TARGET_AVX2 __attribute__((target("avx2,fma")))
#define HEBA_TARGET_AVX512 __attribute__((target("avx512f,avx512dq,avx512vl,avx512bw,avx2,fma")))
#else
// Only the compiler's own instruction set is used on other processors.
#define HEBA_TARGET_AVX2
#define HEBA_TARGET_AVX512
#endif

enum class Simd { kBaseline, kAvx2, kAvx512 };

// Returns the best instruction set of this machine, or a lesser one if the environment variable HEBA_SIMD is `baseline`
// or `avx2`. The variable makes machines of different kinds produce identical digits.
Simd ActiveSimd();
// Returns what is wrong with the value of HEBA_SIMD, or an empty string if it is valid.
std::string FaultOfSimdSetting();
// Limits the instruction set to `most` from now on, for benchmarks and tests. It must not be called while kernels run.
void LimitSimd(Simd most);

// Selects one of three values by the instruction set.
template <class T>
constexpr T SelectForIsa(Simd set, T baseline, T avx2, T avx512) {
  return set == Simd::kAvx512 ? avx512 : set == Simd::kAvx2 ? avx2 : baseline;
}

// Number of lanes of each instruction set.
constexpr int NumLanes(Simd set) { return SelectForIsa(set, 2, 4, 8); }
template <Simd kSet>
inline constexpr int kLanesOf = NumLanes(kSet);
inline constexpr int kMaxLanes = 8;

// Rounds `size` up to a multiple of the largest number of lanes. Arrays that kernels read have this length.
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
// Number of lanes of a vector type; 1 for double.
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
// Returns a vector with `value` in every lane.
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
// Computes the horizontal sums of kLanes vectors and returns them as one vector.
template <int kLanes>
HEBA_INLINE Lanes<kLanes> SumsOfLanes(const Lanes<kLanes> (&of)[kLanes]);
template <>
HEBA_INLINE Lanes<2> SumsOfLanes<2>(const Lanes<2> (&of)[2]) {
  return __builtin_shufflevector(of[0], of[1], 0, 2) + __builtin_shufflevector(of[0], of[1], 1, 3);
}
template <>
HEBA_INLINE Lanes<4> SumsOfLanes<4>(const Lanes<4> (&of)[4]) {
  // Adds neighbouring lanes; the sums of `a` and `b` alternate in the result.
  const auto pairs = [](const Lanes<4>& a, const Lanes<4>& b) __attribute__((always_inline)) {
    return __builtin_shufflevector(a, b, 0, 4, 2, 6) + __builtin_shufflevector(a, b, 1, 5, 3, 7);
  };
  const Lanes<4> a = pairs(of[0], of[1]);
  const Lanes<4> b = pairs(of[2], of[3]);
  return __builtin_shufflevector(a, b, 0, 1, 4, 5) + __builtin_shufflevector(a, b, 2, 3, 6, 7);
}
template <>
HEBA_INLINE Lanes<8> SumsOfLanes<8>(const Lanes<8> (&of)[8]) {
  const auto pairs = [](const Lanes<8>& a, const Lanes<8>& b) __attribute__((always_inline)) {
    return __builtin_shufflevector(a, b, 0, 8, 2, 10, 4, 12, 6, 14) +
           __builtin_shufflevector(a, b, 1, 9, 3, 11, 5, 13, 7, 15);
  };
  const auto fours = [&](int i) __attribute__((always_inline)) {
    const Lanes<8> a = pairs(of[i], of[i + 1]);
    const Lanes<8> b = pairs(of[i + 2], of[i + 3]);
    return __builtin_shufflevector(a, b, 0, 1, 8, 9, 4, 5, 12, 13) +
           __builtin_shufflevector(a, b, 2, 3, 10, 11, 6, 7, 14, 15);
  };
  const Lanes<8> a = fours(0);
  const Lanes<8> b = fours(4);
  return __builtin_shufflevector(a, b, 0, 1, 2, 3, 8, 9, 10, 11) +
         __builtin_shufflevector(a, b, 4, 5, 6, 7, 12, 13, 14, 15);
}
// Applies `f` to each pair of corresponding lanes of `a` and `b`.
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
