#include <cmath>
#include <vector>

#include <ceres/manifold_test_utils.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/rng.h"
#include "heba/base/units.h"
#include "heba/geometry/pose_block.h"
#include "heba/geometry/rigid3.h"

namespace heba {
namespace {

// rad and m: about ten operations with a relative error of 1e-16 on poses within a few metres.
constexpr double kRoundOff = 1e-13;

Rigid3d RandomPose(Rng& rng) {
  const double angle_rad = rng.Uniform(0, kPi);
  const Eigen::Vector3d rotation_vector = angle_rad * rng.Direction3();
  return {ExpRotation(rotation_vector), rng.NormalVector3()};
}

Tangent6 RandomTangent(Rng& rng, double scale) {
  Tangent6 tangent;
  for (double& value : tangent) value = scale * rng.Normal();
  return tangent;
}

TEST(Rigid3, ProductChainsFramesAndInverseUndoes) {
  Rng rng(1);
  for (int i = 0; i < 100; ++i) {
    const Rigid3d a_from_b = RandomPose(rng);
    const Rigid3d b_from_c = RandomPose(rng);
    const Eigen::Vector3d point_in_c = rng.NormalVector3();
    EXPECT_LT(((a_from_b * b_from_c) * point_in_c - a_from_b * (b_from_c * point_in_c)).norm(), kRoundOff);
    EXPECT_LT((Inverse(a_from_b) * (a_from_b * point_in_c) - point_in_c).norm(), kRoundOff);
    const Eigen::Vector4d homogeneous = a_from_b.Matrix() * point_in_c.homogeneous();
    EXPECT_LT((homogeneous - (a_from_b * point_in_c).homogeneous()).norm(), kRoundOff);
    EXPECT_NEAR((a_from_b * b_from_c).rotation.norm(), 1.0, 1e-15);
  }
}

TEST(Rigid3, RotationBy90DegreesAboutZTakesXToY) {
  const Rigid3d a_from_b(ExpRotation({0, 0, kPi / 2}), {1, 2, 3});
  EXPECT_LT((a_from_b * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(1, 3, 3)).norm(), kRoundOff);
}

TEST(Rotation, LogInvertsExpUpTo180Degrees) {
  Rng rng(2);
  for (const double angle_rad : {0.0, 1e-300, 1e-12, 1e-8, 9.9e-5, 1.01e-4, 0.1, 1.0, 3.0, kPi - 1e-6}) {
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector3d rotation_vector = angle_rad * rng.Direction3();
      const Eigen::Quaterniond rotation = ExpRotation(rotation_vector);
      EXPECT_LT((LogRotation(rotation) - rotation_vector).norm(), kRoundOff) << angle_rad;
      // q and -q represent the same rotation.
      const Eigen::Quaterniond negative(-rotation.coeffs());
      EXPECT_LT((LogRotation(negative) - rotation_vector).norm(), kRoundOff) << angle_rad;
      EXPECT_NEAR(RotationAngle(rotation), angle_rad, kRoundOff);
      EXPECT_NEAR(RotationAngle(negative), angle_rad, kRoundOff);
    }
  }
}

TEST(Rotation, SmallAnglesKeepTheirRelativePrecision) {
  const Eigen::Vector3d tiny(3e-9, -4e-9, 0);
  EXPECT_LT((LogRotation(ExpRotation(tiny)) - tiny).norm(), 1e-15 * tiny.norm() + 1e-24);
}

TEST(Rotation, ExpIsTheMatrixExponential) {
  Rng rng(3);
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector3d w = 0.5 * rng.NormalVector3();
    Eigen::Matrix3d series = Eigen::Matrix3d::Identity();
    Eigen::Matrix3d term = Eigen::Matrix3d::Identity();
    for (int k = 1; k < 40; ++k) {
      term = term * Skew(w) / k;
      series += term;
    }
    EXPECT_LT((ExpRotation(w).toRotationMatrix() - series).norm(), kRoundOff);
  }
}

TEST(Rotation, SkewIsTheCrossProduct) {
  const Eigen::Vector3d a(1, 2, 3);
  const Eigen::Vector3d b(-4, 5, 0.5);
  EXPECT_EQ((Skew(a) * b), a.cross(b));
}

TEST(Rotation, RotationOntoTurnsByTheSmallestAngle) {
  Rng rng(4);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d from = rng.Direction3();
    const Eigen::Vector3d to = rng.Direction3();
    const Eigen::Quaterniond rotation = RotationOnto(2 * from, 3 * to);
    EXPECT_LT((rotation * from - to).norm(), kRoundOff);
    EXPECT_NEAR(RotationAngle(rotation), std::atan2(from.cross(to).norm(), from.dot(to)), kRoundOff);
    EXPECT_LT((RotationOnto(from, -from) * from + from).norm(), kRoundOff);
    EXPECT_LT(RotationAngle(RotationOnto(from, from)), kRoundOff);
  }
}

TEST(Rotation, NearestRotationIsARotationAndNearest) {
  Rng rng(4);
  for (int i = 0; i < 50; ++i) {
    Eigen::Matrix3d noisy = RandomPose(rng).RotationMatrix();
    for (int k = 0; k < 9; ++k) noisy.data()[k] += 0.3 * rng.Normal();
    const Eigen::Matrix3d nearest = NearestRotation(noisy);
    EXPECT_LT((nearest.transpose() * nearest - Eigen::Matrix3d::Identity()).norm(), kRoundOff);
    EXPECT_NEAR(nearest.determinant(), 1.0, kRoundOff);
    const double distance = (nearest - noisy).norm();
    for (int k = 0; k < 20; ++k) {
      const Eigen::Matrix3d other = nearest * ExpRotation(0.1 * rng.NormalVector3()).toRotationMatrix();
      EXPECT_GE((other - noisy).norm(), distance);
    }
  }
  // A reflection still gives a rotation.
  EXPECT_NEAR(NearestRotation(-Eigen::Matrix3d::Identity()).determinant(), 1.0, kRoundOff);
}

TEST(Tangent, LocalCoordinatesInvertRetract) {
  Rng rng(5);
  for (int i = 0; i < 100; ++i) {
    const Rigid3d a_from_b = RandomPose(rng);
    const Tangent6 tangent = RandomTangent(rng, 0.5);
    EXPECT_LT((LocalCoordinates(a_from_b, Retract(a_from_b, tangent)) - tangent).norm(), kRoundOff);
  }
}

TEST(Tangent, TranslationPrecedesRotationInTheChildFrame) {
  const Rigid3d a_from_b(ExpRotation({0, 0, kPi / 2}), {1, 0, 0});
  Tangent6 along_x = Tangent6::Zero();
  along_x[0] = 0.5;
  // The child's x axis is the parent's y axis.
  EXPECT_LT((Retract(a_from_b, along_x).translation - Eigen::Vector3d(1, 0.5, 0)).norm(), kRoundOff);
  Tangent6 about_z = Tangent6::Zero();
  about_z[5] = kPi / 2;
  EXPECT_NEAR(AngleRad(Retract(a_from_b, about_z), Rigid3d(ExpRotation({0, 0, kPi}), {1, 0, 0})), 0, kRoundOff);
}

TEST(Tangent, AdjointTransformsTangents) {
  Rng rng(6);
  for (int i = 0; i < 50; ++i) {
    const Rigid3d a_from_b = RandomPose(rng);
    constexpr double kStep = 1e-6;
    const Tangent6 right = RandomTangent(rng, kStep);
    const Tangent6 left = Adjoint(a_from_b) * right;
    const Rigid3d moved_left = Retract(Rigid3d(), left) * a_from_b;
    // The two agree to first order; the difference is quadratic in the step, with lengths of a few metres.
    EXPECT_LT((LocalCoordinates(a_from_b, moved_left) - right).norm(), 100 * kStep * kStep);
  }
}

TEST(MeanPoseTest, IsTheMiddle) {
  Rng rng(7);
  const Rigid3d a_from_b = RandomPose(rng);
  std::vector<Rigid3d> poses;
  for (int i = 0; i < 6; ++i) {
    Tangent6 step = Tangent6::Zero();
    step[i] = 0.2;
    poses.push_back(Retract(a_from_b, step));
    poses.push_back(Retract(a_from_b, -step));
  }
  const Rigid3d mean = MeanPose(poses);
  EXPECT_NEAR(DistanceM(mean, a_from_b), 0, kRoundOff);
  EXPECT_NEAR(AngleRad(mean, a_from_b), 0, kRoundOff);
}

TEST(Distance, IsBetweenTheOrigins) {
  const Rigid3d a(ExpRotation({0.1, 0, 0}), {1, 2, 3});
  const Rigid3d b(ExpRotation({0.4, 0, 0}), {1, 2, 5});
  EXPECT_NEAR(DistanceM(a, b), 2, kRoundOff);
  EXPECT_NEAR(AngleRad(a, b), 0.3, kRoundOff);
}

TEST(PoseBlockTest, HoldsThePoseInTheStatedOrder) {
  Rng rng(8);
  const Rigid3d pose = RandomPose(rng);
  const PoseBlock block = ToBlock(pose);
  EXPECT_EQ(block[3], pose.rotation.w());
  EXPECT_EQ(block[4], pose.translation.x());
  EXPECT_NEAR(AngleRad(FromBlock(block.data()), pose), 0, kRoundOff);
  EXPECT_EQ(DistanceM(FromBlock(block.data()), pose), 0);
}

TEST(PoseManifoldTest, KeepsCeresInvariants) {
  Rng rng(9);
  using namespace ceres;  // NOLINT(google-build-using-namespace): the macro needs it.
  const PoseManifold manifold;
  for (int i = 0; i < 20; ++i) {
    const PoseBlock from = ToBlock(RandomPose(rng));
    PoseBlock to = ToBlock(RandomPose(rng));
    // q and -q represent the same pose but are different blocks, and Ceres compares blocks. The sign is chosen such
    // that the step between the two blocks is less than 180 deg.
    const double cosine = Eigen::Map<Eigen::Vector4d>(to.data()).dot(Eigen::Map<const Eigen::Vector4d>(from.data()));
    if (cosine < 0) Eigen::Map<Eigen::Vector4d>(to.data()) *= -1.0;
    const ceres::Vector x = Eigen::Map<const ceres::Vector>(from.data(), 7);
    const ceres::Vector y = Eigen::Map<const ceres::Vector>(to.data(), 7);
    const ceres::Vector delta = RandomTangent(rng, 0.3);
    // Accuracy of the numeric derivatives of Ceres.
    constexpr double kTolerance = 1e-9;
    EXPECT_THAT_MANIFOLD_INVARIANTS_HOLD(manifold, x, delta, y, kTolerance);
  }
}

// Cost functions rely on this: the derivative of a function by the block, times PlusJacobian, is its derivative in
// the tangent space.
TEST(PoseManifoldTest, TangentFromBlockIsALeftInverseOfPlusJacobian) {
  Rng rng(10);
  const PoseManifold manifold;
  for (int i = 0; i < 20; ++i) {
    const PoseBlock block = ToBlock(RandomPose(rng));
    Eigen::Matrix<double, 7, 6, Eigen::RowMajor> plus;
    ASSERT_TRUE(manifold.PlusJacobian(block.data(), plus.data()));
    const Eigen::Matrix<double, 6, 6> product = TangentFromBlock(block.data()) * plus;
    EXPECT_LT((product - Eigen::Matrix<double, 6, 6>::Identity()).norm(), kRoundOff);
  }
}

TEST(PoseManifoldTest, StepsAreRetractions) {
  Rng rng(11);
  const PoseManifold manifold;
  const Rigid3d pose = RandomPose(rng);
  const Tangent6 tangent = RandomTangent(rng, 0.4);
  PoseBlock moved;
  ASSERT_TRUE(manifold.Plus(ToBlock(pose).data(), tangent.data(), moved.data()));
  const Rigid3d expected = Retract(pose, tangent);
  EXPECT_NEAR(AngleRad(FromBlock(moved.data()), expected), 0, kRoundOff);
  EXPECT_NEAR(DistanceM(FromBlock(moved.data()), expected), 0, kRoundOff);
}

}  // namespace
}  // namespace heba
