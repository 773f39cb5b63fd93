#include "solvers/closed_form/motion_sums.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <tuple>
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

// The sums over the motions between all captures, computed one motion at a time.
struct ReferenceSums {
  Eigen::MatrixXd linear = Eigen::MatrixXd::Zero(MotionSums::kNumLinear, MotionSums::kNumLinear);
  Eigen::MatrixXd screws = Eigen::MatrixXd::Zero(MotionSums::kNumScrew, MotionSums::kNumScrew);
  Eigen::MatrixXd axes = Eigen::MatrixXd::Zero(MotionSums::kNumAxes, MotionSums::kNumAxes);
  int num_used = 0;
};

double LargestRotationRad(const std::vector<PosePair>& pairs) {
  double largest_rad = 0;
  for (const PosePair& one : pairs) {
    for (const PosePair& other : pairs) {
      largest_rad =
          std::max(largest_rad, AngleRad(one.camera_mount_from_target_mount, other.camera_mount_from_target_mount));
    }
  }
  return largest_rad;
}

ReferenceSums SumMotionsOneByOne(const std::vector<PosePair>& pairs) {
  const double least_rad = std::min(DegToRad(5.0), 0.25 * LargestRotationRad(pairs));
  ReferenceSums sums;
  for (size_t i = 0; i < pairs.size(); ++i) {
    for (size_t j = i + 1; j < pairs.size(); ++j) {
      const Rigid3d a = pairs[j].camera_mount_from_target_mount * Inverse(pairs[i].camera_mount_from_target_mount);
      const Rigid3d b = pairs[j].camera_from_target * Inverse(pairs[i].camera_from_target);
      const double angle_rad = RotationAngle(a.rotation);
      if (angle_rad < least_rad || angle_rad > DegToRad(170.0)) continue;
      ++sums.num_used;
      const Numbers numbers = NumbersOf(a, b);
      sums.linear += numbers.linear * numbers.linear.transpose();
      sums.screws += numbers.screws * numbers.screws.transpose();
      sums.axes += numbers.axes * numbers.axes.transpose();
    }
  }
  return sums;
}

// The parameters are the instruction set and the number of captures, which fill the SIMD lanes and batches exactly or
// in part.
class MotionSumsSizeTest : public testing::TestWithParam<std::tuple<Simd, int>> {
 protected:
  void SetUp() override {
    const Simd simd = std::get<Simd>(GetParam());
    LimitSimd(simd);
    if (ActiveSimd() != simd) GTEST_SKIP() << "this processor does not have the instruction set";
  }
  void TearDown() override { LimitSimd(Simd::kAvx512); }
};

TEST_P(MotionSumsSizeTest, SumsOverMotionsWithEnoughRotation) {
  TestSceneOptions options;
  options.num_captures = std::get<int>(GetParam());
  const TestScene scene = MakeTestScene(3, options);
  const ReferenceSums expected = SumMotionsOneByOne(scene.pairs);
  const MotionSums sums = SumMotions(scene.pairs);
  EXPECT_EQ(sums.Count(), expected.num_used);
  const double tolerance = 1e-12 * std::max(1, expected.num_used);
  EXPECT_LT((sums.linear - expected.linear).cwiseAbs().maxCoeff(), tolerance);
  EXPECT_LT((sums.screws - expected.screws).cwiseAbs().maxCoeff(), tolerance);
  EXPECT_LT((sums.axes - expected.axes).cwiseAbs().maxCoeff(), tolerance);
}

INSTANTIATE_TEST_SUITE_P(SetsAndSizes, MotionSumsSizeTest,
                         testing::Combine(EverySimd(), testing::Values(2, 3, 9, 20, 140)), [](const auto& test) {
                           return SimdName({std::get<Simd>(test.param), test.index}) + "_" +
                                  std::to_string(std::get<int>(test.param)) + "_captures";
                         });

using MotionSumsTest = EverySimdTest;

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
