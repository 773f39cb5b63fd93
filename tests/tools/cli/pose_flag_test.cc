#include "tools/cli/pose_flag.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/units.h"
#include "tests/support/input_error.h"
#include "tests/support/matchers.h"

namespace heba {
namespace {
using ::testing::HasSubstr;
using ::testing::StartsWith;

std::string ErrorOf(const std::string& text, const std::string& format = "ros") {
  return InputErrorOf([&] { PoseOfFlag("near", text, *FindPoseFormat(format)); });
}

TEST(PoseFlagTest, ReadsTheNumbersOfTheFormat) {
  EXPECT_THAT(PoseOfFlag("pose", "0.1,0.2,0.3,0,0,1,0", *FindPoseFormat("ros")),
              IsNearPose(Rigid3d(ExpRotation({0, 0, kPi}), {0.1, 0.2, 0.3}), 1e-9, 1e-12));
  EXPECT_THAT(PoseOfFlag("pose", " 100, -200 ,300 , 90,0,0 ", *FindPoseFormat("kuka")),
              IsNearPose(Rigid3d(ExpRotation({0, 0, kPi / 2}), {0.1, -0.2, 0.3}), 1e-9, 1e-12));
}

TEST(PoseFlagTest, StatesTheColumnsIfTheirNumberIsWrong) {
  EXPECT_EQ(ErrorOf("0.1,0.2,0.3"), "--near: 3 numbers; 7 are needed: x,y,z,qx,qy,qz,qw");
  EXPECT_EQ(ErrorOf("0,0,0,0,0,0,1,0"), "--near: 8 numbers; 7 are needed: x,y,z,qx,qy,qz,qw");
  EXPECT_EQ(ErrorOf("1", "kuka"), "--near: 1 numbers; 6 are needed: x,y,z,a,b,c");
}

TEST(PoseFlagTest, NamesWhatIsNoNumber) {
  EXPECT_EQ(ErrorOf("0.1,O.2,0.3,0,0,0,1"), "--near: 'O.2' is not a number");
  EXPECT_EQ(ErrorOf("0.1,,0.3,0,0,0,1"), "--near: '' is not a number");
  EXPECT_EQ(ErrorOf(""), "--near: '' is not a number");
  EXPECT_EQ(ErrorOf("100 mm,0,0,0,0,0", "kuka"), "--near: '100 mm' is not a number");
}

TEST(PoseFlagTest, RefusesNumbersThatAreNoPose) {
  EXPECT_THAT(ErrorOf("0,0,0,0,0,0,2"), StartsWith("--near: "));
  EXPECT_THAT(ErrorOf("0,0,0,0,0,0,2"), HasSubstr("quaternion"));
  EXPECT_EQ(ErrorOf("nan,0,0,0,0,0,1"), "--near: 'x' is not finite");
}

}  // namespace
}  // namespace heba
