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
  // With an angle beta, with a sliding joint, and with a joint that yields.
  arm.joints[1].beta_rad = 0.1;
  arm.joints[2].is_turning = false;
  arm.joints[1].compliance = 3e-5;
  const Eigen::VectorXd joints = RandomJoints(arm, rng);
  Matrix6X by_joints;
  Matrix6X by_params;
  const Rigid3d pose = BaseFromTip(arm, joints, &by_joints, &by_params);
  constexpr double kStep = 1e-6;
  for (int j = 0; j < arm.num_joints(); ++j) {
    const Eigen::VectorXd step = kStep * Eigen::VectorXd::Unit(arm.num_joints(), j);
    const Tangent6 numeric = LocalCoordinates(pose, BaseFromTip(arm, joints + step)) -
                             LocalCoordinates(pose, BaseFromTip(arm, joints - step));
    // The torques, which change with the commanded positions, move joint 2 by up to 3e-5 * 300 N m/rad.
    EXPECT_LT((numeric / (2 * kStep) - by_joints.col(j)).norm(), arm.load == nullptr ? 1e-8 : 0.02) << j;
  }
  for (int p = 0; p < arm.num_params(); ++p) {
    // A torque of 100 N m makes the step of a compliance 100 times as large.
    const bool is_compliance = p % kNumArmParams == static_cast<int>(ArmParam::kCompliance);
    const double size = is_compliance ? 1e-2 * kStep : kStep;
    const Eigen::VectorXd step = size * Eigen::VectorXd::Unit(arm.num_params(), p);
    const Tangent6 numeric = LocalCoordinates(pose, BaseFromTip(WithChanges(arm, step), joints)) -
                             LocalCoordinates(pose, BaseFromTip(WithChanges(arm, -step), joints));
    EXPECT_LT((numeric / (2 * size) - by_params.col(p)).norm(), is_compliance ? 1e-6 : 1e-8) << ArmParamName(p);
  }
}

TEST_P(EveryArmTest, AxesDescribeTheArm) {
  Rng rng(4);
  const Arm& arm = *FindArm(GetParam());
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(arm.num_joints());
  const Arm again = ArmFromAxes("again", AxesOf(arm, zero), BaseFromTip(arm, zero));
  for (int i = 0; i < 20; ++i) {
    const Eigen::VectorXd joints = RandomJoints(arm, rng);
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
        ExpRotation(Eigen::Vector3d{rng.Normal(), rng.Normal(), rng.Normal()} * DegToRad(0.1)) * axis.direction;
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

// The potential energy of the links, whose derivative is minus the generalised force of gravity.
double PotentialEnergyJ(const Arm& arm, const Eigen::VectorXd& joints) {
  double energy = 0;
  for (size_t j = 0; j < arm.joints.size(); ++j) {
    Arm part = RigidPart(arm);
    part.joints.resize(j + 1);
    part.last_from_tip = {};
    const Rigid3d base_from_link = BaseFromTip(part, joints.head(static_cast<Eigen::Index>(j) + 1));
    const PointMass& link = arm.load->links[j];
    energy += 9.81 * link.mass_kg * (base_from_link * link.centre_m).z();
  }
  return energy;
}

TEST(ArmTest, TorquesAreThoseOfThePotentialEnergy) {
  Rng rng(8);
  for (const char* name : {"ur3", "ur5e", "ur10e", "ur16e", "ur20"}) {
    const Arm arm = WithPayload(*FindArm(name), {2.5, {0.05, -0.02, 0.1}});
    for (int i = 0; i < 5; ++i) {
      const Eigen::VectorXd joints = RandomJoints(arm, rng);
      const Eigen::VectorXd torques = GravityTorques(arm, joints);
      constexpr double kStep = 1e-5;
      for (int j = 0; j < arm.num_joints(); ++j) {
        const Eigen::VectorXd step = kStep * Eigen::VectorXd::Unit(arm.num_joints(), j);
        const double slope =
            (PotentialEnergyJ(arm, joints + step) - PotentialEnergyJ(arm, joints - step)) / (2 * kStep);
        // Rounding errors of 1000 J over the step leave 1e-7 N m.
        EXPECT_NEAR(torques[j], -slope, 1e-6) << name << " joint " << j + 1;
      }
    }
  }
}

// A stretched UR5e: the weights of its links, the shoulder's excepted, at their distances from the shoulder.
TEST(ArmTest, StretchedArmHangsOnItsShoulder) {
  const Arm& arm = *FindArm("ur5e");
  const double hand_kg_m = 1.37 * 0.8172 + 1.3 * 0.8172 + 0.365 * 0.8172;
  const double torque = 9.81 * (8.058 * 0.2125 + 2.846 * (0.425 + 0.3922 - 0.15) + hand_kg_m);
  // The arm points along -x of the base, and its joint 2 turns about -y: its weight lets it fall with growing angle.
  const Eigen::VectorXd torques = GravityTorques(arm, Eigen::VectorXd::Zero(6));
  EXPECT_NEAR(torques[0], 0, 1e-12);
  // The centres of the wrist's links are up to 2 cm beside their origins.
  EXPECT_NEAR(std::abs(torques[1]), torque, 9.81 * 3 * 0.02);
}

TEST(ArmTest, JointsYieldInTheDirectionOfTheWeight) {
  Rng rng(9);
  Arm arm = *FindArm("ur10e");
  for (int i = 0; i < 5; ++i) {
    const Eigen::VectorXd joints = RandomJoints(arm, rng);
    for (ArmJoint& joint : arm.joints) joint.compliance = 2e-5;
    const Eigen::VectorXd reached = joints + 2e-5 * GravityTorques(arm, joints);
    const Arm rigid = RigidPart(arm);
    EXPECT_LT(LocalCoordinates(BaseFromTip(rigid, reached), BaseFromTip(arm, joints)).norm(), 1e-12);
    EXPECT_LT(PotentialEnergyJ(arm, reached), PotentialEnergyJ(arm, joints));
  }
}

TEST(ArmTest, LoadFollowsTheAxes) {
  Rng rng(10);
  const Arm& arm = *FindArm("ur5e");
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(6);
  const Arm again = WithLoadAndLimitsOf(ArmFromAxes("again", AxesOf(arm, zero), BaseFromTip(arm, zero)), arm);
  for (int i = 0; i < 5; ++i) {
    const Eigen::VectorXd joints = RandomJoints(arm, rng);
    EXPECT_LT((GravityTorques(arm, joints) - GravityTorques(again, joints)).norm(), 1e-10);
  }
}

TEST(ArmTest, NamesCountJointsFromOne) {
  EXPECT_EQ(ArmParamName(ArmParamPlace(1, ArmParam::kTheta)), "joint2.offset");
  EXPECT_EQ(ArmParamName(ArmParamPlace(2, ArmParam::kBeta)), "joint3.beta");
  EXPECT_EQ(ArmParamName(ArmParamPlace(1, ArmParam::kCompliance)), "joint2.compliance");
  Arm arm = *FindArm("ur5e");
  EXPECT_EQ(ArmParamUnit(arm, ArmParamPlace(2, ArmParam::kAlpha)), "rad");
  EXPECT_EQ(ArmParamUnit(arm, ArmParamPlace(0, ArmParam::kD)), "m");
  EXPECT_EQ(ArmParamUnit(arm, ArmParamPlace(1, ArmParam::kCompliance)), "rad/(N m)");
  arm.joints[1].is_turning = false;
  EXPECT_EQ(ArmParamUnit(arm, ArmParamPlace(1, ArmParam::kCompliance)), "m/N");
}

}  // namespace
}  // namespace heba
