// Requirements of accuracy that replace the built-in limits of the verdict.
#pragma once

#include <optional>
#include <string>

#include "heba/evaluation/finding.h"

namespace heba {

// The requirement that a target at a given position is located to `within_m` with a given confidence.
struct Requirement {
  double within_m = 0;
  double confidence = 0.95;
  std::string place;  // Description of the position, for messages.
  // Radius that contains the middle of the target with this confidence, the largest of all required positions; nothing
  // if a target cannot be located at one of them.
  std::optional<double> reached_m = 0;
};

// Returns the finding `required`: good if both the accuracy that is reached and the held-out error, if there is one,
// are within the limit, and bad otherwise.
Finding JudgeRequirement(const Requirement& requirement, const std::optional<double>& holdout_target_mm);

}  // namespace heba
