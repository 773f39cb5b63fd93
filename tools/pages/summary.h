// Summarises a batch in one table: for the terminal, as summary.csv and as summary.html.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/evaluation/run_result.h"

namespace heba {

// One run of a batch: its result, or the reason why it failed.
struct BatchRun {
  std::string name;
  std::optional<RunResult> result;
  std::string reason;

  // Returns the verdict; null if the run failed.
  const Verdict* verdict() const { return result ? &result->verdict : nullptr; }
};

// Returns a header and one line for each run and method, or for each run and camera of a rig; a failed run has one line
// without a method. The output does not depend on the time or duration of the runs.
std::string SummaryCsv(const std::vector<BatchRun>& runs);
std::string SummaryPage(const std::string& title, const std::vector<BatchRun>& runs);
// Returns one line for each run, at most 80 columns wide.
std::string SummaryTable(const std::vector<BatchRun>& runs);

}  // namespace heba
