#include "solvers/closed_form/motion_sums.h"

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "heba/base/units.h"
#include "tests/support/scenes.h"
#include "tests/support/simd_sets.h"

namespace heba {
namespace {

// The terms of one motion in the order of MotionSums, computed one motion at a time.
struct Numbers {
  Eigen::Matrix<double, MotionSums::kNumLinear, 1> linear;
  Eigen::Matrix<double, MotionSums::kNumScrew, 1> screws;
  Eigen::Matrix<double, MotionSums::kNumAxes, 1> axes;
};
Numbers NumbersOf(const Rigid3d& a, const Rigid3d& b) {
  Numbers numbers;
  numbers.linear[MotionSums::kOne] = 1;
  const auto set = [&](const Rigid3d& motion, std::array<int, 2> linear, std::array<int, 2> screw,
                       std::array<int, 2> axes) {
    const Eigen::Matrix3d rotation = motion.RotationMatrix();
    numbers.linear.segment<9>(linear[0]) = Eigen::Map<const Eigen::Matrix<double, 9, 1>>(rotation.data());
    numbers.linear.segment<3>(linear[1]) = motion.translation;
    const double sign = motion.rotation.w() < 0 ? -1 : 1;
    const Eigen::Vector3d vec = sign * motion.rotation.vec();
    numbers.screws.segment<3>(screw[0]) = vec;
    numbers.screws.segment<3>(screw[1]) =
        0.5 * (sign * motion.rotation.w() * motion.translation + motion.translation.cross(vec));
    numbers.axes.segment<3>(axes[0]) = LogRotation(motion.rotation);
    numbers.axes.segment<3>(axes[1]) = LogRotation(motion.rotation).normalized();
  };
  set(a, {MotionSums::kRotationA, MotionSums::kTranslationA}, {MotionSums::kRealA, MotionSums::kDualA},
      {MotionSums::kVectorA, MotionSums::kAxisA});
  set(b, {MotionSums::kRotationB, MotionSums::kTranslationB}, {MotionSums::kRealB, MotionSums::kDualB},
      {MotionSums::kVectorB, MotionSums::kAxisB});
  return numbers;
}

using MotionSumsTest = EverySimdTest;

// The numbers of captures fill the SIMD lanes and batches exactly or in part.
TEST_P(MotionSumsTest, SumOverMotionsWithEnoughRotation) {
  for (const int num_captures : {2, 3, 9, 20, 140}) {
    TestSceneOptions options;
    options.num_captures = num_captures;
    const TestScene scene = MakeTestScene(3, options);
    Eigen::MatrixXd linear = Eigen::MatrixXd::Zero(MotionSums::kNumLinear, MotionSums::kNumLinear);
    Eigen::MatrixXd screws = Eigen::MatrixXd::Zero(MotionSums::kNumScrew, MotionSums::kNumScrew);
    Eigen::MatrixXd axes = Eigen::MatrixXd::Zero(MotionSums::kNumAxes, MotionSums::kNumAxes);
    double largest_rad = 0;
    for (const PosePair& one : scene.pairs) {
      for (const PosePair& other : scene.pairs) {
        largest_rad =
            std::max(largest_rad, AngleRad(one.camera_mount_from_target_mount, other.camera_mount_from_target_mount));
      }
    }
    const double least_rad = std::min(DegToRad(5.0), 0.25 * largest_rad);
    int num_used = 0;
    for (size_t i = 0; i < scene.pairs.size(); ++i) {
      for (size_t j = i + 1; j < scene.pairs.size(); ++j) {
        const Rigid3d a =
            scene.pairs[j].camera_mount_from_target_mount * Inverse(scene.pairs[i].camera_mount_from_target_mount);
        const Rigid3d b = scene.pairs[j].camera_from_target * Inverse(scene.pairs[i].camera_from_target);
        const double angle_rad = RotationAngle(a.rotation);
        if (angle_rad < least_rad || angle_rad > DegToRad(170.0)) continue;
        ++num_used;
        const Numbers numbers = NumbersOf(a, b);
        linear += numbers.linear * numbers.linear.transpose();
        screws += numbers.screws * numbers.screws.transpose();
        axes += numbers.axes * numbers.axes.transpose();
      }
    }
    const MotionSums sums = SumMotions(scene.pairs);
    EXPECT_EQ(sums.Count(), num_used);
    const double tolerance = 1e-12 * std::max(1, num_used);
    EXPECT_LT((sums.linear - linear).cwiseAbs().maxCoeff(), tolerance) << num_captures;
    EXPECT_LT((sums.screws - screws).cwiseAbs().maxCoeff(), tolerance) << num_captures;
    EXPECT_LT((sums.axes - axes).cwiseAbs().maxCoeff(), tolerance) << num_captures;
  }
}

TEST_P(MotionSumsTest, LimitTheNumberOfPairsForManyCaptures) {
  TestSceneOptions options;
  options.num_captures = 3000;
  options.points = GridPoints(2, 2, 0.04);
  const TestScene scene = MakeTestScene(4, options);
  const MotionSums sums = SumMotions(scene.pairs);
  constexpr double kMostPairs = 2.5e6;
  EXPECT_LT(sums.Count(), kMostPairs);
  EXPECT_GT(sums.Count(), 1e6);
}

INSTANTIATE_TEST_SUITE_P(Sets, MotionSumsTest, EverySimd(), SimdName);

}  // namespace
}  // namespace heba
