#include "heba/tool_tip.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "heba/base/distributions.h"
#include "heba/base/factorisation.h"

namespace heba {
namespace {

const Eigen::Vector3d kTip(0.01, -0.02, 0.15);
const Eigen::Vector3d kPoint(0.4, 0.1, 0.05);

// Returns poses at which the tip is at the point up to noise, turned by up to `angle_rad` about random axes, or about
// z.
std::vector<Rigid3d> Touches(int number, double angle_rad, double noise_m, bool about_z, uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<Rigid3d> poses;
  for (int i = 0; i < number; ++i) {
    Eigen::Vector3d axis{normal(random), normal(random), normal(random)};
    if (about_z) axis = Eigen::Vector3d::UnitZ();
    const Eigen::Quaterniond rotation = ExpRotation(angle_rad * normal(random) * axis.normalized());
    const Eigen::Vector3d noise{normal(random), normal(random), normal(random)};
    poses.emplace_back(rotation, kPoint - rotation * kTip + noise_m * noise);
  }
  return poses;
}

TEST(ToolTipTest, IsExactWithoutNoise) {
  const Outcome<ToolTip> tip = FindToolTip(Touches(4, 0.5, 0, false, 1));
  ASSERT_TRUE(tip.ok());
  EXPECT_LT((tip->in_gripper_m - kTip).norm(), 1e-12);
  EXPECT_LT((tip->touched_in_base_m - kPoint).norm(), 1e-12);
}

TEST(ToolTipTest, RegionsHoldTheTruth) {
  constexpr int kNumTrials = 400;
  int num_covered = 0;
  for (int trial = 0; trial < kNumTrials; ++trial) {
    const Outcome<ToolTip> tip = FindToolTip(Touches(8, 0.4, 2e-4, false, static_cast<uint64_t>(trial)));
    ASSERT_TRUE(tip.ok());
    const Eigen::Vector3d error = tip->in_gripper_m - kTip;
    num_covered += FisherTail(MahalanobisSquare(error, tip->covariance_m2) / 3, 3, tip->dof) > 0.05 ? 1 : 0;
  }
  EXPECT_GE(num_covered, 368);
  EXPECT_LE(num_covered, 392);
}

TEST(ToolTipTest, NamesTheAxisThatTurnsLeaveOpen) {
  const Outcome<ToolTip> tip = FindToolTip(Touches(6, 0.5, 1e-4, true, 2));
  ASSERT_FALSE(tip.ok());
  EXPECT_EQ(tip.failure().code, "one_touch_axis");
  EXPECT_EQ(FindToolTip(Touches(2, 0.5, 0, false, 3)).failure().code, "few_touches");
}

}  // namespace
}  // namespace heba
