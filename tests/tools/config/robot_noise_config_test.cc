#include "tools/config/robot_noise_config.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/units.h"
#include "tests/support/input_error.h"

namespace heba {
namespace {
using ::testing::HasSubstr;
using ::testing::StartsWith;

RobotNoise Read(const std::string& yaml, std::optional<double> fallback = std::nullopt) {
  MapReader reader(ParseYaml(yaml, "cell.yaml"));
  return ReadRobotNoise(reader, fallback);
}

TEST(RobotNoiseConfigTest, ReadsSigmasInMetresAndRadians) {
  const RobotNoise noise = Read("{translation: 0.2 mm, rotation: 0.05 deg}");
  EXPECT_DOUBLE_EQ(noise.translation_m, 0.2e-3);
  EXPECT_DOUBLE_EQ(noise.rotation_rad, DegToRad(0.05));
}

TEST(RobotNoiseConfigTest, AcceptsTheLimitsThemselves) {
  EXPECT_DOUBLE_EQ(Read("{translation: 100 mm, rotation: 10 deg}").translation_m, 0.1);
  const RobotNoise exact = Read("{translation: 0 mm, rotation: 0 deg}");
  EXPECT_EQ(exact.translation_m, 0);
  EXPECT_EQ(exact.rotation_rad, 0);
}

TEST(RobotNoiseConfigTest, RequiresBothKeysWithoutAFallback) {
  EXPECT_THAT(InputErrorOf([] { Read("{translation: 0.2 mm}"); }), HasSubstr("cell.yaml:1: 'rotation' is missing"));
  EXPECT_THAT(InputErrorOf([] { Read("{rotation: 0.2 deg}"); }), HasSubstr("cell.yaml:1: 'translation' is missing"));
}

TEST(RobotNoiseConfigTest, FillsInTheFallback) {
  const RobotNoise noise = Read("{rotation: 0.1 deg}", 0.0);
  EXPECT_EQ(noise.translation_m, 0);
  EXPECT_DOUBLE_EQ(noise.rotation_rad, DegToRad(0.1));
}

TEST(RobotNoiseConfigTest, RecordsBothSigmasAsUsed) {
  MapReader reader(ParseYaml("{rotation: 0.1 rad}", "cell.yaml"));
  ReadRobotNoise(reader, 0.0);
  EXPECT_EQ(reader.used()["translation"].as<std::string>(), "0 m");
  EXPECT_EQ(reader.used()["rotation"].as<std::string>(), "0.1 rad");
}

TEST(RobotNoiseConfigTest, RefusesUnknownKeys) {
  EXPECT_THAT(InputErrorOf([] { Read("{translation: 0.2 mm, rotation: 0.1 deg, rotaton: 0.1 deg}"); }),
              HasSubstr("cell.yaml:1: unknown key 'rotaton'; did you mean 'rotation'?"));
}

struct WrongNoise {
  std::string name;
  std::string translation;
  std::string rotation;
  std::string message;
};

class WrongNoiseTest : public testing::TestWithParam<WrongNoise> {};

TEST_P(WrongNoiseTest, IsRefusedWithItsKey) {
  const WrongNoise& wrong = GetParam();
  EXPECT_THAT(InputErrorOf([&] { Read("{translation: " + wrong.translation + ", rotation: " + wrong.rotation + "}"); }),
              StartsWith("cell.yaml:1: " + wrong.message));
}

INSTANTIATE_TEST_SUITE_P(
    , WrongNoiseTest,
    testing::Values(WrongNoise{"NegativeTranslation", "-1 mm", "0 deg", "translation: must not be negative"},
                    WrongNoise{"NegativeRotation", "0 mm", "-1 deg", "rotation: must not be negative"},
                    WrongNoise{"LargeTranslation", "100.1 mm", "0 deg", "translation: must be at most 100 mm"},
                    WrongNoise{"LargeRotation", "0 mm", "10.1 deg", "rotation: must be at most 10 deg"},
                    WrongNoise{"TinyTranslation", "1e-7 mm", "0 deg", "translation: must be 0 or at least 0.000001 mm"},
                    WrongNoise{"TinyRotation", "0 mm", "1e-7 deg", "rotation: must be 0 or at least 0.000001 deg"},
                    WrongNoise{"NoUnit", "0.1", "0 deg",
                               "translation: '0.1' has no unit; write a length such as '40 mm'"},
                    WrongNoise{"UnitOfAnotherQuantity", "0 mm", "1 mm",
                               "rotation: '1 mm' has the unit 'mm'; one of rad, mrad, deg is needed"}),
    [](const auto& wrong) { return wrong.param.name; });

}  // namespace
}  // namespace heba
