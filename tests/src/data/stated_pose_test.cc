#include "heba/data/stated_pose.h"

#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "heba/base/rng.h"
#include "heba/robot/arm_errors.h"
#include "heba/robot/arm_table.h"
#include "tests/support/arm_joints.h"

namespace heba {
namespace {

// A capture has its effect as a function of the estimated effects, and a stated pose as one of all.
TEST(StatedPoseTest, EffectOfACaptureIsThatOfAllEffects) {
  Rng rng(3);
  const Arm& arm = *FindArm("ur5e");
  const auto shared = std::make_shared<const SharedEffects>(ArmErrors(arm, ArmErrorModel::kGeometry));
  ASSERT_LT(shared->size(), arm.num_params());
  const std::shared_ptr<const PoseEffect> of_all = MakeArmEffect(arm, RandomJoints(arm, rng), Rigid3d());
  std::vector<int> estimated;
  for (const SharedEffect& effect : shared->effects) estimated.push_back(effect.index);
  Problem rig;
  rig.robots = {"arm"};
  rig.effects = {shared};
  ProblemCapture capture{"first", {Rigid3d(ExpRotation({0.1, 0.2, 0.3}), {0.4, 0.5, 0.6})}, {}};
  capture.effects = {SelectEffects(of_all, arm.num_params(), estimated)};
  const StatedPose stated = StatedPoseOf(rig, capture, 0);
  EXPECT_EQ(DistanceM(stated.base_from_mount, capture.base_from_gripper[0]), 0);
  Eigen::VectorXd values(shared->size());
  for (double& value : values) value = 1e-3 * rng.Normal();
  const Eigen::VectorXd all = AllEffects(*shared, values);
  Matrix6X by_all;
  Matrix6X by_stated;
  const Rigid3d expected = of_all->Evaluate(all, &by_all);
  EXPECT_LT(LocalCoordinates(expected, stated.effect->Evaluate(all, &by_stated)).norm(), 1e-12);
  ASSERT_EQ(by_stated.cols(), arm.num_params());
  for (const int place : estimated) EXPECT_LT((by_stated.col(place) - by_all.col(place)).norm(), 1e-12) << place;
}

TEST(StatedPoseTest, ArmsWithoutEffectsHaveNone) {
  Problem rig;
  rig.robots = {"arm"};
  const ProblemCapture capture{"first", {Rigid3d()}, {}};
  EXPECT_EQ(StatedPoseOf(rig, capture, 0).effect, nullptr);
}

}  // namespace
}  // namespace heba
