#include "tools/config/robot_noise_config.h"

#include "heba/base/text.h"
#include "heba/base/units.h"

namespace heba {
namespace {

void CheckRange(MapReader& reader, const char* key, double value, double unit, const char* name, double most) {
  constexpr double kLeast = 1e-6;
  if (value < 0) reader.Get(key).Fail("must not be negative");
  if (value > most * unit) reader.Get(key).Fail("must be at most " + RoundTrip(most) + " " + name);
  if (value > 0 && value < kLeast * unit) {
    reader.Get(key).Fail("must be 0 or at least " + Significant(kLeast, 1) + " " + name);
  }
}

}  // namespace

RobotNoise ReadRobotNoise(MapReader& reader, std::optional<double> fallback) {
  const RobotNoise noise{reader.Length("translation", fallback), reader.Angle("rotation", fallback)};
  constexpr double kMostMm = 100;
  constexpr double kMostDeg = 10;
  CheckRange(reader, "translation", noise.translation_m, 1e-3, "mm", kMostMm);
  CheckRange(reader, "rotation", noise.rotation_rad, DegToRad(1), "deg", kMostDeg);
  reader.Finish();
  return noise;
}

}  // namespace heba
