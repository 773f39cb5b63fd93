#include "tools/study/cell_run.h"

#include <mutex>
#include <type_traits>
#include <utility>

#include "heba/base/parallel.h"

namespace heba {
namespace {

// Runs `run` for every trial. All cells use the same random numbers in the same trial, so that differences between them
// are not due to chance.
template <class Run>
auto RunTrials(const StudyConfig& study, int num_threads, const std::function<void()>& progress, const Run& run) {
  std::vector<std::invoke_result_t<Run, int>> trials(static_cast<size_t>(study.num_trials));
  std::mutex mutex;
  ParallelFor(study.num_trials, num_threads, [&](int trial) {
    trials[static_cast<size_t>(trial)] = run(trial);
    const std::lock_guard<std::mutex> guard(mutex);
    progress();
  });
  return trials;
}

}  // namespace

std::vector<CellResult> RunCell(const StudyConfig& study, int cell, int num_threads,
                                const std::function<void()>& progress) {
  const auto place = static_cast<size_t>(cell);
  const StudyLabels& labels = study.labels[place];
  if (const auto* const of_camera = std::get_if<StudyCell>(&study.cells[place])) {
    const auto trials =
        RunTrials(study, num_threads, progress, [&](int trial) { return RunTrial(*of_camera, study.seed, trial); });
    return {{cell, labels, ErrorBound(*of_camera), Summarise(*of_camera, trials)}};
  }
  const auto& of_rig = std::get<RigStudyCell>(study.cells[place]);
  const auto trials =
      RunTrials(study, num_threads, progress, [&](int trial) { return RunRigTrial(of_rig, study.seed, trial); });
  std::vector<CellResult> results;
  for (RigPoseSummary& summary : SummariseRig(of_rig, trials)) {
    results.push_back({cell, labels, std::move(summary.bound), std::move(summary.methods)});
    results.back().labels.pose = summary.pose;
  }
  return results;
}

}  // namespace heba
