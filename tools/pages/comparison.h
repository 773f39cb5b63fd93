// Compares finished runs: the gain of the refinement, the agreement of the hand-eye poses, the influence of the
// target.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/evaluation/evaluation.h"
#include "heba/evaluation/pose_difference.h"

namespace heba {

struct ComparedRun {
  std::string label;  // The name of the run, or its folder if names are not unique.
  RunResult result;
};

// The difference between the refined hand-eye poses of two runs of the same setup.
struct PairDifference : PoseDifference {
  size_t first = 0;  // Index into the compared runs.
  size_t second = 0;
};

struct Comparison {
  std::vector<ComparedRun> runs;
  std::vector<PairDifference> pairs;
  std::vector<std::string> findings;  // Sentences in plain words, the most important first.
};

Comparison CompareRuns(std::vector<ComparedRun> runs);

std::string ComparisonTable(const Comparison& comparison);  // Returns the table for the terminal.
std::string ComparisonRunsCsv(const Comparison& comparison);
std::string ComparisonPairsCsv(const Comparison& comparison);
std::string ComparisonPage(const Comparison& comparison);

}  // namespace heba
