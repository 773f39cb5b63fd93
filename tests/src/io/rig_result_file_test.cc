#include "heba/io/rig_result_file.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/files.h"
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

}  // namespace
}  // namespace heba
