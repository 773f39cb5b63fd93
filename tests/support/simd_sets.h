// Runs tests with every instruction set of this processor.
#pragma once

#include <string>

#include <gtest/gtest.h>

#include "heba/kernels/simd.h"

namespace heba {

// Runs kernels with the instruction set of the test parameter; skipped if the processor does not support it.
class EverySimdTest : public testing::TestWithParam<Simd> {
 protected:
  void SetUp() override {
    LimitSimd(GetParam());
    if (ActiveSimd() != GetParam()) GTEST_SKIP() << "this processor does not have the instruction set";
  }
  void TearDown() override { LimitSimd(Simd::kAvx512); }
};

inline auto EverySimd() { return testing::Values(Simd::kBaseline, Simd::kAvx2, Simd::kAvx512); }
inline std::string SimdName(const testing::TestParamInfo<Simd>& tested) {
  return SelectForIsa(tested.param, "baseline", "avx2", "avx512");
}

}  // namespace heba
