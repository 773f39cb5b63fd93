#include "tools/config/robot_noise_config.h"

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "tools/run/captures.h"

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

RunOptions WithRobotErrors(RunOptions options, MapReader& refine, const Dataset& data) {
  AdjustmentOptions& adjustment = options.calibration.adjustment;
  SmoothPoseErrors& smooth = options.calibration.smooth;
  const std::optional<ConfigValue> value = refine.Find("robot_noise");
  if (!value || value->IsText()) {
    const std::string name = value ? value->AsChoice({"auto", "none", "exact", "white", "smooth"}) : "auto";
    const bool is_exact = name == "none" || name == "exact";
    adjustment.robot = is_exact ? BundleOptions::Robot::kExact : BundleOptions::Robot::kEstimatedNoise;
    smooth = name == "auto"     ? SmoothPoseErrors::kAuto
             : name == "smooth" ? SmoothPoseErrors::kAlways
                                : SmoothPoseErrors::kNone;
    refine.Record("robot_noise", YAML::Node(name));
    return options;
  }
  MapReader reader(*value);
  smooth = SmoothPoseErrors::kNone;
  if (reader.Has("joints")) {
    if (!IsSinglePair(data)) value->Fail("the noise of joints is that of the only arm, with one camera and one target");
    if (data.arms.empty() || !data.arms.front()) value->Fail("the noise of joints needs an arm (robot.model)");
    reader.Choice("joints", {"auto"});
    reader.Finish();
    options.joint_noise = true;
    adjustment.robot = BundleOptions::Robot::kEstimatedNoise;
  } else if (reader.Has("translation") || reader.Has("rotation")) {
    adjustment.robot = BundleOptions::Robot::kGivenNoise;
    adjustment.robot_noise = ReadRobotNoise(reader);
  } else {
    value->Fail("must be one of: auto, none, white, smooth, {translation: ..., rotation: ...}, {joints: auto}");
  }
  refine.Record("robot_noise", reader.used());
  return options;
}

}  // namespace heba
