#include "tools/text/finding_text.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <limits>
#include <string_view>
#include <utility>

#include "heba/base/text.h"
#include "heba/evaluation/judgement.h"
#include "tools/text/arm_keys.h"
#include "tools/text/target_symmetry.h"

namespace heba {
namespace {

double Number(const Finding& finding, std::string_view key) {
  return finding.Number(key).value_or(std::numeric_limits<double>::quiet_NaN());
}

std::string Name(const Finding& finding, std::string_view key) { return finding.Name(key).value_or(""); }

bool Is(const Finding& finding, std::string_view key, std::string_view name) { return finding.Name(key) == name; }

const Finding* PartOf(const Finding& finding, std::string_view code) {
  const auto part = std::find_if(finding.parts.begin(), finding.parts.end(),
                                 [&](const Finding& candidate) { return candidate.code == code; });
  return part == finding.parts.end() ? nullptr : &*part;
}

std::string Count(const Finding& finding, std::string_view key) { return Fixed(Number(finding, key), 0); }

std::string Amount(const Finding& finding, std::string_view key) { return ShownAmount(Number(finding, key), 2); }

using Settings = std::vector<ConfigSetting>;

const ConfigSetting kEstimatedNoise{"refine.robot_noise", "auto"};

std::string ChanceText(double p) {
  constexpr double kNever = 1e-15;
  return p < kNever ? "p < 1e-15" : "p = " + Significant(p, 2);
}

std::string NoiseText(double translation_mm, double rotation_deg) {
  return ShownNoise(translation_mm) + " mm and " + ShownNoise(rotation_deg) + " deg";
}

std::string RobotNoiseText(const Finding& finding) {
  return NoiseText(Number(finding, "robot_mm"), Number(finding, "robot_deg"));
}

// Describes the shape that the parts state: "its scale is 1.00400 along x and 1.00200 along y, its centre is ..."
std::string ShapeText(const Finding& finding) {
  std::vector<std::string> texts;
  for (const std::string_view code : {"shape_scale", "shape_bend", "shape_twist", "shape_cubic"}) {
    if (const Finding* part = PartOf(finding, code)) texts.push_back(FindingWords(*part).text);
  }
  return Join(texts, ", ");
}

// Returns the largest change of an intrinsic parameter, such as "fx +38 px (9.1 sigma)"; empty if there is none.
std::string LargestMoveText(const Finding& finding) {
  const std::string intrinsic = Name(finding, "intrinsic");
  if (intrinsic.empty()) return "";
  const double by_px = Number(finding, intrinsic + "_px");
  return intrinsic + (by_px < 0 ? " -" : " +") + Significant(std::abs(by_px), 2) + " px (" +
         Significant(std::abs(Number(finding, intrinsic + "_sigmas")), 2) + " sigma)";
}

FindingText Uncertainty(const Finding& finding) {
  FindingText words = {"the camera's pose is known to " + Amount(finding, "position_mm") + " mm and " +
                           Amount(finding, "orientation_deg") +
                           " deg (one sigma, along and about the least certain axis)",
                       "take more captures, with larger rotations of the gripper about different axes and a larger "
                       "range of distances"};
  for (const Finding& part : finding.parts) {
    const FindingText of_part = FindingWords(part);
    words.text += "; " + of_part.text;
    // The remedy of a weak direction is more specific.
    if (!of_part.action.empty()) words.action = of_part.action;
  }
  return words;
}

FindingText AtWorkingPoint(const Finding& finding) {
  return {"a target seen " + Significant(Number(finding, "distance_mm"), 3) + " mm away is located to " +
              Amount(finding, "at_work_mm") + " mm",
          ""};
}

FindingText IntrinsicsNotIncluded(const Finding& finding) {
  std::string text = "the intrinsics were held, and their error is not part of these figures";
  if (finding.Number("moves_target_mm")) {
    text += " (an error of " + Significant(Number(finding, "focal_error_percent"), 1) +
            " % in the focal length moves that target by " + Significant(Number(finding, "moves_target_mm"), 2) +
            " mm)";
  }
  return {text, ""};
}

// Formats an amount with two digits, or with as many more as show on which side of `limit` it lies.
std::string AmountBeside(double amount, double limit) {
  constexpr int kMostDigits = 9;
  int digits = 2;
  const auto is_shown = [&] {
    const double shown = std::strtod(ShownAmount(amount, digits).c_str(), nullptr);
    return (shown > limit) == (amount > limit) && shown != limit;
  };
  while (digits < kMostDigits && !is_shown()) ++digits;
  return ShownAmount(amount, digits);
}

// The accuracy that is required is not known.
FindingText UnreachedText(const Finding& finding) {
  const std::string required = "; " + Significant(Number(finding, "required_mm"), 3) + " mm are required";
  const std::string place = Name(finding, "place");
  if (Is(finding, "unreached", "not_in_view")) {
    const bool is_of_rig = finding.Name("of_camera").has_value();
    return {"a target at " + place + " cannot be located, because it is not in view" + required,
            "check the positions of evaluate.require, which are in the " +
                std::string(is_of_rig ? "world" : "base of the robot")};
  }
  if (Is(finding, "unreached", "undetermined")) {
    return {"the image of a target at " + place + " would not determine its pose" + required,
            "require the accuracy where the camera sees more of the target"};
  }
  return {"the accuracy at " + place + " is not known, because no image of a target is used" + required,
          "see why the captures were left out"};
}

// Names what is missed; everything if all is met.
FindingText Required(const Finding& finding) {
  const double within_mm = Number(finding, "required_mm");
  if (!finding.Number("reached_mm")) return UnreachedText(finding);
  const double reached_mm = Number(finding, "reached_mm");
  const double held_out_mm = Number(finding, "held_out_mm");
  const bool has_hold_out = Is(finding, "hold_out", "known");
  const bool is_reach_missed = reached_mm > within_mm;
  const bool is_hold_out_missed = has_hold_out && held_out_mm > within_mm;
  const std::string place = Name(finding, "place");
  const std::string hold_out =
      "on held-out captures the target is off by " + AmountBeside(held_out_mm, within_mm) + " mm (RMS)";
  const std::string required = Significant(within_mm, 3) + " mm are required";
  const std::string repeat = "check the captures with the largest errors; calibrate the robot";
  if (is_hold_out_missed && !is_reach_missed) return {hold_out + "; " + required + " at " + place, repeat};
  const std::string text = "a target located at " + place + " has an error of up to " +
                           AmountBeside(reached_mm, within_mm) + " mm with a confidence of " +
                           Significant(100 * Number(finding, "confidence"), 3) + " %; " + required;
  const bool is_hold_out_named = has_hold_out && (is_hold_out_missed || !is_reach_missed);
  return {text + (is_hold_out_named ? ", and " + hold_out : ""),
          is_reach_missed ? "take more captures, with larger rotations of the gripper and a larger range of distances"
                          : repeat};
}

FindingText HoldOutErrors(const Finding& finding) {
  return {"on held-out captures the target is off by " + Amount(finding, "target_mm") + " mm and " +
              Amount(finding, "target_deg") + " deg from its predicted pose (RMS)",
          "check the captures with the largest residuals; let the robot settle before each image; check the robot's "
          "own calibration, the pose format and the target's dimensions"};
}

FindingText NoHoldOut(const Finding& finding) {
  if (Is(finding, "reason", "refinement_failed")) {
    return {"the refinement failed without the held-out captures: the hold-out error is not known",
            "take more captures: too few are left to determine the camera and its pose when some are held out"};
  }
  if (Is(finding, "reason", "failed_for_camera")) {
    return {"its hold-out error is not known: " + FailureText(finding.reason),
            "take more captures in which it sees a target: too few are left to determine it when some are held out"};
  }
  return {"no captures were held out: the hold-out error is not known",
          "set evaluate.folds to 5",
          {{"evaluate.folds", "5"}}};
}

FindingText UnmodelledError(const Finding& finding) {
  const bool is_modelled = Is(finding, "robot_noise", "modelled");
  return {"the held-out captures scatter " + Significant(std::sqrt(Number(finding, "chi2_per_dof")), 2) +
              " times as much as the assumed noise explains",
          is_modelled ? "the error is neither pixel noise nor white robot noise: check the target's dimensions, the "
                        "camera model and the captures with the largest corrections"
                      : "the robot is not exact: use " + SettingsText({kEstimatedNoise}),
          is_modelled ? Settings() : Settings{kEstimatedNoise}};
}

// Says how many images show no target, and how many captures are copies.
std::string OtherCaptures(const Finding& finding) {
  std::string text;
  const double num_without = Number(finding, "captures") - Number(finding, "seen");
  if (num_without > 0) text += "; " + Fixed(num_without, 0) + " images show no target";
  if (Number(finding, "copies") > 0) text += " (" + Count(finding, "copies") + " are copies of others)";
  if (finding.Number("left_out_mm")) {
    text += "; in those left out, the target is " + Amount(finding, "left_out_mm") +
            " mm from where the estimate predicts it (RMS)";
  }
  return text;
}

std::string UsedCaptures(const Finding& finding) {
  return Count(finding, "used") + " of " + Count(finding, "seen") + " captures that show the target were used" +
         OtherCaptures(finding);
}

FindingText FewCaptures(const Finding& finding) {
  const bool are_all_used = Number(finding, "used") == Number(finding, "seen");
  return {are_all_used ? "only " + Count(finding, "used") + " captures show the target" + OtherCaptures(finding)
                       : UsedCaptures(finding),
          "take 15 to 25 captures"};
}

FindingText CapturesLeftOut(const Finding& finding) {
  return {UsedCaptures(finding), "see the reasons in the table of captures"};
}

FindingText PixelNoise(const Finding& finding) {
  return {"the pixel noise is " + Significant(Number(finding, "pixel_sigma_px"), 2) + " px per coordinate (one sigma)",
          "good images give 0.02 to 0.3 px: check focus, motion blur, the camera model and the robot's poses"};
}

FindingText InfluentialCapture(const Finding& finding) {
  return {"without " + Name(finding, "image") + " the camera pose would move by " + Amount(finding, "move_mm") +
              " mm and " + Amount(finding, "move_deg") + " deg, more than the assumed noise explains (probability " +
              ShownPValue(Number(finding, "chance")) + ")",
          "check this image and its robot pose; leave the capture out if one of them is wrong"};
}

FindingText ClosedFormBetter(const Finding& finding) {
  const bool is_modelled = Is(finding, "robot_noise", "modelled");
  const double ratio = Number(finding, "ratio");
  return {"the best closed form (" + Name(finding, "method") + ") predicts held-out captures " +
              (ratio >= 1 ? Significant(ratio, 2) + " times worse" : Significant(1 / ratio, 2) + " times better") +
              ", in sigmas of pixel and robot noise",
          "the residuals contain a systematic error that the model does not describe: " +
              (is_modelled ? "free fewer groups of refine.intrinsics, or give a camera file"
                           : "use " + SettingsText({kEstimatedNoise})),
          is_modelled ? Settings() : Settings{kEstimatedNoise}};
}

FindingText NoEstimate(const Finding& /*finding*/) {
  return {"there is no refined estimate", "see the reasons of the methods"};
}

FindingText PosesOnly(const Finding& finding) {
  return {"only poses of the target were given, no images: they scatter by " + Amount(finding, "scatter_mm") +
              " mm and " + Amount(finding, "scatter_deg") + " deg in the frame where the target is fixed",
          "give the images or the corners: a refinement from them is more accurate and reports its uncertainty"};
}

FindingText WeakDirections(const Finding& finding) {
  std::vector<std::string> texts;
  for (const Finding& part : finding.parts) {
    if (part.code == "weak_direction_of") texts.push_back(FindingWords(part).text);
  }
  const Finding* suggested = PartOf(finding, "suggested_captures");
  std::string text = Join(texts, ", ") + " (one sigma)";
  // The action of a good finding is not shown.
  const bool is_good = finding.grade == Grade::kGood;
  if (is_good && suggested != nullptr) text += "; " + FindingWords(*suggested).text;
  return {text, suggested != nullptr
                    ? FindingWords(*suggested).text
                    : "take many more captures: no pair of additional captures reduces this sigma much"};
}

FindingText WeakDirectionOf(const Finding& finding) {
  return {Name(finding, "direction") + " is determined to " + (finding.grade == Grade::kGood ? "" : "only ") +
              Significant(Number(finding, "sigma"), 2) + " " + Name(finding, "unit"),
          ""};
}

// Returns the motion of two captures: "two captures 250 mm nearer and farther".
std::string MotionText(const Finding& finding) {
  const std::string motion = Name(finding, "motion");
  const bool moves_target = Is(finding, "moved", "target");
  const std::string tilted = moves_target ? "with the target tilted" : "with the camera tilted relative to the target";
  const std::string rotated = moves_target ? "with the target rotated" : "with the camera rotated";
  const std::string angle = Count(finding, "angle_deg");
  const std::string by_angles = " by +" + angle + " and -" + angle + " deg ";
  if (motion == "tilt_about_x") return "two captures " + tilted + by_angles + "about the target's x axis";
  if (motion == "tilt_about_y") return "two captures " + tilted + by_angles + "about the target's y axis";
  if (motion == "rotate_in_plane") return "two captures " + rotated + by_angles + "in the target's plane";
  if (motion == "nearer_and_farther") return "two captures " + Count(finding, "distance_mm") + " mm nearer and farther";
  if (motion == "left_and_right") return "two captures with the target at the left and right of the image";
  return "two captures with the target at the top and bottom of the image";
}

// Returns where a motion starts: "from capture 007.png on: ", of a rig with "target plate in camera left".
std::string StartText(const Finding& finding) {
  const std::string capture = Name(finding, "from_capture");
  if (capture.empty()) return "";
  const std::string arm = Name(finding, "by_arm");
  const std::string camera = Name(finding, "view_of_camera");
  return "from capture " + capture + " on" +
         (camera.empty() ? "" : ", with target " + Name(finding, "view_of_target") + " in camera " + camera) +
         (arm.empty() ? "" : ", by arm " + arm) + ": ";
}

FindingText SuggestedCapturesText(const Finding& finding) {
  std::string text = StartText(finding) + MotionText(finding) + " would reduce the sigma of " +
                     Name(finding, "direction") + " to " + Significant(Number(finding, "sigma"), 2) + " " +
                     Name(finding, "unit");
  if (finding.Name("seen")) text += "; in both, " + Name(finding, "seen");
  if (finding.Name("helps_most")) {
    text += "; they help camera " + Name(finding, "helps_most") + " most: " + Name(finding, "helps_most_in") + " by " +
            Count(finding, "helps_most_percent") + " %";
  }
  return {text, ""};
}

FindingText Model(const Finding& finding) {
  std::string text = "chosen error model: " + Name(finding, "model");
  if (finding.Number("robot_mm")) text += " (" + RobotNoiseText(finding) + ")";
  const std::string shape = ShapeText(finding);
  if (!shape.empty()) text += "; " + shape;
  for (const std::string_view code : {"rejected_model", "no_better_model"}) {
    if (const Finding* other = PartOf(finding, code)) text += "; " + FindingWords(*other).text;
  }
  return {text, ""};
}

FindingText ShapeScale(const Finding& finding) {
  return {"its scale is " + Fixed(Number(finding, "scale_x"), 5) + " along x and " +
              Fixed(Number(finding, "scale_y"), 5) + " along y",
          ""};
}

FindingText ShapeBend(const Finding& finding) {
  return {"its centre is " + Fixed(Number(finding, "bend_x_mm"), 2) + " mm (along x) and " +
              Fixed(Number(finding, "bend_y_mm"), 2) + " mm (along y) above its edges",
          ""};
}

FindingText ShapeTwist(const Finding& finding) {
  return {"its corners are " + Fixed(Number(finding, "twist_mm"), 2) + " mm (saddle) from its plane", ""};
}

FindingText ShapeCubic(const Finding& finding) {
  return {"its surface is cubic, with heights of up to " + Fixed(Number(finding, "cubic_mm"), 2) + " mm", ""};
}

FindingText ArmEstimated(const Finding& finding) {
  std::string text =
      "the kinematics of the arm " + Name(finding, "arm") + " were estimated (" + Name(finding, "errors") + ")";
  if (finding.Number("before_mm")) {
    text += "; the noise of its poses falls from " +
            NoiseText(Number(finding, "before_mm"), Number(finding, "before_deg")) + " to " +
            NoiseText(Number(finding, "after_mm"), Number(finding, "after_deg"));
  }
  if (finding.Name("implausible")) {
    return {
        text + "; no arm has such errors: " + Name(finding, "implausible"),
        "check that robot.model names this arm, and that joints and poses belong together; do not use the calibrated "
        "arm"};
  }
  return {text, "correct the poses by heba correct, or export the calibrated arm"};
}

FindingText ArmDeclined(const Finding& finding) {
  return {"the kinematics of the arm " + Name(finding, "arm") + " were not estimated: " + FailureText(finding.reason),
          ""};
}

FindingText ArmOneConfiguration(const Finding& finding) {
  std::string text = "all captures are in one configuration of the arm (" + Name(finding, "configuration") +
                     "), so that its errors are extrapolated to the others";
  if (finding.Number("captured_mm")) {
    text += ": one sigma of the gripper's position is " + Significant(Number(finding, "captured_mm"), 2) +
            " mm at the captures and " + Significant(Number(finding, "others_mm"), 2) +
            " mm at the same poses in other configurations";
  }
  std::vector<std::string> flips;
  for (const std::string& name : Split(Name(finding, "flip"), ',')) {
    if (Trim(name).empty()) continue;
    const std::string flip(Trim(name));
    flips.push_back("with the " + flip + " flipped (" + Significant(Number(finding, flip + "_mm"), 2) + " mm)");
  }
  if (!flips.empty()) text += "; captures " + Join(flips, ", ") + " would determine them there";
  return {text, "add captures with the shoulder, the elbow and the wrist flipped if the arm works there"};
}

FindingText ArmSingularCaptures(const Finding& finding) {
  const bool is_recorded = Is(finding, "joints", "recorded");
  return {"the arm " + Name(finding, "arm") + " is at or close to a singularity in " + Count(finding, "captures") +
              " of " + Count(finding, "of_captures") + " captures (" + Name(finding, "names") + "; in the first, " +
              Name(finding, "singularity") + ")" +
              (is_recorded ? "" : ": the joints that are recovered from their poses are uncertain"),
          is_recorded ? "" : "record the joints (captures.joints), or move these captures away from the singularity"};
}

FindingText RejectedModel(const Finding& finding) {
  return {Name(finding, "model") + " is rejected (log-likelihood lower by " +
              Significant(Number(finding, "log_likelihood_lower_by"), 3) + ", " + ChanceText(Number(finding, "p")) +
              ")",
          ""};
}

FindingText NoBetterModel(const Finding& finding) {
  return {Name(finding, "model") + " is not significantly better (log-likelihood higher by " +
              Significant(Number(finding, "log_likelihood_higher_by"), 2) + ", " + ChanceText(Number(finding, "p")) +
              ")",
          ""};
}

FindingText TargetShapeIgnored(const Finding& finding) {
  const bool may_be_focal_length = Is(finding, "focal_length", "held") && PartOf(finding, "shape_scale") != nullptr;
  return {"the captures indicate that the target differs from its design: " + ShapeText(finding) +
              (may_be_focal_length ? " (a focal length that is held at a wrong value looks like a wrong scale)" : "") +
              "; the stated sigmas include what such a shape would change",
          "measure the target, or use refine.target_shape: auto",
          {{"refine.target_shape", "auto"}}};
}

FindingText RobotNoiseIgnored(const Finding& finding) {
  return {"the captures indicate that the robot's poses are off by " + RobotNoiseText(finding) +
              " (one sigma per axis), but they were taken as exact: the reported covariance is too small",
          "use " + SettingsText({kEstimatedNoise}),
          {kEstimatedNoise}};
}

std::string PercentText(double ratio) { return Significant(100 * ratio, 2) + " %"; }

// Returns how well the ratio of the scales of target and robot is known; empty if the finding does not say it.
std::string KnownText(const Finding& finding) {
  const std::optional<double> known_sigma = finding.Number("known_sigma");
  return known_sigma ? ", whose dimensions are taken to be right to " + PercentText(*known_sigma) : "";
}

FindingText TargetScale(const Finding& finding) {
  const double mean = 0.5 * (Number(finding, "scale_x") + Number(finding, "scale_y"));
  const std::optional<double> scale_sigma = finding.Number("scale_sigma");
  const std::string sigma = scale_sigma ? " (one sigma " + Significant(100 * *scale_sigma, 1) + " %)" : "";
  return {
      "compared with the robot's poses, the target is " + Significant(100 * std::abs(mean - 1), 2) + " %" + sigma +
          (mean > 1 ? " larger" : " smaller") + " than the config says" + KnownText(finding) +
          (Is(finding, "focal_length", "held") ? " (a focal length that is held at a wrong value looks the same)" : ""),
      "measure the target and correct its dimensions in the config; if they are right, check the units of the "
      "robot's poses and its own calibration"};
}

FindingText ScaleSource(const Finding& finding) {
  const std::string robot = PercentText(Number(finding, "robot_scale_sigma"));
  const std::string target = PercentText(Number(finding, "target_scale_sigma"));
  const std::string camera = finding.Name("of_camera").value_or("");
  const std::string source =
      Is(finding, "source", "robot")
          ? "the translations of the robot, whose lengths are taken to be right to " + robot
          : "the translations of the robot and the size of the target, which are taken to be right to " + robot +
                " and " + target;
  return {"the scale of the result is that of " + source + ": this makes " + Amount(finding, "share_mm") +
              " mm of the uncertainty of the position of " + (camera.empty() ? "the camera" : "camera " + camera),
          ""};
}

FindingText CameraMoved(const Finding& finding) {
  const std::string camera = Name(finding, "camera");
  return {(camera.empty() ? "the camera" : "camera " + camera) + " was moved by " + Amount(finding, "moved_mm") +
              " mm and " + Amount(finding, "moved_deg") + " deg between the captures " + Name(finding, "last_capture") +
              " and " + Name(finding, "first_capture") + "; its " + Count(finding, "images_left_out") +
              " images from " + Name(finding, "first_left_out") + " to " + Name(finding, "last_left_out") +
              " were left out",
          "fix the camera's mount and record all captures again, or calibrate from the captures after the motion only "
          "(captures.exclude)"};
}

FindingText DriftText(const Finding& finding) {
  const std::string body = Name(finding, "body");
  std::string text = "the " + body + (Is(finding, "form", "linear") ? " crept by " : " was knocked by ") +
                     Amount(finding, "change_mm") + " mm and " + Amount(finding, "change_deg") + " deg (one sigma " +
                     Amount(finding, "sigma_mm") + " mm and " + Amount(finding, "sigma_deg") + " deg) ";
  text += Is(finding, "form", "linear") ? "from the first capture to the last"
                                        : "just before the capture " + Name(finding, "capture");
  const bool is_tested = !Is(finding, "evidence", "wanted") && !Is(finding, "evidence", "motion");
  if (is_tested) text += " (" + ChanceText(Number(finding, "p")) + ")";
  const double odds = Number(finding, "odds_of_side");
  constexpr double kClear = 100;
  if (odds < kClear && is_tested && !Is(finding, "evidence", "cameras")) {
    text += "; that it was not the " + std::string(body == "camera" ? "target" : "camera") +
            " or the robot's base is " + Significant(odds, 2) + " times as likely";
  }
  text += Is(finding, "use", "not_corrected") ? "; the result could not be corrected for it"
                                              : "; the result is that of the last capture";
  if (finding.grade == Grade::kGood) return {text, ""};
  return {text, (body == "base" ? "tighten the base" : "tighten what carries the " + body) +
                    ", and record the captures again if it is to hold"};
}

FindingText DriftUnseen(const Finding& finding) {
  if (Is(finding, "reason", "undetermined")) {
    return {"the captures do not determine the drift that refine.drift asks for", "take more captures, or use auto"};
  }
  return {
      "a drift of the camera or of the target cannot be told from the errors of the robot, because the order of the "
      "captures follows from their poses",
      "repeat the first three poses at the end of the next session"};
}

FindingText PriorText(const Finding& finding) {
  const std::string run = Name(finding, "run");
  const std::string fault = Name(finding, "fault");
  if (finding.grade == Grade::kDoubtful && fault == "arm") {
    return {"the result builds on the run " + run +
                ", which estimated the errors of the arm; the poses of these captures are not corrected for them",
            "calibrate the captures of both sessions together"};
  }
  if (finding.grade == Grade::kDoubtful) {
    return {"the result builds on the run " + run + ", which is bad (" + fault + ")",
            "mend what is wrong there, and run it again"};
  }
  if (finding.grade == Grade::kGood) {
    return {"the result builds on the run " + run + ", with which the captures agree (least probability by chance " +
                ShownPValue(Number(finding, "p")) + ")",
            ""};
  }
  constexpr std::pair<std::string_view, const char*> kParts[] = {{"camera_pose", "the pose of the camera"},
                                                                 {"target_pose", "the pose of the target"},
                                                                 {"lens", "the lens of the camera"},
                                                                 {"target_shape", "the shape of the target"},
                                                                 {"base", "the base of an arm"}};
  std::string part;
  for (const auto& [code, words] : kParts) {
    if (Is(finding, "part", code)) part = words;
  }
  const std::string of = Name(finding, "of");
  return {"the captures contradict the run " + run + ", which the result builds on: " + part +
              (of.empty() ? "" : " " + of) + " differs by " + Significant(Number(finding, "ratio"), 2) +
              " times what both leave open (probability by chance " + ShownPValue(Number(finding, "p")) + ")",
          "see what has changed with heba check, state it (prior: {run: ..., drift: ..., target: moved}), or calibrate "
          "without the earlier run"};
}

FindingText TargetPoints(const Finding& finding) {
  const std::string target = Name(finding, "of_target");
  return {Count(finding, "deviating") + " of " + Count(finding, "points") + " points of the target" +
              (target.empty() ? "" : " " + target) + " lie beside the shape that was estimated, by up to " +
              Significant(Number(finding, "largest_mm"), 2) + " mm (point " + Count(finding, "largest_id") +
              "): errors of the print, or of its detection",
          ""};
}

FindingText PointsEstimated(const Finding& finding) {
  const std::string target = Name(finding, "of_target");
  return {"the points of the target" + (target.empty() ? "" : " " + target) + " lie beside their design by " +
              Significant(Number(finding, "sigma_mm"), 2) + " mm along each axis (one sigma), by up to " +
              Significant(Number(finding, "largest_mm"), 2) + " mm (point " + Count(finding, "largest_id") + "; " +
              ChanceText(Number(finding, "p")) + "): they were estimated",
          ""};
}

FindingText ImageRegions(const Finding& finding) {
  const std::string camera = Name(finding, "of_camera");
  return {"in " + Count(finding, "deviating") + " of " + Count(finding, "regions") + " regions of the image" +
              (camera.empty() ? "" : " of camera " + camera) + " the residuals have a mean, of up to " +
              Significant(Number(finding, "largest_px"), 2) + " px (near " + Count(finding, "at_u_px") + ", " +
              Count(finding, "at_v_px") + "): the model of the lens lacks something there",
          ""};
}

FindingText HeldIntrinsics(const Finding& finding) {
  const std::string move = Is(finding, "part", "distortion") ? "another distortion" : LargestMoveText(finding);
  return {"the intrinsics were held, but the captures indicate " + move + " (" + ChanceText(Number(finding, "p")) +
              "); with free intrinsics the camera would be " + Significant(Number(finding, "move_mm"), 2) + " mm and " +
              Significant(Number(finding, "move_deg"), 2) + " deg away, and the target " +
              Significant(Number(finding, "target_move_mm"), 2) + " mm; the stated sigmas include this change",
          "free them (leave refine.intrinsics out), or recalibrate the camera"};
}

FindingText CameraUse(const Finding& finding) {
  if (Is(finding, "use", "held")) return {"the given intrinsics were held", ""};
  const std::string moved = LargestMoveText(finding);
  return {std::string("the given intrinsics were used as ") +
              (Is(finding, "use", "prior") ? "a prior" : "the initial guess") +
              (moved.empty() ? "" : "; the refinement changed them by at most " + moved),
          ""};
}

FindingText CapturesScatter(const Finding& finding) {
  return {Count(finding, "captures") + " of " + Count(finding, "of_captures") +
              " captures contradict the others, but larger robot noise explains all of them better than so many wrong "
              "captures: the model is incomplete, and all were kept",
          "check the robot's own calibration, the target's dimensions and the camera model"};
}

FindingText CapturesContradict(const Finding& finding) {
  return {Count(finding, "captures") + " of " + Count(finding, "of_captures") +
              " captures contradict every calibration, so that none of them could be left out",
          "check that images and poses belong together, and that the poses mean what the config says (pose_format, "
          "poses_are, setup)"};
}

FindingText CameraReduced(const Finding& finding) {
  const std::string model = Name(finding, "model");
  const std::string wanted = Name(finding, "wanted");
  const std::string free = Name(finding, "free");
  return {(model == wanted ? "of the camera's intrinsics only " + (free.empty() ? "none" : free) + " could be freed: "
                           : "the lens " + model + " was estimated in place of " + wanted + " (camera.model): ") +
              FailureText(finding.reason),
          "use camera.model: auto, or take captures with more depth and tilt over the whole image"};
}

FindingText FewCapturesPrior(const Finding& finding) {
  const auto bound = [&](std::string_view key) { return Significant(Number(finding, key), 1); };
  return {"the captures contain fewer than " + Count(finding, "fewer_than") +
              " robot poses, too few to estimate the robot noise: that of an industrial arm was assumed (" +
              bound("least_robot_mm") + " to " + bound("most_robot_mm") + " mm, " + bound("least_robot_deg") + " to " +
              bound("most_robot_deg") + " deg)",
          "take 15 to 25 captures"};
}

FindingText MissingIds(const Finding& finding) {
  return {Count(finding, "missing") + " of the target's " + Count(finding, "points") +
              " points are never detected, although each is in view in " + Count(finding, "images") + " images or more",
          "check the target's first id, its rows and columns, the marker size and legacy_pattern"};
}

FindingText SeenFromBehind(const Finding& finding) {
  const std::string target = Name(finding, "of_target");
  return {
      Count(finding, "behind") + " of " + Count(finding, "images") + " images show the target" +
          (target.empty() ? "" : " " + target) +
          " from behind, by the ids of its points: these are mirrored, and the pose of the target is that of a sheet "
          "that is turned over (the camera's is right)",
      "number the points as the target does: compare the ids in detections.json with a sheet of 'heba target', or "
      "let heba detect them"};
}

FindingText TimeOffsetText(const Finding& finding) {
  const std::optional<double> offset_ms = finding.Number("offset_ms");
  if (!offset_ms) {
    return {
        "the captures do not determine the offset between the clocks of camera and robot: the robot hardly moves in "
        "them",
        "take images while the robot moves, or state the offset (refine.time_offset)"};
  }
  return {"the robot's clock is " + ShownAmount(std::abs(*offset_ms), 3) + " ms (one sigma " +
              ShownAmount(Number(finding, "sigma_ms"), 2) + ") " + (*offset_ms < 0 ? "behind" : "ahead of") +
              " the times of the images; the poses of the robot are corrected for it",
          ""};
}

FindingText SmoothErrorsWords(const Finding& finding) {
  const auto sigmas = [&](const std::string& of) {
    return NoiseText(Number(finding, of + "_mm"), Number(finding, of + "_deg"));
  };
  const std::string lengths =
      ", over " + Amount(finding, "length_mm") + " mm and " + Amount(finding, "length_deg") + " deg)";
  if (Is(finding, "beside", "errors_of_arm")) {
    const std::string subject =
        Is(finding, "evidence", "not_excluded")
            ? "the captures do not exclude that, beside the estimated errors of the arm, its poses have "
            : "beside the estimated errors of the arm, its poses have ";
    return {subject + "errors that vary smoothly with the pose (one sigma " + sigmas("smooth") + lengths +
                ": the stated uncertainties contain them",
            ""};
  }
  const std::string subject =
      Is(finding, "evidence", "not_excluded")
          ? "the captures do not exclude that the robot's poses have errors that vary smoothly with the pose, as those "
            "of most robots do (one sigma "
          : "the robot's poses have errors that vary smoothly with the pose (one sigma ";
  return {subject + sigmas("smooth") + lengths + ": they are predicted between the captures, which leaves a noise of " +
              sigmas("after") + " instead of " + sigmas("before") +
              "; they do not make the hand-eye pose more accurate, and say nothing about poses far from the captures "
              "or in other configurations of the arm" +
              // With the arms of a rig, `arm` is the one that the config names.
              (finding.Name("arm") ? ""
                                   : ". The errors of the arm itself can be estimated if the config names it "
                                     "(robot.model)"),
          ""};
}

FindingText SymmetricTarget(const Finding& finding) {
  return {SymmetryRemark(static_cast<size_t>(finding.Number("symmetries").value_or(2))), ""};
}

struct CodeWords {
  std::string_view code;
  FindingText (*words)(const Finding& finding);
};

constexpr CodeWords kWords[] = {
    {"uncertainty", &Uncertainty},
    {"at_working_point", &AtWorkingPoint},
    {"intrinsics_not_included", &IntrinsicsNotIncluded},
    {"required", &Required},
    {"hold_out", &HoldOutErrors},
    {"no_hold_out", &NoHoldOut},
    {"unmodelled_error", &UnmodelledError},
    {"few_captures", &FewCaptures},
    {"captures_left_out", &CapturesLeftOut},
    {"pixel_noise", &PixelNoise},
    {"influential_capture", &InfluentialCapture},
    {"closed_form_better", &ClosedFormBetter},
    {"no_estimate", &NoEstimate},
    {"poses_only", &PosesOnly},
    {"weak_direction", &WeakDirections},
    {"weak_direction_of", &WeakDirectionOf},
    {"suggested_captures", &SuggestedCapturesText},
    {"model", &Model},
    {"shape_scale", &ShapeScale},
    {"shape_bend", &ShapeBend},
    {"shape_twist", &ShapeTwist},
    {"shape_cubic", &ShapeCubic},
    {"rejected_model", &RejectedModel},
    {"no_better_model", &NoBetterModel},
    {"target_shape_ignored", &TargetShapeIgnored},
    {"robot_noise_ignored", &RobotNoiseIgnored},
    {"target_scale", &TargetScale},
    {"scale_source", &ScaleSource},
    {"held_intrinsics", &HeldIntrinsics},
    {"camera", &CameraUse},
    {"captures_contradict", &CapturesContradict},
    {"captures_scatter", &CapturesScatter},
    {"camera_reduced", &CameraReduced},
    {"few_captures_prior", &FewCapturesPrior},
    {"missing_ids", &MissingIds},
    {"seen_from_behind", &SeenFromBehind},
    {"time_offset", &TimeOffsetText},
    {"arm_estimated", &ArmEstimated},
    {"arm_declined", &ArmDeclined},
    {"arm_one_configuration", &ArmOneConfiguration},
    {"smooth_errors", &SmoothErrorsWords},
    {"arm_singular_captures", &ArmSingularCaptures},
    {"symmetric_target", &SymmetricTarget},
    {"camera_moved", &CameraMoved},
    {"drift", &DriftText},
    {"drift_unseen", &DriftUnseen},
    {"prior", &PriorText},
    {"target_points", &TargetPoints},
    {"points_estimated", &PointsEstimated},
    {"image_regions", &ImageRegions},
};

constexpr const CodeWords* WordsOf(std::string_view code) {
  for (const CodeWords& entry : kWords) {
    if (entry.code == code) return &entry;
  }
  return nullptr;
}

constexpr bool EachCodeHasWords() {
  for (const std::string_view code : kFindingCodes) {
    if (WordsOf(code) == nullptr) return false;
  }
  return true;
}
static_assert(EachCodeHasWords() && std::size(kWords) == std::size(kFindingCodes));

// Returns the words of the code, without those of a cause's consequences.
FindingText OwnWords(const Finding& finding) {
  if (!finding.text.empty()) return {finding.text, finding.action};
  if (const CodeWords* entry = WordsOf(finding.code)) {
    FindingText words = entry->words(finding);
    if (finding.grade == Grade::kGood) {
      words.action.clear();
      words.settings.clear();
    }
    return words;
  }
  std::vector<std::string> figures;
  for (const auto& [name, value] : finding.numbers) figures.push_back(name + " " + Significant(value, 3));
  return {finding.code + (figures.empty() ? "" : " (" + Join(figures, ", ") + ")"), finding.action};
}

}  // namespace

FindingText FindingWords(const Finding& finding) {
  FindingText words = OwnWords(finding);
  if (!finding.is_cause && !IsMisfit(finding)) return words;
  if (finding.parts.empty()) return words;
  // The first part says enough. A finding whose parts have texts was described before: its text contains it.
  const Finding& part = finding.parts.front();
  if (!finding.text.empty() && !part.text.empty()) return words;
  words.text += (finding.is_cause ? "; as a consequence, " : "; besides, ") + FindingWords(part).text;
  return words;
}

Finding Described(Finding finding, ConfigKeys keys) {
  finding.reason.text = FailureText(finding.reason, keys);
  FindingText words = FindingWords(finding);
  // A finding about one of several cameras, targets or arms names it.
  for (const auto& [key, kind] :
       {std::pair{"of_camera", "camera "}, std::pair{"of_target", "target "}, std::pair{"of_arm", "arm "}}) {
    const std::optional<std::string> name = finding.Name(key);
    if (!name || !finding.text.empty()) continue;
    words.text = kind + *name + ": " + words.text;
    if (kind != std::string_view("arm ")) continue;
    words.text = WithArmKeys(words.text, *name);
    words.action = WithArmKeys(words.action, *name);
  }
  finding.parts = Described(std::move(finding.parts), keys);
  finding.text = std::move(words.text);
  finding.action = std::move(words.action);
  return finding;
}

std::vector<Finding> Described(std::vector<Finding> findings, ConfigKeys keys) {
  for (Finding& finding : findings) finding = Described(std::move(finding), keys);
  return findings;
}

RunResult Described(RunResult result, ConfigKeys keys) {
  for (Estimate& estimate : result.estimates) estimate.reason.text = FailureText(estimate.reason, keys);
  for (ModelEntry& entry : result.model.alternatives) entry.reason.text = FailureText(entry.reason, keys);
  for (size_t r = 0; r < result.arms.size(); ++r) {
    if (!result.arms[r]) continue;
    Failure& reason = result.arms[r]->reason;
    reason.text = WithArmKeys(FailureText(reason, keys), result.rig.robots[r]);
  }
  result.verdict.findings = Described(std::move(result.verdict.findings), keys);
  return result;
}

}  // namespace heba
