#include "tools/text/run_console.h"

#include <cmath>
#include <utility>
#include <vector>

#include "heba/base/text.h"
#include "tools/text/failure_text.h"
#include "tools/text/result_text.h"
#include "tools/text/target_symmetry.h"

namespace heba {
void ProgressObserver::OnStage(RunStage stage, int num_steps) {
  progress_.emplace(kRunStageNames[static_cast<size_t>(stage)], num_steps, verbosity_);
}

void ProgressObserver::OnStep(RunStage /*stage*/) { progress_->Step(); }

void ProgressObserver::OnStageEnd(RunStage /*stage*/) { progress_.reset(); }

void ConsoleObserver::OnDetected(const std::vector<std::string>& notes, int num_seen, int num_images) {
  for (const std::string& note : notes) Note(note);
  if (num_seen == 0) return;  // The run fails with a reason that says so.
  Note("the target was detected in " + std::to_string(num_seen) + " of " + std::to_string(num_images) + " images");
  std::vector<std::pair<std::string, std::string>> reasons;
  for (const LeftOutImages& entry : dataset_.left_out) reasons.emplace_back(entry.name, entry.reason);
  for (const auto& [reason, names] : GroupedByReason(reasons)) Note("without " + names + ": " + reason);
  const Target& target = *dataset_.targets.front();
  if (target.Symmetries().size() > 1) Note(SymmetryRemark(target));
}

void ConsoleObserver::OnCalibrated(const PairCalibration& calibration) {
  if (!dataset_.target_poses.empty()) {
    Note(FailureText(calibration.refined.failure()));
    return;
  }
  for (const UnusedView& unused : calibration.unused) {
    console_->Note("not used: " + unused.name + ": " + unused.reason);
  }
  // The reason of a failure is the first line that is printed of it.
  if (calibration.refined) console_->Note("seed: " + calibration.seed);
}

void ConsoleObserver::OnHoldOuts(const std::vector<HoldOut>& hold_outs) {
  std::vector<NamedReason> reasons;
  for (const HoldOut& hold_out : hold_outs) {
    if (!hold_out.reason.empty()) reasons.emplace_back(hold_out.method, FailureText(hold_out.reason));
  }
  for (const auto& [reason, methods] : GroupedByReason(reasons)) {
    console_->Note("no hold-out figure for " + methods + ": " + reason);
  }
}

}  // namespace heba
