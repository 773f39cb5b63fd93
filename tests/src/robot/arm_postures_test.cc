#include "heba/robot/arm_postures.h"

#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/rng.h"
#include "heba/base/units.h"
#include "heba/robot/arm_table.h"
#include "heba/robot/ur_kinematics.h"
#include "tests/support/arm_joints.h"

namespace heba {
namespace {

double Distance(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  double distance = 0;
  for (Eigen::Index j = 0; j < a.size(); ++j) {
    distance = std::max(distance, std::abs(std::remainder(a[j] - b[j], 2 * kPi)));
  }
  return distance;
}

std::vector<std::string> SixJointArms() {
  std::vector<std::string> arms;
  for (const Arm& arm : Arms()) {
    if (arm.num_joints() == 6) arms.push_back(arm.name);
  }
  return arms;
}

class SixJointArmTest : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(, SixJointArmTest, testing::ValuesIn(SixJointArms()),
                         [](const auto& test) { return test.param; });

TEST_P(SixJointArmTest, ReachThePoseInDifferentConfigurations) {
  Rng rng(6);
  const Arm& arm = *FindArm(GetParam());
  constexpr int kPoses = 20;
  int num_without_original = 0;
  for (int i = 0; i < kPoses; ++i) {
    const Eigen::VectorXd joints = RandomJoints(arm, rng);
    const Rigid3d pose = BaseFromTip(arm, joints);
    const auto postures = PosturesOf(arm, pose);
    ASSERT_TRUE(postures.ok()) << postures.reason();
    double nearest = 10;
    for (const Eigen::VectorXd& posture : *postures) {
      EXPECT_LT(LocalCoordinates(pose, BaseFromTip(arm, posture)).norm(), 1e-9);
      nearest = std::min(nearest, Distance(joints, posture));
    }
    num_without_original += nearest > 1e-4;
    // An arm with an offset wrist reaches a pose in up to 16 postures, which three signs cannot name.
    if (arm.name == "xarm6") continue;
    std::set<Configuration> configurations;
    for (const Eigen::VectorXd& posture : *postures) configurations.insert(*ConfigurationOf(arm, posture));
    EXPECT_EQ(configurations.size(), postures->size());
  }
  EXPECT_EQ(num_without_original, 0);
}

class UrPosturesTest : public testing::TestWithParam<UrRobot> {};
INSTANTIATE_TEST_SUITE_P(, UrPosturesTest, testing::ValuesIn(UrRobots()),
                         [](const auto& test) { return test.param.name; });

TEST_P(UrPosturesTest, AreThoseOfTheClosedForm) {
  Rng rng(7);
  // An arm that is not quite of Universal Robots' form, so that its postures are found numerically.
  Arm arm = *FindArm(GetParam().name);
  arm.joints[1].d_m = 1e-12;
  int num_missed = 0;
  for (int i = 0; i < 30; ++i) {
    const Rigid3d pose = BaseFromTip(arm, RandomJoints(arm, rng));
    const auto numeric = PosturesOf(arm, pose);
    const auto closed = PosturesOf(GetParam(), pose);
    ASSERT_TRUE(numeric.ok());
    ASSERT_TRUE(closed.ok());
    EXPECT_LE(numeric->size(), closed->size());
    EXPECT_EQ(PosturesOf(*FindArm(GetParam().name), pose)->size(), closed->size());
    num_missed += static_cast<int>(closed->size() - numeric->size());
  }
  EXPECT_EQ(num_missed, 0);
}

class LimitsTest : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(, LimitsTest, testing::ValuesIn(ArmNames()), [](const auto& test) { return test.param; });

TEST_P(LimitsTest, PosturesAreMovedByWholeTurnsAndNotBeyondTheLimits) {
  const Arm& arm = *FindArm(GetParam());
  Rng rng(8);
  if (arm.limits.empty()) {
    const Eigen::VectorXd any = RandomJoints(arm, rng);
    EXPECT_EQ(WithinLimits(arm, any), any);
    return;
  }
  Eigen::VectorXd joints(arm.num_joints());
  for (Eigen::Index j = 0; j < joints.size(); ++j) {
    const JointLimits& limits = arm.limits[static_cast<size_t>(j)];
    joints[j] = rng.Uniform(limits.low, limits.high);
  }
  EXPECT_EQ(WithinLimits(arm, joints), joints);
  for (Eigen::Index j = 0; j < joints.size(); ++j) {
    const JointLimits& limits = arm.limits[static_cast<size_t>(j)];
    SCOPED_TRACE(j);
    Eigen::VectorXd turned = joints;
    turned[j] += 6 * kPi;
    const std::optional<Eigen::VectorXd> found = WithinLimits(arm, turned);
    ASSERT_TRUE(found.has_value());
    EXPECT_LT(Distance(*found, joints), 1e-9);
    EXPECT_LE((*found)[j], limits.high);
    EXPECT_GE((*found)[j], limits.low);
    if (limits.high - limits.low >= 2 * kPi) continue;
    turned[j] = limits.high + 0.5 * (2 * kPi - (limits.high - limits.low));
    EXPECT_FALSE(WithinLimits(arm, turned).has_value());
  }
}

TEST(ArmPosturesTest, JointsWithLimitsDoNotTurnPastThem) {
  Arm arm = *FindArm("kuka_kr6_r900");
  ASSERT_LT(arm.limits[0].high, kPi);
  const Eigen::VectorXd a = Eigen::VectorXd::Unit(arm.num_joints(), 0) * DegToRad(165);
  EXPECT_NEAR(PostureDistance(arm, a, -a), DegToRad(330), 1e-12);
  arm.limits.clear();
  EXPECT_NEAR(PostureDistance(arm, a, -a), DegToRad(30), 1e-12);
}

TEST(ArmPosturesTest, RedundantArmsNeedAStart) {
  const Arm& arm = *FindArm("franka_fr3");
  Eigen::VectorXd joints(7);
  joints << 0.1, -0.7, 0.2, -2.3, 0.1, 1.6, 0.8;
  const Rigid3d pose = BaseFromTip(arm, joints);
  EXPECT_THAT(PosturesOf(arm, pose).reason(), testing::HasSubstr("7 joints"));
  const auto found = PostureNear(arm, pose, joints + Eigen::VectorXd::Constant(7, 0.05));
  ASSERT_TRUE(found.ok()) << found.reason();
  EXPECT_LT(LocalCoordinates(pose, BaseFromTip(arm, *found)).norm(), 1e-9);
  EXPECT_LT(Distance(joints, *found), 0.1);
}

TEST(ArmPosturesTest, PosturesWithinLimitsReachThePose) {
  Rng rng(7);
  for (const char* const name : {"kuka_kr6_r900", "kuka_iiwa14"}) {
    const Arm& arm = *FindArm(name);
    for (int trial = 0; trial < 10; ++trial) {
      Eigen::VectorXd joints(arm.num_joints());
      for (int j = 0; j < arm.num_joints(); ++j) {
        const JointLimits& limits = arm.limits[static_cast<size_t>(j)];
        joints[j] = rng.Uniform(limits.low, limits.high);
      }
      const Rigid3d pose = BaseFromTip(arm, joints);
      const auto found = PosturesWithinLimits(arm, pose);
      ASSERT_TRUE(found.ok()) << name << ": " << found.reason();
      EXPECT_TRUE(arm.num_joints() == 6 || found->size() == 1);
      for (const Eigen::VectorXd& posture : *found) {
        EXPECT_LT(LocalCoordinates(pose, BaseFromTip(arm, posture)).norm(), 1e-6) << name;
        EXPECT_EQ(WithinLimits(arm, posture), posture) << name;
      }
    }
  }
}

// The joints of an arm that turn without limits are wrapped, however far the search turned them.
TEST(ArmPosturesTest, PosturesOfArmsWithoutLimitsAreWrapped) {
  Arm arm = *FindArm("kuka_iiwa14");
  arm.limits.clear();
  Rng rng(8);
  for (int trial = 0; trial < 30; ++trial) {
    const Rigid3d pose = BaseFromTip(arm, Eigen::VectorXd::NullaryExpr(7, [&] { return rng.Uniform(-kPi, kPi); }));
    const auto found = PosturesWithinLimits(arm, pose);
    if (found) EXPECT_LE(found->front().cwiseAbs().maxCoeff(), kPi + 1e-12);
  }
}

TEST(ArmPosturesTest, PosesThatOnlyPosturesBeyondTheLimitsReachAreRefused) {
  for (const char* const name : {"ur5e", "kuka_iiwa14"}) {
    Arm arm = *FindArm(name);
    const Eigen::VectorXd joints = Eigen::VectorXd::Constant(arm.num_joints(), 0.5);
    arm.limits.assign(arm.joints.size(), JointLimits{3, 3.01});
    EXPECT_THAT(PosturesWithinLimits(arm, BaseFromTip(arm, joints)).reason(), testing::HasSubstr("within the limits"));
  }
}

TEST(ArmPosturesTest, PosesOutOfReachAreRefusedWithTheDistance) {
  const Arm& arm = *FindArm("ur5e");
  const auto postures = PosturesOf(arm, Rigid3d(Eigen::Quaterniond::Identity(), {3, 0, 0}));
  EXPECT_THAT(postures.reason(), testing::HasSubstr("out of reach"));
}

TEST(ArmPosturesTest, SingularitiesNameTheirJoints) {
  const Arm& arm = *FindArm("ur5e");
  Eigen::VectorXd joints(6);
  joints << 0.3, -1.2, 1.4, -1.1, 0, 0.5;
  EXPECT_THAT(SingularityAt(arm, joints), testing::HasSubstr("6"));
  joints[4] = 1.2;
  EXPECT_EQ(SingularityAt(arm, joints), "");
  joints[2] = 0;  // The arm is stretched.
  EXPECT_THAT(SingularityAt(arm, joints), testing::HasSubstr("3"));
}

TEST(ArmPosturesTest, RedundantArmsAreSingularIfTheTipCannotMoveInSomeDirection) {
  const Arm& arm = *FindArm("kuka_iiwa7");
  Eigen::VectorXd joints(7);
  joints << 0.1, -0.7, 0.2, -1.3, 0.1, 0.9, 0.8;
  EXPECT_EQ(SingularityAt(arm, joints), "");
  joints.setZero();  // The arm is stretched.
  EXPECT_THAT(SingularityAt(arm, joints), testing::HasSubstr("cannot move"));
}

TEST(ArmPosturesTest, FlipsChangeOneSignOfTheConfiguration) {
  const Arm& arm = *FindArm("abb_irb120");
  Eigen::VectorXd joints(6);
  joints << 0.3, 0.2, 0.1, 0.4, 0.9, 0.5;
  const Configuration before = *ConfigurationOf(arm, joints);
  joints[4] = -0.9;
  Configuration wrist = before;
  wrist[2] = !wrist[2];
  EXPECT_EQ(*ConfigurationOf(arm, joints), wrist);
  EXPECT_EQ(ConfigurationOf(*FindArm("xarm6"), joints), std::nullopt);
  EXPECT_EQ(ConfigurationOf(*FindArm("franka_fr3"), Eigen::VectorXd::Zero(7)), std::nullopt);
}

}  // namespace
}  // namespace heba
