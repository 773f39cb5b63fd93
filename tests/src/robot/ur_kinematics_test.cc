#include "heba/robot/ur_kinematics.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/rng.h"
#include "heba/base/units.h"

namespace heba {
namespace {

JointAngles RandomJoints(Rng& rng) {
  JointAngles joints;
  for (double& joint : joints) joint = rng.Uniform(-kPi, kPi);
  return joints;
}

double Distance(const JointAngles& a, const JointAngles& b) {
  double distance = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    distance = std::max(distance, std::abs(std::remainder(a[i] - b[i], 2 * kPi)));
  }
  return distance;
}

// The expected positions were computed by hand from the manufacturer's table: the arm stretched out along -x, and
// upright.
TEST(UrKinematicsTest, FlangePoseMatchesTheTable) {
  const UrRobot& ur5e = *FindUrRobot("ur5e");
  const Rigid3d stretched = BaseFromFlange(ur5e, {0, 0, 0, 0, 0, 0});
  EXPECT_LT((stretched.translation - Eigen::Vector3d(-0.8172, -0.2329, 0.0628)).norm(), 1e-12);
  const Rigid3d upright = BaseFromFlange(ur5e, {0, -kPi / 2, 0, -kPi / 2, 0, 0});
  EXPECT_LT((upright.translation - Eigen::Vector3d(0, -0.2329, 1.0794)).norm(), 1e-12);
}

class UrRobotTest : public testing::TestWithParam<UrRobot> {};
INSTANTIATE_TEST_SUITE_P(, UrRobotTest, testing::ValuesIn(UrRobots()),
                         [](const auto& test) { return test.param.name; });

TEST_P(UrRobotTest, PosturesReachThePoseAndIncludeTheOriginal) {
  Rng rng(17);
  int num_postures = 0;
  constexpr int kPoses = 10'000;
  for (int i = 0; i < kPoses; ++i) {
    const JointAngles joints = RandomJoints(rng);
    const Rigid3d pose = BaseFromFlange(GetParam(), joints);
    const Outcome<std::vector<JointAngles>> postures = PosturesOf(GetParam(), pose);
    ASSERT_TRUE(postures.ok()) << postures.reason();
    double nearest = 10;
    for (const JointAngles& posture : *postures) {
      const Rigid3d reached = BaseFromFlange(GetParam(), posture);
      ASSERT_LT(LocalCoordinates(pose, reached).norm(), 1e-9) << i;
      nearest = std::min(nearest, Distance(joints, posture));
    }
    // Near a singularity a large rotation of a joint moves the flange only little.
    ASSERT_LT(nearest, 1e-4) << i;
    ASSERT_LE(postures->size(), 8U);
    num_postures += static_cast<int>(postures->size());
  }
  // Most poses have four or eight postures.
  EXPECT_GT(num_postures, 4 * kPoses);
}

TEST_P(UrRobotTest, SingularPosturesReachThePose) {
  const UrRobot& robot = GetParam();
  for (const JointAngles& joints : {JointAngles{0.3, -1.1, 0.9, 0.4, 0, 0.7}, {0.3, -1.1, 0, 0.4, 1.2, 0.7}}) {
    const Rigid3d pose = BaseFromFlange(robot, joints);
    const Outcome<std::vector<JointAngles>> postures = PosturesOf(robot, pose);
    ASSERT_TRUE(postures.ok()) << postures.reason();
    for (const JointAngles& posture : *postures) {
      EXPECT_LT(LocalCoordinates(pose, BaseFromFlange(robot, posture)).norm(), 1e-9);
    }
  }
}

TEST_P(UrRobotTest, ExplainsUnreachablePoses) {
  const UrRobot& robot = GetParam();
  const Eigen::Quaterniond down(0, 1, 0, 0);
  const double reach_m = std::abs(robot.a2_m) + std::abs(robot.a3_m) + robot.d5_m;
  EXPECT_THAT(PosturesOf(robot, {down, Eigen::Vector3d(reach_m + 1, 0, 0)}).reason(), testing::HasSubstr("too far by"));
  EXPECT_THAT(PosturesOf(robot, {down, Eigen::Vector3d(0.5 * robot.d4_m, 0, 0.3)}).reason(),
              testing::HasSubstr("from the axis of the base"));
}

}  // namespace
}  // namespace heba
