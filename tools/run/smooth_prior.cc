#include "tools/run/smooth_prior.h"

#include <cstddef>
#include <string>

#include "heba/base/units.h"

namespace heba {

std::vector<std::optional<SmoothPrior>> SmoothPriorsOf(const RunResult& result) {
  std::vector<std::optional<SmoothPrior>> priors;
  for (size_t r = 0; r < result.rig.robots.size(); ++r) {
    std::optional<SmoothPrior>& prior = priors.emplace_back();
    if (const std::optional<RobotNoise> noise = SmoothNoiseOf(result.solution, r)) {
      prior = SmoothPrior{*noise, SmoothLengths()};
    }
    for (const Finding& finding : result.verdict.findings) {
      const std::string& robot = result.rig.robots[r];
      if (finding.code != "smooth_errors" || finding.Name("of_arm").value_or(robot) != robot) continue;
      const auto number = [&](const char* key) { return finding.Number(key).value_or(0); };
      // Beside the estimated errors of an arm, the finding alone has the sigmas.
      if (!prior) prior = SmoothPrior{{1e-3 * number("smooth_mm"), DegToRad(number("smooth_deg")), 0}, {}};
      if (number("length_mm") <= 0 || number("length_deg") <= 0) continue;
      prior->lengths = {1e-3 * number("length_mm"), DegToRad(number("length_deg"))};
    }
  }
  return priors;
}

}  // namespace heba
