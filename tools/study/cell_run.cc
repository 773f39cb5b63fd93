#include "tools/study/cell_run.h"

#include <mutex>
#include <utility>

#include "heba/base/parallel.h"

namespace heba {

std::vector<CellResult> RunCell(const StudyConfig& study, int cell, int num_threads,
                                const std::function<void()>& progress) {
  const auto place = static_cast<size_t>(cell);
  std::vector<std::vector<std::vector<TrialEstimate>>> trials(static_cast<size_t>(study.num_trials));
  std::mutex mutex;
  // All cells use the same random numbers in the same trial, so that differences between them are not due to chance.
  ParallelFor(study.num_trials, num_threads, [&](int trial) {
    trials[static_cast<size_t>(trial)] = RunTrial(study.cells[place], study.seed, trial);
    const std::lock_guard<std::mutex> guard(mutex);
    progress();
  });
  std::vector<CellResult> results;
  for (PoseSummary& summary : Summarise(study.cells[place], trials)) {
    results.push_back({cell, study.labels[place], std::move(summary.bound), std::move(summary.methods)});
    results.back().labels.pose = summary.pose;
  }
  return results;
}

}  // namespace heba
