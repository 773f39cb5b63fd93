// A batch in one table: for the terminal, as summary.csv and as summary.html.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/evaluation/evaluation.h"

namespace heba {

// One run of a batch: what came out of it, or why nothing did.
struct BatchRun {
  std::string name;
  std::optional<RunResult> result;
  std::string reason;
};

// A header, then a line a run and method; a failed run has one line, without a method. Nothing in it depends on when or
// how fast the runs were made.
std::string SummaryCsv(const std::vector<BatchRun>& runs);
std::string SummaryPage(const std::string& title, const std::vector<BatchRun>& runs);
// A line a run, at most 80 columns wide.
std::string SummaryTable(const std::vector<BatchRun>& runs);

}  // namespace heba
