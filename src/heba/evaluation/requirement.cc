#include "heba/evaluation/requirement.h"

namespace heba {

Finding JudgeRequirement(const Requirement& requirement, const std::optional<double>& holdout_target_mm) {
  const double within_mm = 1000 * requirement.within_m;
  const double held_out_mm = holdout_target_mm.value_or(0);
  const bool is_reached = requirement.reached_m && *requirement.reached_m <= requirement.within_m;
  Finding finding;
  finding.code = FindingCode("required");
  finding.grade = is_reached && held_out_mm <= within_mm ? Grade::kGood : Grade::kBad;
  finding.numbers = {{"required_mm", within_mm}};
  if (requirement.reached_m) finding.numbers.emplace_back("reached_mm", 1000 * *requirement.reached_m);
  finding.numbers.emplace_back("held_out_mm", held_out_mm);
  finding.numbers.emplace_back("confidence", requirement.confidence);
  finding.names = {{"place", requirement.place}, {"hold_out", holdout_target_mm ? "known" : "unknown"}};
  if (!requirement.reached_m) {
    finding.names.emplace_back("unreached", kUnreachedNames[static_cast<size_t>(requirement.unreached)]);
  }
  return finding;
}

}  // namespace heba
