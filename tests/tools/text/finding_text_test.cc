#include "tools/text/finding_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/failure_code.h"

namespace heba {
namespace {
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

Finding FindingOf(const char* code, std::vector<std::pair<std::string, double>> numbers,
                  std::vector<std::pair<std::string, std::string>> names = {}, std::vector<Finding> parts = {}) {
  return {Grade::kDoubtful, code, std::move(numbers), std::move(names), false, std::move(parts)};
}

std::string TextOf(const Finding& finding) { return FindingWords(finding).text; }
std::string ActionOf(const Finding& finding) { return FindingWords(finding).action; }

Finding WeakFocalLength() {
  return FindingOf(
      "weak_direction", {{"the camera's fx, px", 12}}, {},
      {FindingOf("weak_direction_of", {{"sigma", 12}}, {{"direction", "the camera's fx"}, {"unit", "px"}}),
       FindingOf("weak_direction_of", {{"sigma", 1.5}},
                 {{"direction", "the target's position along the gripper's z"}, {"unit", "mm"}}),
       FindingOf(
           "suggested_captures", {{"distance_mm", 250}, {"sigma", 3}},
           {{"motion", "nearer_and_farther"}, {"moved", "target"}, {"direction", "the camera's fx"}, {"unit", "px"}})});
}

TEST(FindingTextTest, EachCodeHasWords) {
  for (const std::string_view code : kFindingCodes) {
    const std::string text = TextOf({Grade::kDoubtful, std::string(code)});
    EXPECT_NE(text, "") << code;
    EXPECT_NE(text, code);
  }
}

// A number that is missing is seen in the text, so this shows that a text uses the keys of the libraries' numbers.
TEST(FindingTextTest, TextsHaveTheFigures) {
  struct Case {
    Finding finding;
    const char* text;
    const char* action;
  };
  const Case cases[] = {
      {FindingOf("required", {{"required_mm", 1}, {"reached_mm", 2}, {"held_out_mm", 0.3}, {"confidence", 0.95}},
                 {{"place", "the working point"}, {"hold_out", "known"}}),
       "a target located at the working point has an error of up to 2.0 mm with a confidence of 95.0 %; 1.00 mm are "
       "required",
       "take more captures, with larger rotations of the gripper and a larger range of distances"},
      {FindingOf("required", {{"required_mm", 1}, {"reached_mm", 1.0004}, {"held_out_mm", 1.02}, {"confidence", 0.95}},
                 {{"place", "the working point"}, {"hold_out", "known"}}),
       "a target located at the working point has an error of up to 1.0004 mm with a confidence of 95.0 %; 1.00 mm are "
       "required, and on held-out captures the target is off by 1.02 mm (RMS)",
       "take more captures, with larger rotations of the gripper and a larger range of distances"},
      {FindingOf("required", {{"required_mm", 1}, {"reached_mm", 0.5}, {"held_out_mm", 1.3}, {"confidence", 0.95}},
                 {{"place", "the working point"}, {"hold_out", "known"}}),
       "on held-out captures the target is off by 1.3 mm (RMS); 1.00 mm are required at the working point",
       "check the captures with the largest errors; calibrate the robot"},
      {FindingOf("required", {{"required_mm", 1}, {"reached_mm", 0.5}, {"held_out_mm", 0}, {"confidence", 0.95}},
                 {{"place", "the working point"}, {"hold_out", "unknown"}}),
       "a target located at the working point has an error of up to 0.50 mm with a confidence of 95.0 %; 1.00 mm are "
       "required",
       "check the captures with the largest errors; calibrate the robot"},
      {FindingOf("no_hold_out", {}, {{"reason", "none_held_out"}}),
       "no captures were held out: the hold-out error is not known", "set evaluate.folds to 5"},
      {FindingOf("no_hold_out", {}, {{"reason", "refinement_failed"}}),
       "the refinement failed without the held-out captures: the hold-out error is not known",
       "take more captures: too few are left to determine the camera and its pose when some are held out"},
      {FindingOf("unmodelled_error", {{"chi2_per_dof", 2}}, {{"robot_noise", "none"}}),
       "the held-out captures scatter 1.4 times as much as the assumed noise explains",
       "the robot is not exact: use refine.robot_noise: auto"},
      {FindingOf("captures_left_out", {{"used", 10}, {"seen", 20}, {"captures", 23}, {"copies", 2}}),
       "10 of 20 captures that show the target were used; 3 images show no target (2 are copies of others)",
       "see the reasons in the table of captures"},
      {FindingOf("influential_capture", {{"move_mm", 0.9}, {"move_deg", 0}, {"chance", 0.002}}, {{"image", "7.png"}}),
       "without 7.png the camera pose would move by 0.90 mm and 0 deg, more than the assumed noise explains "
       "(probability 0.002)",
       "check this image and its robot pose; leave the capture out if one of them is wrong"},
      {FindingOf("closed_form_better", {{"ratio", 0.667}}, {{"method", "park"}, {"robot_noise", "modelled"}}),
       "the best closed form (park) predicts held-out captures 1.5 times better, in sigmas of pixel and robot noise",
       "the residuals contain a systematic error that the model does not describe: free fewer groups of "
       "refine.intrinsics, or give a camera file"},
      {FindingOf(
           "held_intrinsics",
           {{"cx_px", -5}, {"cx_sigmas", -9.1}, {"move_mm", 2}, {"move_deg", 0.1}, {"target_move_mm", 0.3}, {"p", 0}},
           {{"intrinsic", "cx"}}),
       "the intrinsics were held, but the captures indicate cx -5.0 px (9.1 sigma) (p < 1e-15); with free intrinsics "
       "the camera would be 2.0 mm and 0.10 deg away, and the target 0.30 mm; the stated sigmas include this change",
       "free them (leave refine.intrinsics out), or recalibrate the camera"},
      {FindingOf("target_scale", {{"scale_x", 1.1}, {"scale_y", 1.1}}, {{"focal_length", "held"}}),
       "compared with the robot's poses, the target is 10 % larger than the config says (a focal length that is held "
       "at a wrong value looks the same)",
       "measure the target and correct its dimensions in the config; if they are right, check the units of the robot's "
       "poses and its own calibration"},
      {FindingOf("target_shape_ignored", {}, {{"focal_length", "held"}},
                 {FindingOf("shape_bend", {{"bend_x_mm", 0.5}, {"bend_y_mm", 0}}),
                  FindingOf("shape_twist", {{"twist_mm", 0.2}})}),
       "the captures indicate that the target differs from its design: its centre is 0.50 mm (along x) and 0.00 mm "
       "(along y) above its edges, its corners are 0.20 mm (saddle) from its plane; the stated sigmas include what "
       "such a shape would change",
       "measure the target, or use refine.target_shape: auto"},
      {FindingOf("few_captures_prior", {{"fewer_than", 8},
                                        {"least_robot_mm", 0.05},
                                        {"most_robot_mm", 1},
                                        {"least_robot_deg", 0.005},
                                        {"most_robot_deg", 0.1}}),
       "the captures contain fewer than 8 robot poses, too few to estimate the robot noise: that of an industrial arm "
       "was assumed (0.05 to 1 mm, 0.005 to 0.1 deg)",
       "take 15 to 25 captures"},
      {FindingOf("missing_ids", {{"missing", 12}, {"points", 48}, {"images", 6}}),
       "12 of the target's 48 points are never detected, although each is in view in 6 images or more",
       "check the target's first id, its rows and columns, the marker size and legacy_pattern"},
      {FindingOf(
           "arm_one_configuration",
           {{"captured_mm", 0.11}, {"others_mm", 0.9}, {"shoulder_mm", 1.2}, {"elbow_mm", 0.2}, {"wrist_mm", 0.6}},
           {{"configuration", "shoulder +, elbow +, wrist -"}, {"flip", "shoulder, wrist"}}),
       "all captures are in one configuration of the arm (shoulder +, elbow +, wrist -), so that its errors are "
       "extrapolated to the others: one sigma of the gripper's position is 0.11 mm at the captures and 0.90 mm at the "
       "same poses in other configurations; captures with the shoulder flipped (1.2 mm), with the wrist flipped "
       "(0.60 mm) would determine them there",
       "add captures with the shoulder, the elbow and the wrist flipped if the arm works there"},
  };
  for (const Case& test : cases) {
    EXPECT_EQ(TextOf(test.finding), test.text);
    EXPECT_EQ(ActionOf(test.finding), test.action);
  }
}

TEST(FindingTextTest, TheModelIsDescribedByItsParts) {
  Finding finding = FindingOf(
      "model", {{"robot_mm", 0.2}, {"robot_deg", 0.03}}, {{"model", "robot noise, scaled target"}},
      {FindingOf("shape_scale", {{"scale_x", 1.004}, {"scale_y", 1.002}}),
       FindingOf("rejected_model", {{"log_likelihood_lower_by", 123.4}, {"p", 0.0012}}, {{"model", "exact robot"}})});
  finding.grade = Grade::kGood;
  EXPECT_EQ(TextOf(finding),
            "chosen error model: robot noise, scaled target (0.20 mm and 0.030 deg); its scale is 1.00400 along x and "
            "1.00200 along y; exact robot is rejected (log-likelihood lower by 123, p = 0.0012)");
  EXPECT_EQ(ActionOf(finding), "");
  // A sigma that only bounds the noise has no digits.
  const Finding little = FindingOf("model", {{"robot_mm", 0.2}, {"robot_deg", 5.7e-7}}, {{"model", "robot noise"}});
  EXPECT_EQ(TextOf(little), "chosen error model: robot noise (0.20 mm and < 0.0001 deg)");
}

TEST(FindingTextTest, SuggestedCapturesAreTheRemedyOfAWeakDirection) {
  Finding weak = WeakFocalLength();
  EXPECT_EQ(TextOf(weak),
            "the camera's fx is determined to only 12 px, the target's position along the gripper's z is determined to "
            "only 1.5 mm (one sigma)");
  EXPECT_EQ(ActionOf(weak),
            "two captures 250 mm nearer and farther would reduce the sigma of the camera's fx to 3.0 px");
  weak.parts.back().names[0].second = "tilt_about_x";
  weak.parts.back().numbers[0] = {"angle_deg", 25};
  EXPECT_THAT(ActionOf(weak),
              StartsWith("two captures with the target tilted by +25 and -25 deg about the target's x axis would"));
  weak.parts.back().names[1].second = "camera";
  EXPECT_THAT(ActionOf(weak), StartsWith("two captures with the camera tilted relative to the target by +25 and -25"));
  weak.parts.pop_back();
  EXPECT_THAT(ActionOf(weak), StartsWith("take many more captures: no pair"));
}

TEST(FindingTextTest, SuggestedCapturesOfACellNameWhereTheyStartAndWhatIsSeen) {
  Finding weak = WeakFocalLength();
  weak.names = {{"of_camera", "left"}};
  Finding& suggested = weak.parts.back();
  for (const auto& name : std::vector<std::pair<std::string, std::string>>{{"view_of_camera", "top"},
                                                                           {"view_of_target", "plate"},
                                                                           {"from_capture", "007.png"},
                                                                           {"by_arm", "right"},
                                                                           {"seen", "left sees plate and wall"}}) {
    suggested.names.push_back(name);
  }
  const std::string action =
      "from capture 007.png on, with target plate in camera top, by arm right: two captures 250 mm nearer and farther "
      "would reduce the sigma of the camera's fx to 3.0 px; in both, left sees plate and wall";
  EXPECT_EQ(ActionOf(weak), action);
  suggested.names.emplace_back("helps_most", "top");
  suggested.names.emplace_back("helps_most_in", "the camera's position along the world's x");
  suggested.numbers.emplace_back("helps_most_percent", 41.6);
  EXPECT_EQ(ActionOf(weak), action + "; they help camera top most: the camera's position along the world's x by 42 %");
  EXPECT_THAT(Described(weak).text, StartsWith("camera left: the camera's fx is determined to only 12 px"));
}

// A direction that is known well enough needs no remedy; the captures that would still help are part of the text.
TEST(FindingTextTest, AGoodWeakDirectionHasNoRemedy) {
  Finding good = WeakFocalLength();
  good.grade = Grade::kGood;
  good.parts.erase(good.parts.begin() + 1);
  good.parts.front().grade = Grade::kGood;
  EXPECT_EQ(TextOf(good),
            "the camera's fx is determined to 12 px (one sigma); two captures 250 mm nearer and farther would reduce "
            "the sigma of the camera's fx to 3.0 px");
  EXPECT_EQ(ActionOf(good), "");
}

TEST(FindingTextTest, AFailedFoldOfOneCameraHasItsReason) {
  Finding finding = FindingOf("no_hold_out", {}, {{"of_camera", "right"}, {"reason", "failed_for_camera"}});
  finding.reason = {FailureCode("of_fold"), {{"fold", 2}}, {}, {Failure("too few points")}};
  EXPECT_EQ(TextOf(finding), "its hold-out error is not known: fold 2: too few points");
  EXPECT_THAT(ActionOf(finding), StartsWith("take more captures in which it sees a target"));
}

TEST(FindingTextTest, TheUncertaintyIncludesItsPartsAndTheRemedyOfAWeakDirection) {
  Finding finding = FindingOf(
      "uncertainty", {{"position_mm", 2}, {"orientation_deg", 0.05}}, {},
      {FindingOf("at_working_point", {{"distance_mm", 812.3}, {"at_work_mm", 4.5}}),
       FindingOf("intrinsics_not_included", {{"focal_error_percent", 100 * 1e-3}, {"moves_target_mm", 0.81}})});
  const std::string text =
      "the camera's pose is known to 2.0 mm and 0.050 deg (one sigma, along and about the least certain axis); a "
      "target seen 812 mm away is located to 4.5 mm; the intrinsics were held, and their error is not part of these "
      "figures (an error of 0.1 % in the focal length moves that target by 0.81 mm)";
  EXPECT_EQ(TextOf(finding), text);
  EXPECT_THAT(ActionOf(finding), StartsWith("take more captures, with larger rotations of the gripper about"));
  finding.parts.push_back(WeakFocalLength());
  EXPECT_EQ(TextOf(finding), text + "; " + TextOf(WeakFocalLength()));
  EXPECT_EQ(ActionOf(finding), ActionOf(WeakFocalLength()));
  finding.grade = Grade::kGood;
  EXPECT_EQ(ActionOf(finding), "");
}

// The texts of the doctor and of files are kept, also if their code has words. A cause still gets its consequences.
TEST(FindingTextTest, KeepsATextThatIsSet) {
  Finding cause = FindingOf("target_scale", {});
  cause.is_cause = true;
  cause.text = "the target is 10 % larger";
  cause.action = "measure it";
  cause = Described(std::move(cause));
  EXPECT_EQ(cause.text, "the target is 10 % larger");
  cause.parts = {FindingOf("hold_out", {{"target_mm", 16}, {"target_deg", 1}})};
  cause = Described(std::move(cause));
  EXPECT_EQ(cause.text,
            "the target is 10 % larger; as a consequence, on held-out captures the target is off by 16 mm and 1.0 deg "
            "from its predicted pose (RMS)");
  EXPECT_EQ(cause.action, "measure it");
}

TEST(FindingTextTest, DescribingTwiceChangesNothing) {
  Finding cause =
      FindingOf("target_scale", {{"scale_x", 1.1}, {"scale_y", 1.1}}, {},
                {FindingOf("uncertainty", {{"position_mm", 9}, {"orientation_deg", 1}}, {}, {WeakFocalLength()})});
  cause.is_cause = true;
  const std::vector<Finding> once = Described(std::vector<Finding>{cause, WeakFocalLength()});
  const std::vector<Finding> twice = Described(once);
  for (size_t i = 0; i < once.size(); ++i) {
    EXPECT_EQ(twice[i].text, once[i].text);
    EXPECT_EQ(twice[i].action, once[i].action);
  }
  EXPECT_THAT(once[0].text, HasSubstr("; as a consequence, the camera's pose is known to 9.0 mm and 1.0 deg"));
  EXPECT_THAT(once[0].text, HasSubstr("; the camera's fx is determined to only 12 px"));
  EXPECT_THAT(once[0].parts[0].text, Not(HasSubstr("as a consequence")));
}

TEST(FindingTextTest, AnUnknownCodeIsShownWithItsNumbers) {
  EXPECT_EQ(TextOf(FindingOf("of_a_newer_version", {{"by_mm", 1.5}, {"captures", 3}})),
            "of_a_newer_version (by_mm 1.50, captures 3.00)");
  EXPECT_EQ(TextOf(FindingOf("of_a_newer_version", {})), "of_a_newer_version");
}

// The keys of one of several arms are those of its section; the only arm of a rig has those of a single camera.
TEST(FindingTextTest, FindingsAboutAnArmNameItsKeys) {
  const auto described = [](const char* arm) {
    return Described(FindingOf("arm_singular_captures", {{"captures", 1}, {"of_captures", 9}},
                               {{"arm", "ur5e"}, {"joints", "recovered"}, {"of_arm", arm}}));
  };
  EXPECT_THAT(described("myrobot").text, StartsWith("arm myrobot: the arm ur5e is at or close to a singularity"));
  EXPECT_THAT(described("myrobot").action, StartsWith("record the joints (robots.myrobot.joints), or"));
  EXPECT_THAT(described("robot").action, StartsWith("record the joints (captures.joints), or"));
  Finding smooth = Described(FindingOf("smooth_errors", {}, {{"of_arm", "myrobot"}}));
  EXPECT_THAT(smooth.text, HasSubstr("if the config names it (robots.myrobot.model)"));
  smooth = Described(std::move(smooth));
  EXPECT_THAT(smooth.text, HasSubstr("if the config names it (robots.myrobot.model)"));
  Finding declined = FindingOf("arm_declined", {}, {{"of_arm", "myrobot"}});
  declined.reason = FailureCode("tool_scatter");
  EXPECT_THAT(Described(declined).text, HasSubstr("check robots.myrobot.model, joint_angle, and that"));
  const Finding known = Described(FindingOf("smooth_errors", {}, {{"of_arm", "myrobot"}, {"arm", "ur5e"}}));
  EXPECT_THAT(known.text, Not(HasSubstr("if the config names it")));
}

}  // namespace
}  // namespace heba
