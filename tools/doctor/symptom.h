// A symptom that the doctor finds: one sentence on the fault with its evidence, one on its cure.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "heba/evaluation/finding.h"
#include "tools/text/config_setting.h"

namespace heba {

enum class Severity { kRemark, kWrong };

// The codes of all symptoms but those that are findings of a run (kFindingCodes). A code is stable over versions,
// because other programs search for it. docs/manual/codes has a section on each.
inline constexpr std::string_view kSymptomCodes[] = {
    "pose_format",
    "target",
    "target_not_seen",
    "target_often_missed",
    "no_camera",
    "camera_size",
    "camera_scale",
    "camera",
    "distortion",
    "rotation_format",
    "angle_unit",
    "pose_units",
    "pose_direction",
    "rotation_inverse",
    "mount",
    "other_arm",
    "pairing",
    "target_scale",
    "poses_unexplained",
    "rotation_not_recorded",
    "robot_model",
    "robot_tool",
    "robot_base",
    "robot_unreachable",
    "joint_angle",
    "joint_pairing",
    "joints_unexplained",
    "nominal_kinematics",
    "calibrated_kinematics",
    "singular_captures",
    "few_captures",
    "motion",
    "little_rotation",
    "same_picture",
    "unpaired",
    "repeated_image",
    "same_pose",
    "poses_jump",
    "swapped",
    "wrong_pose",
    "contradicts",
    "lens",
    "no_result",
    "symmetric_target",
    "camera_moved",
    "either_set_up",
};

// One of kSymptomCodes, or the code of a finding.
class SymptomCode {
 public:
  constexpr SymptomCode() = default;
  // A code that is not one of kSymptomCodes does not compile.
  consteval SymptomCode(const char* code) : name_(Known(code)) {}  // NOLINT(google-explicit-constructor)
  static SymptomCode OfFinding(const Finding& finding);

  constexpr std::string_view name() const { return name_; }
  friend constexpr bool operator==(const SymptomCode& code, std::string_view name) { return code.name_ == name; }
  friend constexpr bool operator==(const SymptomCode& a, const SymptomCode& b) { return a.name_ == b.name_; }

 private:
  static consteval std::string_view Known(const char* code) {
    for (const std::string_view known : kSymptomCodes) {
      if (known == code) return known;
    }
    throw "the code is not one of kSymptomCodes";
  }

  std::string_view name_;
};

struct Symptom {
  Severity severity = Severity::kRemark;
  SymptomCode code;
  std::string what;  // Includes the evidence, unless that has a clause of its own.
  std::string cure;  // The change to make; may be empty.
  // The settings of the config that the cure changes; empty if it is another change, or one of several.
  std::vector<ConfigSetting> settings = {};
  std::string evidence = {};  // The clause that errors leave out; may be empty.
  std::string reading = {};   // How the data must be read instead, if that distinguishes symptoms with one code.
  // The captures, and the cameras of a rig, that have it. Empty lists: they are not known, or do not matter.
  std::vector<std::string> captures = {};
  std::vector<std::string> cameras = {};

  // Returns what is wrong, with the evidence.
  std::string Text() const { return evidence.empty() ? what : what + "; " + evidence; }
};

// The reading of poses that are the inverse of what the config of a rig says. The symptom has no cure: poses_are may be
// wrong, or mounts.
inline constexpr const char* kInversePoses = "inverse";

// Returns the clause of images that belong to poses some rows further down (`step` is positive) or up from `first` on.
std::string ShiftedFromOnText(const std::string& first, std::ptrdiff_t step);

// Returns whether a symptom concerns single captures, which a calibration leaves out: by its code, or because images
// are paired wrongly from one of them on.
bool IsOfSingleCaptures(const Symptom& symptom);

}  // namespace heba
