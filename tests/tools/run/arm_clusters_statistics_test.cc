// How often a run leaves out right captures of an arm in three configurations, of which one is rare: heba/run.h.
#include <algorithm>
#include <atomic>
#include <string>
#include <thread>
#include <tuple>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/parallel.h"
#include "heba/run.h"
#include "tests/support/datasets.h"

namespace heba {
namespace {

// The arm, and the factor on the errors of usual arms.
using ArmAndErrors = std::tuple<std::string, double>;

class ArmClustersStatisticsTest : public testing::TestWithParam<ArmAndErrors> {};

TEST_P(ArmClustersStatisticsTest, RareConfigurationIsLeftOutInLessThanTwoOfAHundred) {
  const auto& [arm, factor] = GetParam();
  ArmSceneOptions scene;
  scene.arm = arm;
  scene.setup = Setup::kEyeInHand;
  scene.offset_rad *= factor;
  scene.length_m *= factor;
  scene.angle_rad *= factor;
  constexpr int kNumSeeds = 100;
  std::atomic<int> num_with_loss = 0;
  ParallelFor(kNumSeeds, static_cast<int>(std::thread::hardware_concurrency()), [&](int i) {
    const ArmDataset made = ThreeConfigurations(static_cast<uint64_t>(i + 1), scene, 40, 4);
    const Outcome<RunOutput> run = heba::Run(WithFixedCamera(made.dataset), WithoutFolds());
    EXPECT_TRUE(run) << run.reason();
    if (!run) return;
    const std::vector<std::string> left_out = LeftOutOf(run->result);
    const bool loses_rare = std::any_of(left_out.begin(), left_out.end(), [&](const std::string& name) {
      const auto capture = std::find_if(made.dataset.captures.begin(), made.dataset.captures.end(),
                                        [&](const Recording& other) { return other.name == name; });
      const auto place = static_cast<size_t>(capture - made.dataset.captures.begin());
      return made.configuration[place] == made.configuration.back();
    });
    if (loses_rare) ++num_with_loss;
  });
  EXPECT_LE(num_with_loss.load(), 2);
}

// The simulated captures of an arm of seven joints are in one configuration.
INSTANTIATE_TEST_SUITE_P(Arms, ArmClustersStatisticsTest,
                         testing::Combine(testing::Values("ur5e", "kuka_kr6_r900"), testing::Values(1.0, 3.0)));

}  // namespace
}  // namespace heba
