#include "tools/text/failure_text.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/failure_code.h"

namespace heba {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(FailureTextTest, TextsWithPlaceholdersHaveTheFiguresAndNames) {
  const std::vector<std::pair<Failure, std::string>> cases = {
      {{FailureCode("few_captures"), {{"captures", 1}}}, "at least 3 captures with the target are needed, there is 1"},
      {{FailureCode("few_captures"), {{"captures", 2}}}, "at least 3 captures with the target are needed, there are 2"},
      {{FailureCode("one_axis"), {{"rms_deg", 12.34}, {"x", 0}, {"y", 0}, {"z", -1}, {"other_deg", 0.123}}},
       "the robot rotated about one axis only (12.3 deg rms about [0.00, 0.00, -1.00], 0.12 deg about any other), so "
       "the translation of the hand-eye pose along that axis is undetermined; rotate the gripper about a second axis "
       "by 20 deg or more"},
      {{FailureCode("few_rotations"), {{"rotations", 1}, {"least_deg", 0.5}}},
       "1 rotation about the tool point (role rotate) rotate the least observable direction by 0.50 deg in total: two "
       "or more about different axes, by 10 deg or more, are needed"},
      {{FailureCode("few_coordinates"), {{"coordinates", 12}, {"unknowns", 16}}},
       "12 measured coordinates for 16 unknowns are too few; take more captures or hold the intrinsics"},
      {{FailureCode("large_sigma"), {{"sigma_deg", 45.678}}, {{"unknown", "hand_eye.rx_rad"}}},
       "the captures do not determine the hand-eye rotation about the camera's x (one sigma 46 deg); more captures "
       "with "
       "larger rotations about different axes are needed"},
      {{FailureCode("ambiguous_part"),
        {{"poses", 2}, {"symmetries", 2}},
        {{"part", "camera left"}, {"target", "wall"}}},
       "the images allow 2 poses of camera left, because target wall looks the same in 2 orientations and no other "
       "images distinguish them; use a target without symmetry, or record images of another target that join camera "
       "left to the rest"},
      {{FailureCode("arm_carries_nothing"), {{"arms", 2}}, {{"arm", "right"}, {"mount", "right.gripper"}}},
       "arm right carries no camera and no target, so that no image joins it to the rest; give one the mount "
       "right.gripper, or leave the arm out"},
      {{FailureCode("arm_carries_nothing"), {{"arms", 1}}, {{"arm", "robot"}, {"mount", "gripper"}}},
       "arm robot carries no camera and no target, so that no image joins it to the rest; give one the mount gripper"},
      {{FailureCode("pair_without_pose"), {{"images", 1}}, {{"camera", "a"}, {"target", "b"}, {"part", "camera a"}}},
       "camera a and target b (1 image): no image shows enough points for the pose of the target, and no other images "
       "join camera a to the rest"},
      {{FailureCode("pair_failed"), {{"images", 3}}, {{"camera", "a"}, {"target", "b"}}, {FailureCode("on_two_arms")}},
       "camera a and target b (3 images) could not be calibrated, and no other images join them to the rest: they are "
       "on "
       "two arms; each needs images with something else, for example a fixed target"},
      {{FailureCode("no_better_than_noise"), {{"gain", 1.234}, {"parameters", 6}}, {{"errors", "joint offsets"}}},
       "'joint offsets' is not significantly better than the noise of the poses alone (log-likelihood higher by 1.2 "
       "with 6 more parameters)"},
      {NotRun(), "not run"},
      {Failure(), ""},
      {Failure("in <words> of {its} own"), "in <words> of {its} own"}};
  for (const auto& [failure, words] : cases) EXPECT_EQ(FailureText(failure), words);
}

TEST(FailureTextTest, OptionalNamesAreLeftOut) {
  const auto hidden = [](const std::string& camera) {
    return FailureText({FailureCode("hidden_at_start"), {}, {{"capture", "7"}, {"camera", camera}}});
  };
  EXPECT_EQ(hidden(""),
            "at the initial guess the target of capture 7 lies behind the camera; try another seed, or check the setup "
            "and the direction of the poses");
  EXPECT_EQ(hidden("left"),
            "at the initial guess the target of capture 7 in camera left lies behind the camera; check the mounts and "
            "the direction of the poses");
  const auto pixel = [](const std::string& camera) {
    return FailureText(
        {FailureCode("of_pixel"), {{"u", 320.5}, {"v", 240}}, {{"camera", camera}}, {FailureCode("no_ray")}});
  };
  EXPECT_EQ(pixel(""), "pixel 320.500, 240.000: no ray belongs to this pixel");
  EXPECT_EQ(pixel("left"), "pixel 320.500, 240.000 of camera left: no ray belongs to this pixel");
  const auto undetected = [](const std::string& why) {
    return FailureText({FailureCode("nothing_detected"), {{"images", 14}}, {{"image", "0.png"}, {"why", why}}});
  };
  EXPECT_EQ(undetected("too dark"),
            "the target was not detected in any of the 14 images (0.png: too dark); is it the target that the config "
            "names?");
  EXPECT_EQ(undetected(""),
            "the target was not detected in any of the 14 images; is it the target that the config names?");
  EXPECT_EQ(FailureText({FailureCode("implausible_refined_camera"), {}, {{"camera", ""}, {"faults", "fx is 0"}}}),
            "the refined camera is implausible: fx is 0");
  EXPECT_EQ(FailureText({FailureCode("no_pose"), {{"points", 3}}}),
            "the 3 visible points do not determine the target's pose");
  EXPECT_EQ(FailureText(FailureCode("no_pose")),
            "the points that the cameras see do not determine a pose of the target");
}

TEST(FailureTextTest, ListsOfNames) {
  const Failure alone{FailureCode("not_joined"), {}, {{"part", "arm right"}}};
  EXPECT_EQ(FailureText(alone),
            "arm right is not joined to the rest by any image: a camera of both must see one target");
  const Failure several{FailureCode("not_joined"),
                        {},
                        {{"part", "camera side"},
                         {"part", "camera top"},
                         {"part", "arm right"},
                         {"of_camera", "top"},
                         {"of_target", "disk"},
                         {"of_camera", "side"},
                         {"of_target", "plate"}}};
  EXPECT_EQ(
      FailureText(several),
      "camera side, camera top and arm right are not joined to the rest by any image: images are needed of camera "
      "top with target disk or camera side with target plate");
  const Failure blind{
      FailureCode("camera_without_target"), {}, {{"camera", "blind"}, {"target", "plate"}, {"target", "wall"}}};
  EXPECT_EQ(FailureText(blind),
            "camera blind saw no target in any image, so that nothing joins it to the rest: the rig has targets plate, "
            "wall; add the one that it sees, or leave the camera out");
  const auto shifted = [](double shift) {
    return FailureText({FailureCode("shifted_images"), {{"shift", shift}}, {{"camera", "c"}}});
  };
  EXPECT_EQ(shifted(-1),
            "the images of camera c fit the poses of the captures one place before their own: its images are shifted "
            "against the poses; check which image is its first");
  EXPECT_THAT(shifted(2), HasSubstr("captures 2 places after their own"));
}

TEST(FailureTextTest, UnknownsHaveNames) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"hand_eye.ty_m", "the hand-eye translation along the camera's y"},
      {"board.rx_rad", "the board's rotation about the target's x"},
      {"camera.fy", "the camera's fy"},
      {"target.scale_y", "the target's scale along y"},
      {"target.bend_x_m", "the target's bend along x"},
      {"robot.joint2.offset", "the arm's joint2.offset"},
      {"cameras.left.pose.rz_rad", "camera left's rotation about the camera's z"},
      {"cameras.left.camera.k1", "camera left's k1"},
      {"targets.wall.pose.tx_m", "target wall's translation along the target's x"},
      {"targets.wall.shape.scale_x", "target wall's scale along x"},
      {"robots.right.world_from_base.tz_m", "arm right's translation along its base's z"},
      {"robots.right.errors.joint2.offset", "arm right's joint2.offset"}};
  for (const auto& [name, words] : cases) EXPECT_EQ(UnknownText(name), words);
}

// The keys of a config are for users of a config.
TEST(FailureTextTest, KeysCanBeOmitted) {
  const Failure undetermined{FailureCode("undetermined"),
                             {},
                             {{"of_camera", "cameras.left.camera"},
                              {"unknown", "cameras.left.camera.fx"},
                              {"of_target", "targets.wall.shape"},
                              {"unknown", "cameras.left.pose.tz_m"}}};
  EXPECT_EQ(FailureText(undetermined),
            "the captures do not determine camera left's fx together with camera left's translation along the camera's "
            "z; move the target through more depth and tilt, or hold intrinsics (cameras.left.refine.intrinsics), or "
            "hold the target's shape (refine.target_shape)");
  EXPECT_THAT(FailureText(undetermined, ConfigKeys::kOmitted),
              HasSubstr("tilt, or hold intrinsics, or hold the target's shape"));
  const Failure unseen{FailureCode("no_information"), {}, {{"unknown", "camera.cx"}, {"of_camera", "camera"}}};
  EXPECT_EQ(FailureText(unseen),
            "the data do not determine the camera's cx; hold it with a camera file and refine.intrinsics");
  EXPECT_EQ(FailureText(unseen, ConfigKeys::kOmitted),
            "the data do not determine the camera's cx; hold it with a camera file");
  const Failure held{FailureCode("record_joints"), {}, {}, {FailureCode("held_arm_noise")}};
  EXPECT_EQ(FailureText(held),
            "the errors of an arm are estimated beside the noise of its poses, which refine.robot_noise holds; if the "
            "captures are in several configurations, record their joints (captures.joints)");
  EXPECT_EQ(FailureText(held, ConfigKeys::kOmitted),
            "the errors of an arm are estimated beside the noise of its poses, which is held; if the captures are in "
            "several configurations, record their joints");
  for (const std::string_view code : kFailureCodes) {
    Failure failure;
    failure.code = code;
    failure.numbers = {{"shift", 1}};
    failure.names = {{"unknown", "camera.fx"}, {"of_camera", "camera"}, {"of_target", "target"}, {"part", "camera a"}};
    const std::string words = FailureText(failure, ConfigKeys::kOmitted);
    EXPECT_NE(words, code);
    for (const char* key : {"refine.", "captures.", "robot.", "camera.intrinsics", "config names", "heba "}) {
      EXPECT_THAT(words, Not(HasSubstr(key)));
    }
    EXPECT_EQ(words.find_first_of("{}<>"), std::string::npos) << words;
  }
}

TEST(FailureTextTest, AnUnknownCodeIsShownAsItIs) {
  Failure failure;
  failure.code = "of_a_newer_version";
  failure.numbers = {{"captures", 3}};
  EXPECT_EQ(FailureText(failure), "of_a_newer_version (captures 3)");
}

}  // namespace
}  // namespace heba
