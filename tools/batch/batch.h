// Many runs side by side, each for itself.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "heba/evaluation/finding.h"
#include "tools/text/console.h"

namespace heba {

// A part of the work: the items whose index modulo `count` is `index`, which counts from 0.
struct Shard {
  int index = 0;
  int count = 1;
};

struct BatchOptions {
  std::filesystem::path output;       // A folder for a folder a run, and the summary; empty: each config says where.
  std::vector<std::string> settings;  // --set
  int num_threads = 1;                // Of all runs together.
  bool resume = false;                // Runs whose results are complete and whose inputs are the same are left alone.
  Shard shard;
  std::optional<Grade> fail_on;  // --fail-on
  Verbosity verbosity = Verbosity::kNormal;
};

// Runs the configs (of a shard, those that are its index modulo its count) and writes summary.csv and summary.html, of
// a shard neither. A run that fails fails alone. The program's exit status. InputError if the batch as a whole cannot
// be: names that stand twice, a folder that another program works in.
int RunBatch(const std::vector<std::string>& configs, const BatchOptions& options);

}  // namespace heba
