// Runs many configs in parallel, independently of one another.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "heba/evaluation/finding.h"
#include "tools/batch/run_demands.h"
#include "tools/text/console.h"

namespace heba {

// A part of the work: the items whose index modulo `count` is `index`, which counts from 0.
struct Shard {
  int index = 0;
  int count = 1;
};

struct BatchOptions {
  std::filesystem::path output;       // Holds a folder per run, and the summary; empty: each config decides.
  std::vector<std::string> settings;  // Values of --set.
  int num_threads = 1;                // For all runs together.
  bool resume = false;                // Skip runs whose results are complete and whose inputs are unchanged.
  Shard shard;
  RunDemands demands;
  Verbosity verbosity = Verbosity::kNormal;
};

// Runs the configs (those of the shard, if it is one of several) and, unless it is a shard, writes summary.csv and
// summary.html if `output` is set. A run that fails does not affect the others. Returns the exit status of the
// program. Throws InputError if the batch as a whole is impossible: two configs with the same results folder, or a
// folder that another program is using.
int RunBatch(const std::vector<std::string>& configs, const BatchOptions& options);

}  // namespace heba
