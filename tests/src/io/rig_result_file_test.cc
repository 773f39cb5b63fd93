#include "heba/io/rig_result_file.h"

#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/files.h"
#include "heba/robot/arm_errors.h"
#include "heba/robot/arm_table.h"
#include "tests/support/input_error.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
using ::testing::HasSubstr;

Rigid3d Shifted(double x_m) { return {ExpRotation({0.1, 0.2, x_m}), {x_m, 0, 0}}; }

// A rig with a camera and a target on these mounts.
RigProblem RigOf(const std::vector<std::string>& arms, const std::string& camera, const std::string& target) {
  RigProblem rig;
  rig.robots = arms;
  rig.cameras.push_back({"top", *FindMount(arms, camera), {}});
  rig.cameras.back().mount_name = camera;
  rig.targets.push_back({"plate", *FindMount(arms, target), {}});
  rig.targets.back().mount_name = target;
  return rig;
}

class RigTruthTest : public testing::Test {
 protected:
  // Writes the truth of a rig, and reads it for another one.
  RigTruth ReadFor(const RigProblem& rig, const RigProblem& written) {
    WriteFileAtomically(folder_ / "truth.json", RigTruthToJson(written, TruthOf(written)));
    return ReadRigTruth(folder_ / "truth.json", rig);
  }
  static RigTruth TruthOf(const RigProblem& rig) {
    RigTruth truth{{Shifted(1)}, {Shifted(2)}, {Rigid3d()}, {std::nullopt}};
    for (size_t r = 1; r < rig.robots.size(); ++r) truth.world_from_base.emplace_back(Shifted(3));
    return truth;
  }
  const TempFolder folder_;
};

TEST_F(RigTruthTest, AMountMayHaveAnyOfItsNames) {
  const RigTruth one = ReadFor(RigOf({"arm"}, "base", "gripper"), RigOf({"arm"}, "world", "arm.gripper"));
  EXPECT_THAT(one.mount_from_camera[0], IsNearPose(Shifted(1), 1e-12, 1e-12));
  EXPECT_THAT(*one.mount_from_target[0], IsNearPose(Shifted(2), 1e-12, 1e-12));
  const RigTruth two =
      ReadFor(RigOf({"left", "right"}, "left.base", "world"), RigOf({"left", "right"}, "world", "left.base"));
  EXPECT_THAT(two.mount_from_camera[0], IsNearPose(Shifted(1), 1e-12, 1e-12));
  EXPECT_THAT(*two.world_from_base[1], IsNearPose(Shifted(3), 1e-12, 1e-12));
}

TEST_F(RigTruthTest, AnotherMountIsRefused) {
  EXPECT_THAT(InputErrorOf([&] { ReadFor(RigOf({"arm"}, "gripper", "world"), RigOf({"arm"}, "world", "world")); }),
              HasSubstr("cameras: top: pose: is the pose of 'top' in 'world'; that of 'top' in 'gripper' is needed"));
  EXPECT_THAT(InputErrorOf([&] {
                ReadFor(RigOf({"left", "right"}, "right.base", "world"), RigOf({"left", "right"}, "world", "world"));
              }),
              HasSubstr("that of 'top' in 'right.base' is needed"));
}

// What is not known is no identity.
TEST_F(RigTruthTest, PosesOfTargetsAndBasesMayBeUnknown) {
  const RigProblem rig = RigOf({"left", "right"}, "world", "world");
  RigTruth truth = TruthOf(rig);
  truth.mount_from_target[0].reset();
  truth.world_from_base[1].reset();
  WriteFileAtomically(folder_ / "truth.json", RigTruthToJson(rig, truth));
  const RigTruth read = ReadRigTruth(folder_ / "truth.json", rig);
  EXPECT_FALSE(read.mount_from_target[0].has_value());
  EXPECT_FALSE(read.world_from_base[1].has_value());
  EXPECT_TRUE(read.world_from_base[0].has_value());
}

// A rig with two arms, of which the errors of the second were estimated, and those of the first declined.
RigResult ResultWithArms() {
  RigResult result;
  result.name = "cell";
  result.rig = RigOf({"left", "right"}, "world", "right.gripper");
  RigSolution& solution = result.solution;
  solution.poses = {{Shifted(1)}, {Shifted(2)}, {Rigid3d(), Shifted(3)}};
  solution.cameras = {{"pinhole", 64, 48, {60, 60, 32, 24}}};
  result.rig.cameras[0].camera = solution.cameras[0];
  solution.shapes.resize(1);
  solution.pixel_sigmas_px = {0.1};
  solution.image_sigmas_px = {0};
  solution.robot_noise = {RobotNoise{1e-4, 1e-3, 0}, RobotNoise{2e-5, 1e-4, 0}};
  solution.robot_noise_stddev.resize(2);
  result.target_types = {"chessboard"};
  result.errors.resize(1);
  const Arm nominal = *FindArm("ur10e");
  for (const bool is_estimated : {false, true}) {
    RobotSummary& robot = result.arms.emplace_back(RobotSummary()).value();
    robot.nominal = nominal;
    robot.tip_from_gripper = Shifted(0.1);
    robot.has_recorded_joints = is_estimated;
    robot.configuration = is_estimated ? "" : "shoulder +, elbow -, wrist +";
    robot.is_estimated = is_estimated;
    robot.reason = is_estimated ? "" : "they are not significantly better";
    robot.errors = Eigen::VectorXd::Zero(nominal.num_params());
    robot.error_sigmas.resize(static_cast<size_t>(nominal.num_params()));
    robot.undetermined = {{"joint1.offset", "the poses of what is fixed in the base"}};
    robot.noise_before = RobotNoise{1e-4, 1e-3, 0};
    robot.noise_after = RobotNoise{2e-5, 1e-4, 0};
  }
  const auto shared = std::make_shared<const SharedEffects>(ArmErrors(nominal, ArmErrorModel::kGeometry));
  result.rig.effects = {nullptr, shared};
  // Lengths of which the sums with those of the arm lose digits.
  solution.effects = {Eigen::VectorXd(), 1e-3 * Eigen::VectorXd::LinSpaced(shared->size(), -1.0 / 3, 1.0 / 7)};
  solution.effect_sigmas = {{}, std::vector<double>(shared->groups.size(), 2e-4)};
  RobotSummary& estimated = *result.arms[1];
  estimated.errors_name = shared->name;
  estimated.errors = AllEffects(*shared, solution.effects[1]);
  for (const SharedEffect& effect : shared->effects) estimated.error_sigmas[static_cast<size_t>(effect.index)] = 1e-4;
  solution.covariance.layout = RigUnknowns(result.rig);
  const Eigen::Index size = solution.covariance.layout.size();
  const Eigen::MatrixXd root = Eigen::MatrixXd::Identity(size, size) + Eigen::MatrixXd::Constant(size, size, 0.25);
  solution.covariance.matrix = 1e-8 * root * root.transpose();
  return result;
}

TEST(RigResultFileTest, ErrorsOfArmsAreReadAsTheyWereWritten) {
  const TempFolder folder;
  const RigResult written = ResultWithArms();
  const std::string text = RigResultToJson(written);
  WriteFileAtomically(folder / "result.json", text);
  const RigResult read = ReadRigResult(folder / "result.json");
  EXPECT_EQ(RigResultToJson(read), text);
  EXPECT_EQ(FindEstimatedArm(read, 0), nullptr);
  EXPECT_EQ(WhyNotEstimated(read, 0),
            "the kinematics of the arm left were not estimated (they are not significantly better)");
  const RobotSummary* const arm = FindEstimatedArm(read, 1);
  ASSERT_NE(arm, nullptr);
  EXPECT_EQ(arm->errors_name, written.arms[1]->errors_name);
  EXPECT_EQ(read.solution.effects[1], written.solution.effects[1]);
  EXPECT_EQ(read.solution.effect_sigmas, written.solution.effect_sigmas);
  EXPECT_EQ(read.rig.effects[0], nullptr);
  EXPECT_EQ(read.rig.effects[1]->Names(), written.rig.effects[1]->Names());
  EXPECT_EQ(read.solution.covariance.layout.Names(), written.solution.covariance.layout.Names());
  EXPECT_EQ(read.solution.covariance.matrix, written.solution.covariance.matrix);
}

TEST(RigResultFileTest, AnUnknownParameterOfAnArmIsRefused) {
  const TempFolder folder;
  std::string text = RigResultToJson(ResultWithArms());
  const size_t at = text.find("\"joint2.offset\"", text.find("\"estimated\": {"));
  ASSERT_NE(at, std::string::npos);
  text.replace(at, 15, "\"joint9.offset\"");
  WriteFileAtomically(folder / "result.json", text);
  EXPECT_THAT(InputErrorOf([&] { ReadRigResult(folder / "result.json"); }),
              HasSubstr("'joint9.offset' is estimated, but the arm has no such parameter"));
}

}  // namespace
}  // namespace heba
