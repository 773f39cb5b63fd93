// Compares finished runs: the gain of the refinement, the agreement of the hand-eye poses, the influence of the
// target.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/evaluation/evaluation.h"

namespace heba {

struct ComparedRun {
  std::string label;  // The name of the run, or its folder if names are not unique.
  RunResult result;
};

// The difference between the refined hand-eye poses of two runs of the same setup.
struct PairDifference {
  size_t first = 0;  // Index into the compared runs.
  size_t second = 0;
  double distance_mm = 0;
  double angle_deg = 0;
  // One sigma of distance and angle, from the sum of the covariances of both runs.
  double sigma_mm = 0;
  double sigma_deg = 0;
  // The probability of a difference at least as large between two runs that measure the same pose: Hotelling's test
  // of all six coordinates with the sum of the two covariances. It assumes that the runs share no captures and uses
  // the smaller number of degrees of freedom of the two.
  double p_value = 1;
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
