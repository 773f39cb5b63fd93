#include "heba/kernels/simd.h"

#include <algorithm>
#include <cstdlib>
#include <string_view>

#include "heba/base/registry.h"

namespace heba {
namespace {

Simd BestOfMachine() {
#if defined(__x86_64__)
  __builtin_cpu_init();
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma")) return Simd::kBaseline;
  const bool has_avx512 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
                          __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw");
  return has_avx512 ? Simd::kAvx512 : Simd::kAvx2;
#else
  return Simd::kBaseline;
#endif
}

Simd AskedFor() {
  const char* const asked = std::getenv("HEBA_SIMD");
  const std::string_view name = asked == nullptr ? "" : asked;
  return name == "baseline" ? Simd::kBaseline : name == "avx2" ? Simd::kAvx2 : Simd::kAvx512;
}

Simd& Active() {
  static Simd active = std::min(BestOfMachine(), AskedFor());
  return active;
}

}  // namespace

std::string FaultOfSimdSetting() {
  const char* const asked = std::getenv("HEBA_SIMD");
  const std::string_view name = asked == nullptr ? "" : asked;
  if (name.empty() || name == "baseline" || name == "avx2" || name == "avx512") return "";
  return "HEBA_SIMD: " + UnknownName(name, {"baseline", "avx2", "avx512"});
}

Simd ActiveSimd() { return Active(); }
void LimitSimd(Simd most) { Active() = std::min(BestOfMachine(), most); }

}  // namespace heba
