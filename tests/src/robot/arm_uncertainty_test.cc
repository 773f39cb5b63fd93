#include "heba/evaluation/arm_uncertainty.h"

#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "heba/base/units.h"
#include "heba/robot/arm_errors.h"
#include "heba/robot/arm_table.h"
#include "heba/simulation/arm_captures.h"

namespace heba {
namespace {

constexpr double kErrorRad = 1e-3;
constexpr double kSigmaRad = 2e-4;

// A UR5e of which only the offset of one joint has an error.
struct OneError {
  RobotSummary robot;
  PairSolution solution;
  std::vector<Rigid3d> base_from_gripper;
};

OneError MakeOneError(int joint) {
  OneError made;
  made.robot.nominal = *FindArm("ur5e");
  made.robot.is_estimated = true;
  SharedEffects shared;
  shared.num_all = made.robot.nominal.num_params();
  shared.groups = {{"offsets", "rad", kSigmaRad}};
  const int place = ArmParamPlace(joint, ArmParam::kTheta);
  shared.effects = {{ArmParamName(place), place, 0}};
  made.solution.covariance.layout.AddEffects(kRobotBlock, shared.Names());
  made.solution.covariance.matrix = Eigen::MatrixXd::Constant(1, 1, kSigmaRad * kSigmaRad);
  made.solution.effects = Eigen::VectorXd::Constant(1, kErrorRad);
  made.solution.shared_effects = std::make_shared<const SharedEffects>(std::move(shared));
  Eigen::VectorXd joints(6);
  joints << 0.3, -1.2, 1.4, -1.1, -1.3, 0.5;
  made.robot.configuration = NameOf(*ConfigurationOf(made.robot.nominal, joints));
  for (const double swing_rad : {-0.2, 0.0, 0.2}) {
    Eigen::VectorXd swung = joints;
    swung[0] += swing_rad;
    made.base_from_gripper.push_back(BaseFromTip(made.robot.nominal, swung));
  }
  return made;
}

// An offset of the first joint moves the gripper on a circle about the base's z axis.
TEST(ArmUncertaintyTest, MapOfTheFirstJointsOffsetGrowsWithTheDistanceFromItsAxis) {
  const OneError one = MakeOneError(0);
  for (const int vertical_axis : {1, 2}) {
    const std::optional<ArmMap> map =
        MapArm(LocatorOf(Setup::kEyeInHand, one.solution), one.robot, one.base_from_gripper, vertical_axis);
    ASSERT_TRUE(map.has_value());
    EXPECT_EQ(map->configuration, one.robot.configuration);
    EXPECT_GT(map->cells.size(), 100U);
    EXPECT_LE(map->cells.size(), 400U);
    for (const ArmMap::Cell& cell : map->cells) {
      const double radius_m = cell.middle_m.head<2>().norm();
      EXPECT_LT(cell.middle_m.norm(), 1.2);  // The arm reaches 0.95 m from its shoulder.
      EXPECT_NEAR(cell.correction_m, 2 * std::sin(kErrorRad / 2) * radius_m, 1e-9);
      EXPECT_NEAR(cell.sigma_m, kSigmaRad * radius_m / std::sqrt(3.0), 1e-9);
    }
  }
}

// The flips of elbow and wrist leave the axis of the second joint where it is, that of the shoulder moves it.
TEST(ArmUncertaintyTest, FlipsThatLeaveTheWrongAxisKeepTheSigma) {
  const OneError one = MakeOneError(1);
  const std::optional<ConfigurationSigmas> sigmas =
      SigmasByConfiguration(LocatorOf(Setup::kEyeInHand, one.solution), one.robot, one.base_from_gripper);
  ASSERT_TRUE(sigmas.has_value());
  const auto relative = [&](size_t flip) { return sigmas->flipped_m[flip].value_or(-1) / sigmas->captured_m; };
  constexpr double kExact = 1e-6;
  EXPECT_NEAR(relative(1), 1, kExact);
  EXPECT_NEAR(relative(2), 1, kExact);
  EXPECT_GT(std::abs(relative(0) - 1), 1e-3);
  EXPECT_GT(relative(0), 0);
}

TEST(ArmUncertaintyTest, SeveralConfigurationsHaveNoFlippedOne) {
  OneError one = MakeOneError(2);
  one.robot.configuration = "";
  EXPECT_FALSE(
      SigmasByConfiguration(LocatorOf(Setup::kEyeInHand, one.solution), one.robot, one.base_from_gripper).has_value());
}

// The gripper's position relative to a target does not depend on an error that moves both alike.
TEST(ArmUncertaintyTest, CommonErrorsOfGripperAndTargetCancel) {
  OneError one = MakeOneError(0);
  PairSolution& solution = one.solution;
  solution.hand_eye.target_mount_from_target = Rigid3d(ExpRotation({0.1, 2, -0.3}), {0.4, -0.2, 0.1});
  UnknownLayout layout;
  layout.AddPose(kBoardBlock);
  layout.AddEffects(kRobotBlock, solution.shared_effects->Names());
  solution.covariance.layout = layout;
  // The target turns about the base's z axis, in its own frame, with the offset.
  Eigen::VectorXd by_offset(7);
  Tangent6 about_z = Tangent6::Zero();
  about_z[5] = 1;
  by_offset.head<6>() = Adjoint(Inverse(solution.hand_eye.target_mount_from_target)) * about_z;
  by_offset[6] = 1;
  solution.covariance.matrix = kSigmaRad * kSigmaRad * by_offset * by_offset.transpose();
  const Outcome<StatedPose> stated = WithArmErrors(one.robot, one.base_from_gripper.front());
  ASSERT_TRUE(stated.ok()) << stated.reason();
  EXPECT_LT(SigmaM(LocatorOf(Setup::kEyeInHand, solution)(*stated).covariance_m2), 1e-9);
  // A covariance without the correlation does not cancel.
  solution.covariance.matrix.topRightCorner<6, 1>().setZero();
  solution.covariance.matrix.bottomLeftCorner<1, 6>().setZero();
  EXPECT_GT(SigmaM(LocatorOf(Setup::kEyeInHand, solution)(*stated).covariance_m2), 1e-5);
}

// The gripper of the second arm of a rig: errors of its base do not move it against a camera on that base, but do
// against one on the base of the other arm; errors of the camera's pose act over the lever between both.
TEST(ArmUncertaintyTest, GripperOfACellIsRelativeToTheFixedPart) {
  Problem rig;
  rig.robots = {"left", "right"};
  Camera camera;
  camera.model = "pinhole";
  rig.cameras = {{"carried", {1, Mount::Part::kGripper}, camera},
                 {"near", {1, Mount::Part::kBase}, camera},
                 {"far", {0, Mount::Part::kBase}, camera}};
  const std::optional<FixedPart> fixed = FindFixedPart(rig);
  ASSERT_TRUE(fixed.has_value());
  EXPECT_EQ(fixed->Name(rig), "camera near");
  Solution solution;
  solution.poses.world_from_base = {Rigid3d(), Rigid3d(ExpRotation({0.1, 0.2, 2}), {1, 0.2, 0.1})};
  solution.poses.mount_from_camera = {Rigid3d(), Rigid3d(ExpRotation({1, -1, 0.5}), {0.2, 0.3, 1}),
                                      Rigid3d(ExpRotation({-1, 2, 0.5}), {0.1, -0.3, 1.2})};
  UnknownLayout& layout = solution.covariance.layout;
  layout = UnknownsOf(rig);
  const Rigid3d stated(ExpRotation({0.3, 0.2, 0.1}), {0.5, 0.1, 0.4});
  const auto sigma_m = [&](size_t index) {
    return SigmaM(LocatorOf(rig, solution, 1, {FixedPart::Kind::kCamera, index})(stated).covariance_m2);
  };
  constexpr double kSigmaM = 1e-3;
  const auto set_variances = [&](const std::string& block_name, Eigen::Index first, double sigma) {
    solution.covariance.matrix.setZero(layout.size(), layout.size());
    const UnknownBlock block = layout.Block(block_name);
    solution.covariance.matrix.diagonal().segment<3>(block.first + first).setConstant(sigma * sigma);
  };
  for (const Eigen::Index first : {0, 3}) {
    set_variances(BaseBlock("right"), first, kSigmaM);
    EXPECT_NEAR(sigma_m(1), 0, 1e-12) << first;
    // A rotation about any axis, over the distance from the base.
    const double lever_m = first == 0 ? 1 : stated.translation.norm() * std::sqrt(2 / 3.0);
    EXPECT_NEAR(sigma_m(2), kSigmaM * lever_m, 1e-12) << first;
  }
  set_variances(CameraPoseBlock(rig.cameras[1]), 3, kSigmaM);
  const double distance_m = (Inverse(solution.poses.mount_from_camera[1]) * stated.translation).norm();
  EXPECT_NEAR(sigma_m(1), kSigmaM * distance_m * std::sqrt(2 / 3.0), 1e-12);
  EXPECT_NEAR(sigma_m(2), 0, 1e-12);
}

TEST(WithErrorsOfArmTest, JointsDecideWhichErrorsAPoseHas) {
  OneError one = MakeOneError(0);
  one.robot.errors = Eigen::VectorXd::Zero(one.robot.nominal.num_params());
  const Rigid3d& stated = one.base_from_gripper.front();
  // Without an arm, a pose has no errors, and joints are of no use.
  EXPECT_EQ(WithErrorsOfArm(nullptr, stated, std::nullopt)->effect, nullptr);
  EXPECT_NE(WithErrorsOfArm(nullptr, stated, Eigen::VectorXd::Zero(6)).reason().find("leave them out"),
            std::string::npos);
  // All captures are in one configuration: the pose tells the joints.
  EXPECT_NE(WithErrorsOfArm(&one.robot, stated, std::nullopt)->effect, nullptr);
  Eigen::VectorXd joints(6);
  joints << 0.1, -1.2, 1.4, -1.1, -1.3, 0.5;
  EXPECT_NE(WithErrorsOfArm(&one.robot, stated, joints)->effect, nullptr);
  EXPECT_FALSE(WithErrorsOfArm(&one.robot, stated, Eigen::VectorXd::Zero(6)).ok());
  EXPECT_EQ(WithErrorsOfArm(&one.robot, stated, Eigen::VectorXd::Zero(7)).reason(),
            "there are 7, but the arm ur5e has 6");
  RobotSummary several = one.robot;
  several.configuration.clear();
  EXPECT_FALSE(WithErrorsOfArm(&several, stated, std::nullopt).ok());
  EXPECT_NE(WithErrorsOfArm(&several, stated, joints)->effect, nullptr);
}

}  // namespace
}  // namespace heba
