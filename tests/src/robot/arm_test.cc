#include "heba/robot/arm.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/rng.h"
#include "heba/base/units.h"
#include "heba/robot/arm_table.h"
#include "heba/robot/ur_kinematics.h"
#include "tests/support/arm_joints.h"

namespace heba {
namespace {

// Positions of the flange that follow from the drawings of the manufacturers.
struct KnownPosition {
  std::string arm;
  std::vector<double> joints_deg;
  Eigen::Vector3d base_from_tip_m;
};

class KnownPositionTest : public testing::TestWithParam<KnownPosition> {};
INSTANTIATE_TEST_SUITE_P(, KnownPositionTest,
                         testing::Values(KnownPosition{"ur5e", {0, -90, 0, -90, 0, 0}, {0, -0.2329, 1.0794}},
                                         KnownPosition{"franka_fr3", {0, 0, 0, 0, 0, 0, 0}, {0.088, 0, 0.926}},
                                         KnownPosition{"kuka_iiwa7", {0, 0, 0, 0, 0, 0, 0}, {0, 0, 1.266}},
                                         KnownPosition{"kuka_iiwa7", {0, 90, 0, 0, 0, 0, 0}, {0.926, 0, 0.34}},
                                         KnownPosition{"xarm6", {0, 0, 0, 0, 0, 0}, {0.207, 0, 0.112}},
                                         KnownPosition{"doosan_m1013", {0, 0, 0, 0, 0, 0}, {0, 0.0345, 1.4525}},
                                         KnownPosition{"kuka_kr6_r900", {0, -90, 90, 0, 0, 0}, {0.525, 0, 0.89}},
                                         KnownPosition{"kuka_kr6_r900", {90, -90, 90, 0, 0, 0}, {0, -0.525, 0.89}},
                                         KnownPosition{"fanuc_m10ia", {0, 0, 0, 0, 0, 0}, {0.89, 0, 1.25}},
                                         KnownPosition{"abb_irb120", {0, 0, 0, 0, 0, 0}, {0.374, 0, 0.63}},
                                         KnownPosition{"abb_irb120", {0, 0, -90, 0, 0, 0}, {-0.07, 0, 0.934}},
                                         KnownPosition{"staubli_tx60", {0, 0, 0, 0, 0, 0}, {0, 0.02, 1.045}}),
                         [](const auto& test) { return test.param.arm + "_" + std::to_string(test.index); });

TEST_P(KnownPositionTest, FlangeIsThere) {
  const Arm& arm = *FindArm(GetParam().arm);
  Eigen::VectorXd joints(arm.num_joints());
  for (Eigen::Index j = 0; j < joints.size(); ++j) joints[j] = DegToRad(GetParam().joints_deg[static_cast<size_t>(j)]);
  EXPECT_LT((BaseFromTip(arm, joints).translation - GetParam().base_from_tip_m).norm(), 1e-6)
      << BaseFromTip(arm, joints).translation.transpose();
}

class EveryArmTest : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(, EveryArmTest, testing::ValuesIn(ArmNames()), [](const auto& test) { return test.param; });

TEST_P(EveryArmTest, DerivativesAreThoseOfThePose) {
  Rng rng(3);
  Arm arm = *FindArm(GetParam());
  // With an angle beta, and with a sliding joint.
  arm.joints[1].beta_rad = 0.1;
  arm.joints[2].is_turning = false;
  const Eigen::VectorXd joints = RandomJoints(arm, &rng);
  Matrix6X by_joints;
  Matrix6X by_params;
  const Rigid3d pose = BaseFromTip(arm, joints, &by_joints, &by_params);
  constexpr double kStep = 1e-6;
  for (int j = 0; j < arm.num_joints(); ++j) {
    const Eigen::VectorXd step = kStep * Eigen::VectorXd::Unit(arm.num_joints(), j);
    const Tangent6 numeric = LocalCoordinates(pose, BaseFromTip(arm, joints + step)) -
                             LocalCoordinates(pose, BaseFromTip(arm, joints - step));
    EXPECT_LT((numeric / (2 * kStep) - by_joints.col(j)).norm(), 1e-8) << j;
  }
  for (int p = 0; p < arm.num_params(); ++p) {
    const Eigen::VectorXd step = kStep * Eigen::VectorXd::Unit(arm.num_params(), p);
    const Tangent6 numeric = LocalCoordinates(pose, BaseFromTip(WithChanges(arm, step), joints)) -
                             LocalCoordinates(pose, BaseFromTip(WithChanges(arm, -step), joints));
    EXPECT_LT((numeric / (2 * kStep) - by_params.col(p)).norm(), 1e-8) << ArmParamName(p);
  }
}

TEST_P(EveryArmTest, AxesDescribeTheArm) {
  Rng rng(4);
  const Arm& arm = *FindArm(GetParam());
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(arm.num_joints());
  const Arm again = ArmFromAxes("again", AxesOf(arm, zero), BaseFromTip(arm, zero));
  for (int i = 0; i < 20; ++i) {
    const Eigen::VectorXd joints = RandomJoints(arm, &rng);
    EXPECT_LT(LocalCoordinates(BaseFromTip(arm, joints), BaseFromTip(again, joints)).norm(), 1e-12);
  }
}

// Tilts of 0.1 deg make the parallel axes of a calibrated arm skew. With the parameters of Denavit and Hartenberg
// alone, their common normal would be metres away.
TEST_P(EveryArmTest, NearlyParallelAxesKeepSmallParameters) {
  Rng rng(5);
  const Arm& nominal = *FindArm(GetParam());
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(nominal.num_joints());
  std::vector<ArmAxis> axes = AxesOf(nominal, zero);
  for (ArmAxis& axis : axes) {
    axis.direction =
        ExpRotation(Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal()) * DegToRad(0.1)) * axis.direction;
  }
  const Arm arm = ArmFromAxes("tilted", axes, BaseFromTip(nominal, zero));
  for (const ArmJoint& joint : arm.joints) {
    EXPECT_LT(std::abs(joint.d_m), 1.5);
    EXPECT_LT(std::abs(joint.a_m), 1.5);
  }
  for (size_t j = 0; j < axes.size(); ++j) {
    const ArmAxis found = AxesOf(arm, zero)[j];
    EXPECT_LT((found.direction - axes[j].direction).norm(), 1e-12);
    EXPECT_LT((found.point - axes[j].point).cross(axes[j].direction).norm(), 1e-12);
  }
}

TEST(ArmTest, OnlyNeighboursWithOneDirectionAreParallel) {
  const Arm& ur = *FindArm("ur5e");
  std::vector<bool> found;
  for (int j = 0; j < ur.num_joints(); ++j) found.push_back(IsParallelToNext(ur, j));
  EXPECT_THAT(found, testing::ElementsAre(false, true, true, false, false, false));
}

TEST(ArmTest, NamesCountJointsFromOne) {
  EXPECT_EQ(ArmParamName(ArmParamPlace(1, ArmParam::kTheta)), "joint2.offset");
  EXPECT_EQ(ArmParamName(ArmParamPlace(2, ArmParam::kBeta)), "joint3.beta");
  EXPECT_TRUE(IsAngle(ArmParamPlace(2, ArmParam::kAlpha)));
  EXPECT_FALSE(IsAngle(ArmParamPlace(0, ArmParam::kD)));
}

}  // namespace
}  // namespace heba
