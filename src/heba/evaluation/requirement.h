// Requirements of accuracy that replace the built-in limits of the verdict.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "heba/evaluation/finding.h"

namespace heba {

// Why it is not known how well a target is located.
enum class Unreached {
  kNeverSeen,    // No image that the result uses shows a target.
  kNotInView,    // A required position is not in the image of the camera.
  kUndetermined  // The image of a target there would not determine its pose.
};
inline constexpr std::array<std::string_view, 3> kUnreachedNames = {"never_seen", "not_in_view", "undetermined"};

// The requirement that a target at a given position is located to `within_m` with a given confidence.
struct Requirement {
  double within_m = 0;
  double confidence = 0.95;
  std::string place;  // Description of the position, for messages.
  // Radius that contains the middle of the target with this confidence, the largest of all required positions; nothing
  // if a target cannot be located at one of them, or if that is not known.
  std::optional<double> reached_m = {};
  Unreached unreached = Unreached::kNeverSeen;  // The reason if there is no radius.
};

// Returns the finding `required`: good if both the accuracy that is reached and the held-out error, if there is one,
// are within the limit, and bad otherwise.
Finding JudgeRequirement(const Requirement& requirement, const std::optional<double>& holdout_target_mm);

}  // namespace heba
