// Arms with errors that no config names: the stated region of the camera's pose contains the true one.
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Dense>
#include <nlohmann/json.hpp>

#include "heba/base/distributions.h"
#include "heba/base/text.h"
#include "heba/geometry/rigid3.h"
#include "tests/pipeline/cli.h"

namespace heba {
namespace {

namespace fs = std::filesystem;

using Json = nlohmann::json;

Rigid3d PoseOf(const Json& json) {
  Rigid3d pose;
  for (int i = 0; i < 3; ++i) pose.translation[i] = json["translation_m"][static_cast<size_t>(i)];
  for (int i = 0; i < 4; ++i) pose.rotation.coeffs()[i] = json["quaternion_xyzw"][static_cast<size_t>(i)];
  return pose;
}

// Returns the probability of so large an error of the camera's pose, by the stated covariance.
double PValueOf(const std::string& scene, int seed) {
  const fs::path folder = TestFolder("unknown_arm_" + scene + std::to_string(seed));
  const std::string cell = (folder / "cell").string();
  EXPECT_EQ(RunHeba({"simulate", std::string(HEBA_SOURCE_DIR) + "/configs/arm/" + scene + ".yaml", "--set",
                     "seed=" + std::to_string(seed), "--out", cell, "--quiet"})
                .status,
            0);
  const std::string config = ReadAll(folder / "cell/config.yaml");
  WriteAll(folder / "cell/unnamed.yaml", config.substr(0, config.find("robot:")) + "robot: {scale_sigma: 0}\n");
  EXPECT_EQ(RunHeba({"run", cell + "/unnamed.yaml", "--set", "evaluate.folds=0", "--out", (folder / "run").string(),
                     "--quiet"})
                .status,
            0);
  const Json result = Json::parse(ReadAll(folder / "run/result.json"));
  const Json truth = Json::parse(ReadAll(folder / "cell/truth.json"));
  for (const Json& estimate : result["estimates"]) {
    if (estimate["method"] != "bundle") continue;
    const Tangent6 error = LocalCoordinates(PoseOf(estimate["hand_eye"]), PoseOf(truth["hand_eye"]));
    Eigen::Matrix<double, 6, 6> covariance;
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) {
        covariance(i, j) = estimate["covariance"]["matrix"][static_cast<size_t>(i)][static_cast<size_t>(j)];
      }
    }
    const double square = error.dot(covariance.ldlt().solve(error));
    return FisherTail(square / 6, 6, 40);
  }
  return 0;
}

TEST(UnknownArmTest, RegionHolds) { EXPECT_GT(PValueOf("scene", 1), 0.01); }

class UnknownArmNightly : public testing::TestWithParam<std::string> {};

TEST_P(UnknownArmNightly, RegionsHold) {
  constexpr int kNumSeeds = 4;
  for (int seed = 1; seed <= kNumSeeds; ++seed) EXPECT_GT(PValueOf(GetParam(), seed), 0.01) << seed;
}

INSTANTIATE_TEST_SUITE_P(Setups, UnknownArmNightly, testing::Values("scene", "eye_to_hand"),
                         [](const auto& test) { return test.param; });

}  // namespace
}  // namespace heba
