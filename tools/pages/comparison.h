// Finished runs side by side: what refining gains, whether their hand-eye poses agree, whether the target matters.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/evaluation/evaluation.h"

namespace heba {

struct ComparedRun {
  std::string label;  // Its name, or its folder where names stand twice.
  RunResult result;
};

// The refined hand-eye poses of two runs of one set-up.
struct PairDifference {
  size_t first = 0;  // Of the runs.
  size_t second = 0;
  double distance_mm = 0;
  double angle_deg = 0;
  // One sigma of each, as both runs' covariances have it.
  double sigma_mm = 0;
  double sigma_deg = 0;
  // Of a difference that large or larger between runs that measure the same, by Hotelling's test of all six numbers
  // with the sum of the two covariances: as if they shared no captures, and with the smaller number of degrees of
  // freedom of the two.
  double p_value = 1;
};

struct Comparison {
  std::vector<ComparedRun> runs;
  std::vector<PairDifference> pairs;
  std::vector<std::string> findings;  // In plain words, the answer first.
};

Comparison CompareRuns(std::vector<ComparedRun> runs);

std::string ComparisonTable(const Comparison& comparison);  // For the terminal.
std::string ComparisonRunsCsv(const Comparison& comparison);
std::string ComparisonPairsCsv(const Comparison& comparison);
std::string ComparisonPage(const Comparison& comparison);

}  // namespace heba
