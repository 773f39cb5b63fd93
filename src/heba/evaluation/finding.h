// A finding about a result: a code with figures and names, for programs and for whoever words it for people.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "heba/base/error.h"

namespace heba {

enum class Grade { kGood, kDoubtful, kBad };
inline constexpr std::array<std::string_view, 3> kGradeNames = {"good", "doubtful", "bad"};
inline std::string_view GradeName(Grade grade) { return kGradeNames[static_cast<size_t>(grade)]; }

// The codes of all findings about a run, then those of the findings that are only part of others. A code is stable over
// versions. docs/manual/codes has a section on each.
inline constexpr std::string_view kFindingCodes[] = {
    "uncertainty",
    "required",
    "hold_out",
    "no_hold_out",
    "unmodelled_error",
    "few_captures",
    "captures_left_out",
    "pixel_noise",
    "influential_capture",
    "closed_form_better",
    "no_estimate",
    "poses_only",
    "weak_direction",
    "model",
    "target_shape_ignored",
    "robot_noise_ignored",
    "target_scale",
    "scale_source",
    "held_intrinsics",
    "camera",
    "captures_contradict",
    "captures_scatter",
    "camera_reduced",
    "few_captures_prior",
    "missing_ids",
    "seen_from_behind",
    "time_offset",
    "arm_estimated",
    "arm_declined",
    "arm_one_configuration",
    "smooth_errors",
    "arm_singular_captures",
    "symmetric_target",
    "camera_moved",
    "drift",
    "drift_unseen",
    "prior",
    "target_points",
    "points_estimated",
    "image_regions",
    "at_working_point",
    "intrinsics_not_included",
    "weak_direction_of",
    "suggested_captures",
    "shape_scale",
    "shape_bend",
    "shape_twist",
    "shape_cubic",
    "rejected_model",
    "no_better_model",
};

// Returns `code`. A code that is not one of kFindingCodes does not compile.
consteval const char* FindingCode(const char* code) {
  for (const std::string_view known : kFindingCodes) {
    if (known == code) return code;
  }
  throw "the code is not one of kFindingCodes";
}

struct Finding {
  Grade grade = Grade::kGood;
  std::string code = {};  // Programs identify the finding by it.
  // The figures, each under a key that names it with its unit.
  std::vector<std::pair<std::string, double>> numbers = {};
  // The subjects that are not numbers, such as the name of an image, of a method or of the remedy that applies, each
  // under a key.
  std::vector<std::pair<std::string, std::string>> names = {};
  // True if the finding names a cause rather than a symptom. Its symptoms are then not listed separately.
  bool is_cause = false;
  // Findings that are reported within this one: the consequences of a cause, and the details of others.
  std::vector<Finding> parts = {};
  Failure reason = {};  // The failure that the finding reports, if there is one.
  // The words for people: the observation with its figures, and the remedy, which is empty if nothing needs to be done.
  // Libraries leave both empty.
  std::string text = {};
  std::string action = {};

  // Returns the first number, or name, under a key; nothing if there is none.
  std::optional<double> Number(std::string_view key) const;
  std::optional<std::string> Name(std::string_view key) const;
};

struct Verdict {
  Grade grade = Grade::kGood;     // The worst grade of the findings.
  std::vector<Finding> findings;  // The worst first; among equal grades, causes first.
};

}  // namespace heba
