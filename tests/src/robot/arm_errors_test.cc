#include "heba/robot/arm_errors.h"

#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/QR>

#include "heba/base/rng.h"
#include "heba/base/units.h"
#include "heba/robot/arm_table.h"
#include "tests/support/arm_joints.h"

namespace heba {
namespace {

Rigid3d RandomPose(Rng& rng) { return Rigid3d{ExpRotation(rng.NormalVector3()), 0.1 * rng.NormalVector3()}; }

bool IsCompliance(int place) { return place % kNumArmParams == static_cast<int>(ArmParam::kCompliance); }

TEST(ArmErrorsTest, NoErrorsLeaveThePose) {
  Rng rng(1);
  const Arm& arm = *FindArm("ur5e");
  const Eigen::VectorXd joints = RandomJoints(arm, rng);
  const auto effect = MakeArmEffect(arm, joints, RandomPose(rng));
  EXPECT_LT(LocalCoordinates({}, effect->Evaluate(Eigen::VectorXd::Zero(arm.num_params()), nullptr)).norm(), 1e-12);
}

TEST(ArmErrorsTest, EffectIsTheMotionOfTheGripper) {
  Rng rng(2);
  const Arm& arm = *FindArm("ur5e");
  const Eigen::VectorXd joints = RandomJoints(arm, rng);
  const Rigid3d tip_from_gripper = RandomPose(rng);
  Eigen::VectorXd errors(arm.num_params());
  for (int p = 0; p < arm.num_params(); ++p) errors[p] = (IsCompliance(p) ? 1e-5 : 1e-3) * rng.Normal();
  const Rigid3d nominal = BaseFromTip(arm, joints) * tip_from_gripper;
  const Rigid3d moved = BaseFromTip(WithChanges(arm, errors), joints) * tip_from_gripper;
  Matrix6X by_errors;
  const Rigid3d effect = MakeArmEffect(arm, joints, tip_from_gripper)->Evaluate(errors, &by_errors);
  EXPECT_LT(LocalCoordinates(moved, nominal * effect).norm(), 1e-12);
  for (int p = 0; p < arm.num_params(); ++p) {
    // A torque of 100 N m makes the step of a compliance 100 times as large.
    const double size = IsCompliance(p) ? 1e-8 : 1e-6;
    const Eigen::VectorXd step = size * Eigen::VectorXd::Unit(arm.num_params(), p);
    const auto evaluate = [&](const Eigen::VectorXd& at) {
      return MakeArmEffect(arm, joints, tip_from_gripper)->Evaluate(at, nullptr);
    };
    const Tangent6 numeric =
        LocalCoordinates(effect, evaluate(errors + step)) - LocalCoordinates(effect, evaluate(errors - step));
    EXPECT_LT((numeric / (2 * size) - by_errors.col(p)).norm(), IsCompliance(p) ? 1e-6 : 1e-8) << ArmParamName(p);
  }
}

// Returns the derivatives of camera_from_target of many captures by the poses of base and tool and by these effects.
Eigen::MatrixXd Sensitivity(const Arm& arm, const std::vector<int>& places) {
  Rng rng(3);
  constexpr int kCaptures = 60;
  Eigen::MatrixXd all(6 * kCaptures, 12 + static_cast<Eigen::Index>(places.size()));
  for (int i = 0; i < kCaptures; ++i) {
    const Eigen::VectorXd joints = RandomJoints(arm, rng);
    Matrix6X by_errors;
    MakeArmEffect(arm, joints, {})->Evaluate(Eigen::VectorXd::Zero(arm.num_params()), &by_errors);
    auto rows = all.middleRows<6>(6 * i);
    rows.leftCols<6>().setIdentity();
    rows.middleCols<6>(6) = Adjoint(Inverse(BaseFromTip(arm, joints)));
    for (size_t k = 0; k < places.size(); ++k) rows.col(12 + static_cast<Eigen::Index>(k)) = by_errors.col(places[k]);
  }
  return all;
}

Eigen::Index RankOf(const Eigen::MatrixXd& matrix) {
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(matrix);
  qr.setThreshold(1e-9);
  return qr.rank();
}

class EveryArmErrorsTest : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(, EveryArmErrorsTest, testing::ValuesIn(ArmNames()),
                         [](const auto& test) { return test.param; });

// The free parameters are those that the captures can tell apart, and no more can be told apart. An arm of n turning
// joints has 4 n + 6 independent parameters (Mooring, Roth and Driels, "Fundamentals of Manipulator Calibration", 1991,
// section 2.4), of which the poses of base and tool are 12.
TEST_P(EveryArmErrorsTest, FreeParametersAreDeterminedAndComplete) {
  const Arm& arm = *FindArm(GetParam());
  const SharedEffects errors = ArmErrors(arm, ArmErrorModel::kGeometry);
  std::vector<int> places;
  for (const SharedEffect& effect : errors.effects) places.push_back(effect.index);
  EXPECT_EQ(errors.size(), 4 * arm.num_joints() + 6 - 12);
  EXPECT_EQ(RankOf(Sensitivity(arm, places)), 12 + errors.size());
  std::vector<int> all;
  for (int p = 0; p < arm.num_params(); ++p) {
    const bool has_beta = IsParallelToNext(arm, p / kNumArmParams);
    if (IsCompliance(p)) continue;
    if (static_cast<ArmParam>(p % kNumArmParams) != ArmParam::kBeta || has_beta) all.push_back(p);
  }
  EXPECT_EQ(RankOf(Sensitivity(arm, all)), 12 + errors.size());
  EXPECT_EQ(all.size(), errors.effects.size() + UndeterminedParams(arm, Setup::kEyeToHand).size());
}

// The compliances can be told apart from each other and from all errors of the geometry, with and without a payload.
TEST(ArmErrorsTest, CompliancesOfJointsThatCarryAWeightAreDetermined) {
  for (const char* name : {"ur3e", "ur5", "ur5e", "ur10", "ur10e", "ur16e", "ur20"}) {
    for (const double payload_kg : {0.0, 5.0}) {
      const Arm arm = WithPayload(*FindArm(name), {payload_kg, {0.05, 0.02, 0.1}});
      const SharedEffects errors = ArmErrors(arm, ArmErrorModel::kGravity);
      std::vector<int> places;
      int num_compliances = 0;
      for (const SharedEffect& effect : errors.effects) {
        places.push_back(effect.index);
        num_compliances += IsCompliance(effect.index) ? 1 : 0;
      }
      EXPECT_EQ(errors.size(), ArmErrors(arm, ArmErrorModel::kGeometry).size() + num_compliances);
      // Joint 1 is vertical. Of the wrist alone, at most joint 4 carries a weight that counts.
      EXPECT_THAT(num_compliances, testing::AllOf(testing::Ge(2), testing::Le(payload_kg == 0 ? 3 : 5))) << name;
      Eigen::MatrixXd sensitivity = Sensitivity(arm, places);
      sensitivity.colwise().normalize();
      EXPECT_EQ(RankOf(sensitivity), sensitivity.cols()) << name;
    }
  }
}

TEST(ArmErrorsTest, JointsWithoutAWeightDoNotYield) {
  EXPECT_THAT(JointsThatYield(*FindArm("ur5e")), testing::ElementsAre(false, true, true, false, false, false));
  // Joint 6 turns the payload about an axis through its centre of mass.
  EXPECT_THAT(JointsThatYield(WithPayload(*FindArm("ur5e"), {5, {0, 0, 0.15}})),
              testing::ElementsAre(false, true, true, true, true, false));
  EXPECT_THAT(JointsThatYield(*FindArm("abb_irb120")), testing::Each(false));
}

TEST(ArmErrorsTest, OffsetsAreThoseOfTheInnerJoints) {
  const SharedEffects errors = ArmErrors(*FindArm("ur5e"), ArmErrorModel::kOffsets);
  EXPECT_THAT(errors.Names(), testing::ElementsAre("joint2.offset", "joint3.offset", "joint4.offset", "joint5.offset"));
  EXPECT_EQ(errors.groups.size(), 1U);
}

TEST(ArmErrorsTest, UndeterminedParametersNameWhatTheyAreConfusedWith) {
  std::set<std::string> found;
  for (const UndeterminedParam& param : UndeterminedParams(*FindArm("ur5e"), Setup::kEyeInHand)) {
    found.insert(ArmParamName(param.place) + " with " + param.with);
  }
  EXPECT_THAT(found,
              testing::UnorderedElementsAre("joint1.offset with the board's pose", "joint1.d with the board's pose",
                                            "joint3.d with joint2.d", "joint4.d with joint2.d",
                                            "joint6.offset with the hand-eye pose", "joint6.d with the hand-eye pose",
                                            "joint6.a with the hand-eye pose", "joint6.alpha with the hand-eye pose"));
}

}  // namespace
}  // namespace heba
