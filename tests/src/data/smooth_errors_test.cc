#include "heba/data/smooth_errors.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "heba/base/rng.h"

namespace heba {
namespace {

std::vector<Rigid3d> DrawPoses(int num, double spread_m, double spread_rad, uint64_t seed) {
  Rng rng(seed);
  std::vector<Rigid3d> poses;
  for (int i = 0; i < num; ++i) {
    poses.push_back({ExpRotation(spread_rad * rng.NormalVector3()), spread_m * rng.NormalVector3()});
  }
  return poses;
}

// The covariance of the process by its definition, for sigmas of 1.
double CovarianceByDefinition(const Rigid3d& a, const Rigid3d& b, const SmoothLengths& lengths) {
  const double distance = (a.translation - b.translation).norm() / lengths.translation_m;
  const double rotation = 2 * std::sin(0.5 * AngleRad(a, b)) / lengths.rotation_rad;
  return std::exp(-0.5 * (distance * distance + rotation * rotation));
}

// Between the poses, the effects have the covariance of the process, along the axes of the base.
TEST(SmoothErrorsTest, CovarianceIsThatOfTheProcess) {
  const SmoothLengths lengths{0.4, 0.9};
  const std::vector<Rigid3d> poses = DrawPoses(20, 0.15, 0.3, 1);
  const SmoothErrors errors(poses, lengths);
  for (const Rigid3d& a : poses) {
    for (const Rigid3d& b : poses) {
      Eigen::Matrix<double, 6, 6> to_base = Eigen::Matrix<double, 6, 6>::Zero();
      to_base.topLeftCorner<3, 3>() = to_base.bottomRightCorner<3, 3>() = a.RotationMatrix();
      Eigen::Matrix<double, 6, 6> from_base = Eigen::Matrix<double, 6, 6>::Zero();
      from_base.topLeftCorner<3, 3>() = from_base.bottomRightCorner<3, 3>() = b.RotationMatrix();
      const Eigen::Matrix<double, 6, 6> covariance =
          to_base * errors.GripperByEffects(a) * errors.GripperByEffects(b).transpose() * from_base.transpose();
      // The basis may lack one hundredth of the variance at each pose.
      const double expected = CovarianceByDefinition(a, b, lengths);
      EXPECT_LT((covariance - expected * Eigen::Matrix<double, 6, 6>::Identity()).cwiseAbs().maxCoeff(), 0.011);
    }
  }
}

// The number of effects follows from the spread of the poses, not from their number.
TEST(SmoothErrorsTest, NumberOfEffectsIsBounded) {
  const SmoothErrors near(DrawPoses(500, 0.01, 0.02, 2), {});
  const SmoothErrors far(DrawPoses(500, 2, 1, 2), {});
  EXPECT_LE(near.effects().size(), 6 * 6);
  EXPECT_GE(far.effects().size(), 6 * 20);
  EXPECT_LE(far.effects().size(), 6 * 24);
  EXPECT_EQ(near.effects().groups.size(), 2U);
  EXPECT_EQ(near.effects().num_all, near.effects().size());
}

// Far from all poses, the effects say nothing.
TEST(SmoothErrorsTest, ErrorFadesAwayFromThePoses) {
  const SmoothErrors errors(DrawPoses(10, 0.1, 0.2, 3), {0.2, 0.5});
  const Rigid3d far(Eigen::Quaterniond::Identity(), {2, 0, 0});
  EXPECT_LT(errors.GripperByEffects(far).cwiseAbs().maxCoeff(), 1e-6);
  const Eigen::VectorXd effects = Eigen::VectorXd::Constant(errors.effects().size(), 1e-3);
  EXPECT_LT(DistanceM(errors.EffectAt(far)->Evaluate(effects, nullptr), Rigid3d()), 1e-6);
}

}  // namespace
}  // namespace heba
