#include "heba/robot/rigid_equivalent.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "heba/base/rng.h"
#include "heba/robot/arm_table.h"
#include "tests/support/arm_joints.h"

namespace heba {
namespace {

// Joints around one posture, as those of the captures of a target.
std::vector<Eigen::VectorXd> CloseJoints(const Arm& arm, int num, Rng& rng) {
  const Eigen::VectorXd middle = RandomJoints(arm, rng);
  std::vector<Eigen::VectorXd> joints;
  for (int i = 0; i < num; ++i) {
    Eigen::VectorXd positions = middle;
    for (double& position : positions) position += rng.Uniform(-0.5, 0.5);
    joints.push_back(positions);
  }
  return joints;
}

Eigen::VectorXd ErrorsWithCompliance(const Arm& arm) {
  Eigen::VectorXd errors = Eigen::VectorXd::Zero(arm.num_params());
  errors[ArmParamPlace(1, ArmParam::kTheta)] = 2e-3;
  errors[ArmParamPlace(2, ArmParam::kA)] = -4e-4;
  errors[ArmParamPlace(1, ArmParam::kCompliance)] = 2e-5;
  errors[ArmParamPlace(2, ArmParam::kCompliance)] = 3e-5;
  return errors;
}

double DifferenceM(const Arm& one, const Arm& other, const std::vector<Eigen::VectorXd>& joints) {
  double squares = 0;
  for (const Eigen::VectorXd& positions : joints) {
    squares += std::pow(DistanceM(BaseFromTip(one, positions), BaseFromTip(other, positions)), 2);
  }
  return std::sqrt(squares / static_cast<double>(joints.size()));
}

TEST(RigidEquivalentTest, GeometryStandsForComplianceAtTheCaptures) {
  Rng rng(5);
  const Arm& arm = *FindArm("ur5e");
  const Eigen::VectorXd errors = ErrorsWithCompliance(arm);
  const Arm yielding = WithChanges(arm, errors);
  std::vector<double> shares;  // Each is the share of the effect of the compliances that is left.
  for (int trial = 0; trial < 21; ++trial) {
    const std::vector<Eigen::VectorXd> joints = CloseJoints(arm, 25, rng);
    const RigidEquivalent rigid = FitRigidEquivalent(arm, errors, joints);
    const Arm rigid_arm = WithChanges(arm, rigid.errors);
    for (int j = 0; j < arm.num_joints(); ++j) EXPECT_EQ(rigid.errors[ArmParamPlace(j, ArmParam::kCompliance)], 0);
    const double left_m = DifferenceM(rigid_arm, yielding, joints);
    EXPECT_NEAR(rigid.left_m, left_m, 1e-9);
    shares.push_back(left_m / DifferenceM(RigidPart(yielding), yielding, joints));
    EXPECT_LT(shares.back(), 1) << trial;
  }
  // Torques vary with the joints in ways that no geometry has.
  std::sort(shares.begin(), shares.end());
  EXPECT_LT(shares[10], 0.3);
}

TEST(RigidEquivalentTest, ErrorsOfAGeometryStayAsTheyAre) {
  Rng rng(6);
  const Arm& arm = *FindArm("ur5e");
  Eigen::VectorXd errors = ErrorsWithCompliance(arm);
  for (int j = 0; j < arm.num_joints(); ++j) errors[ArmParamPlace(j, ArmParam::kCompliance)] = 0;
  const RigidEquivalent rigid = FitRigidEquivalent(arm, errors, CloseJoints(arm, 1, rng));
  EXPECT_LT((rigid.errors - errors).norm(), 1e-12);
  EXPECT_LT(rigid.left_m, 1e-12);
}

}  // namespace
}  // namespace heba
