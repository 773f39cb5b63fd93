#include "heba/data/pose_stream.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/support/matchers.h"

namespace heba {
namespace {

// A smooth motion about all axes.
Rigid3d MotionAt(double time_s) {
  const Eigen::Vector3d turn(0.3 * std::sin(time_s), 0.5 * std::cos(1.3 * time_s), 0.4 * time_s);
  return {ExpRotation(turn), {0.2 * std::cos(time_s), 0.3 * std::sin(0.7 * time_s), 0.1 * time_s}};
}

// Rows every 20 ms or so.
PoseStream Stream() {
  PoseStream stream;
  for (int i = 0; i <= 100; ++i) {
    stream.times_s.push_back(0.02 * i + (i % 3 == 0 ? 0.003 : 0));
    stream.base_from_gripper.push_back(MotionAt(stream.times_s.back()));
  }
  return stream;
}

TEST(PoseStreamTest, InterpolatesToTheFourthOrder) {
  const PoseStream stream = Stream();
  for (double time_s = 0.05; time_s < 1.95; time_s += 0.0137) {
    // Lines between the rows would be off by 1e-5 m.
    EXPECT_THAT(PoseAt(stream, time_s), IsNearPose(MotionAt(time_s), 1e-6, 1e-6)) << time_s;
  }
  for (size_t i = 0; i < stream.times_s.size(); ++i) {
    EXPECT_THAT(PoseAt(stream, stream.times_s[i]), IsNearPose(stream.base_from_gripper[i], 1e-12, 1e-12));
  }
}

TEST(PoseStreamTest, VelocityIsThatOfTheGripperInItsFrame) {
  const PoseStream stream = Stream();
  for (const double time_s : {0.11, 0.5, 1.234}) {
    constexpr double kStepS = 1e-5;
    const Tangent6 expected = LocalCoordinates(MotionAt(time_s - kStepS), MotionAt(time_s + kStepS)) / (2 * kStepS);
    EXPECT_LT((VelocityAt(stream, time_s) - expected).norm(), 1e-3 * expected.norm()) << time_s;
  }
}

TEST(PoseStreamTest, TheRobotStandsBeforeAndAfter) {
  const PoseStream stream = Stream();
  EXPECT_FALSE(Covers(stream, -1));
  EXPECT_TRUE(Covers(stream, 1));
  EXPECT_THAT(PoseAt(stream, -1), IsNearPose(stream.base_from_gripper.front(), 1e-12, 1e-12));
  EXPECT_THAT(PoseAt(stream, 5), IsNearPose(stream.base_from_gripper.back(), 1e-12, 1e-12));
  EXPECT_EQ(VelocityAt(stream, 5).norm(), 0);
}

TEST(PoseStreamTest, TwoPosesAreALine) {
  const PoseStream stream{{0, 2}, {Rigid3d(), Rigid3d(Eigen::Quaterniond::Identity(), {1, 0, 0})}};
  EXPECT_NEAR(PoseAt(stream, 0.5).translation.x(), 0.25, 1e-12);
  EXPECT_NEAR(VelocityAt(stream, 0.5)(0), 0.5, 1e-9);
}

}  // namespace
}  // namespace heba
