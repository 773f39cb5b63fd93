#include "tools/batch/run_demands.h"

#include <algorithm>
#include <string>
#include <vector>

#include "heba/base/text.h"
#include "tools/config/common_keys.h"
#include "tools/text/failure_text.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {

// Returns what was given to a run and is not used, each with the reason. What the config leaves out was not given.
std::vector<std::string> UnusedInputs(const RunResult& result) {
  std::vector<std::string> unused;
  for (const ImageResult& image : result.images) {
    if (image.used || image.reason == kExcludedReason) continue;
    const std::string& name = image.image.empty() ? image.capture : image.image;
    unused.push_back((image.camera.empty() ? "" : image.camera + "/") + name + " (" + image.reason + ")");
  }
  for (const std::optional<RobotSummary>& arm : result.arms) {
    if (!arm || arm->is_estimated) continue;
    unused.push_back("the arm " + arm->nominal.name + " (" + FailureText(arm->reason) + ")");
  }
  return unused;
}

// Names the first of what is not used.
std::string UnusedText(const std::vector<std::string>& unused) {
  constexpr size_t kMostNamed = 3;
  std::vector<std::string> named = unused;
  if (named.size() > kMostNamed) {
    named.resize(kMostNamed);
    named.push_back("and " + std::to_string(unused.size() - kMostNamed) + " more");
  }
  return "not everything that was given is used (--strict): " + Join(named, "; ");
}

}  // namespace

std::string WhyNotMet(const RunResult& result, const RunDemands& demands) {
  if (demands.is_strict) {
    const std::vector<std::string> unused = UnusedInputs(result);
    if (!unused.empty()) return UnusedText(unused);
  }
  const Verdict& verdict = result.verdict;
  if (demands.fail_on && verdict.grade >= *demands.fail_on) return VerdictFailure(verdict);
  return "";
}

}  // namespace heba
