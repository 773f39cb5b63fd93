#include "heba/data/unknowns.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace heba {
namespace {

std::vector<bool> Free(const CameraModel& model, std::vector<int> params, bool has_shape) {
  std::vector<bool> free(static_cast<size_t>(NumParams(model)), false);
  for (const int param : params) free[static_cast<size_t>(param)] = true;
  if (has_shape) free.insert(free.end(), {false, true, true, false, false, false, false, false, false});
  return free;
}

TEST(UnknownLayoutTest, NamesTheUnknownsOfACalibrationInTheirOrder) {
  const CameraModel& model = *FindCameraModel("brown5");
  const UnknownLayout layout = HandEyeUnknowns(model, Free(model, {1, 2, 8}, true));
  ASSERT_EQ(layout.size(), 17);
  const std::vector<std::string> names = layout.Names();
  EXPECT_EQ(names[0], "hand_eye.tx_m");
  EXPECT_EQ(names[5], "hand_eye.rz_rad");
  EXPECT_EQ(names[6], "board.tx_m");
  EXPECT_THAT(std::vector<std::string>(names.begin() + 12, names.end()),
              testing::ElementsAre("camera.fy", "camera.cx", "camera.k3", "target.scale_y", "target.bend_x_m"));
  for (Eigen::Index i = 0; i < layout.size(); ++i) EXPECT_EQ(layout.Place(names[static_cast<size_t>(i)]), i);
  EXPECT_EQ(layout.Place("camera.fx"), std::nullopt);
}

TEST(UnknownLayoutTest, KnowsGroupAndIndexOfEveryUnknown) {
  const CameraModel& model = *FindCameraModel("brown5");
  const UnknownLayout layout = HandEyeUnknowns(model, Free(model, {1, 2, 8}, true));
  const auto expect = [&](Eigen::Index place, UnknownGroup group, int index) {
    EXPECT_EQ(layout[place].group, group) << place;
    EXPECT_EQ(layout[place].index, index) << place;
  };
  expect(2, UnknownGroup::kTranslation, 2);
  expect(9, UnknownGroup::kRotation, 3);
  expect(12, UnknownGroup::kFocal, 1);
  expect(13, UnknownGroup::kPrincipalPoint, 2);
  expect(14, UnknownGroup::kDistortion, 8);
  expect(15, UnknownGroup::kScale, 1);
  expect(16, UnknownGroup::kBend, 2);
}

TEST(UnknownLayoutTest, FindsBlocksAlsoThoseWithoutUnknowns) {
  const CameraModel& model = *FindCameraModel("pinhole");
  const UnknownLayout layout = HandEyeUnknowns(model, Free(model, {}, false));
  EXPECT_EQ(layout.size(), 12);
  EXPECT_EQ(layout.Block(kBoardBlock).first, 6);
  EXPECT_EQ(layout.Block(kCameraBlock).size, 0);
  EXPECT_EQ(layout.Block(kTargetBlock).first, 12);
  EXPECT_EQ(layout.Block("no such block").size, 0);
  EXPECT_EQ(layout.BlockAt(7).name, kBoardBlock);
  EXPECT_EQ(layout.BlocksOf(UnknownOwner::kPose).size(), 2U);
  EXPECT_EQ(layout.BlocksOf(UnknownOwner::kCamera).size(), 1U);
}

TEST(UnknownLayoutTest, HoldsSeveralCamerasAndEffects) {
  const CameraModel& model = *FindCameraModel("pinhole");
  UnknownLayout layout;
  layout.AddPose("rig");
  layout.AddEffects("joint_offset", {"1", "2"});
  layout.AddCamera("left", model, {true, true, false, false});
  layout.AddCamera("right", model, {false, false, true, true});
  EXPECT_THAT(layout.Names(),
              testing::ElementsAre("rig.tx_m", "rig.ty_m", "rig.tz_m", "rig.rx_rad", "rig.ry_rad", "rig.rz_rad",
                                   "joint_offset.1", "joint_offset.2", "left.fx", "left.fy", "right.cx", "right.cy"));
  EXPECT_EQ(layout.BlockAt(10).name, "right");
}

}  // namespace
}  // namespace heba
