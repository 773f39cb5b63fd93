// A user may demand two things of a run beside its result: a grade of its verdict (--fail-on), and that everything that
// was given is used (--strict).
#pragma once

#include <optional>
#include <string>

#include "heba/evaluation/finding.h"
#include "heba/evaluation/run_result.h"

namespace heba {

struct RunDemands {
  std::optional<Grade> fail_on;  // A verdict of this grade, or a worse one, is a failure.
  bool is_strict = false;        // Whether images, rows of poses, or an arm that are not used are a failure.
};

// Returns why a result does not meet the demands, as an error message; empty if it does.
std::string WhyNotMet(const RunResult& result, const RunDemands& demands);

}  // namespace heba
