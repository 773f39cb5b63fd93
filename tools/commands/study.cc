#include <iostream>
#include <mutex>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/parallel.h"
#include "heba/base/text.h"
#include "tools/command.h"
#include "tools/console.h"
#include "tools/flags.h"
#include "tools/study_config.h"
#include "tools/study_report.h"

namespace heba {
namespace {

std::vector<int> CellsOf(const Shard& shard, int num_cells) {
  std::vector<int> cells;
  for (int cell = shard.index; cell < num_cells; cell += shard.count) cells.push_back(cell);
  return cells;
}

}  // namespace

int RunCommand_study(const std::vector<std::string>& arguments) {
  const StudyConfig study = ReadStudyConfig(arguments[0]);
  const std::filesystem::path output = FLAGS_out.empty() ? study.output : std::filesystem::absolute(FLAGS_out);
  const std::vector<int> cells = CellsOf(ParseShard(), static_cast<int>(study.cells.size()));
  StagedFolder folder(output, "study.csv");
  // Every trial of every cell by itself: the result does not depend on which thread did it.
  std::vector<std::vector<std::vector<TrialEstimate>>> trials(cells.size());
  for (auto& of_cell : trials) of_cell.resize(static_cast<size_t>(study.num_trials));
  const int num_tasks = static_cast<int>(cells.size()) * study.num_trials;
  {
    Progress progress("trial", num_tasks, FLAGS_quiet ? Verbosity::kQuiet : Verbosity::kNormal);
    std::mutex mutex;
    ParallelFor(num_tasks, NumThreads(), [&](int task) {
      const size_t place = static_cast<size_t>(task / study.num_trials);
      const int trial = task % study.num_trials;
      const StudyCell& cell = study.cells[static_cast<size_t>(cells[place])];
      // Cells share their noise, trial by trial: what differs between them is not chance.
      trials[place][static_cast<size_t>(trial)] = RunTrial(cell, study.seed, trial);
      const std::lock_guard<std::mutex> lock(mutex);
      progress.Step();
    });
  }
  std::vector<CellResult> results;
  for (size_t place = 0; place < cells.size(); ++place) {
    const size_t cell = static_cast<size_t>(cells[place]);
    results.push_back(
        {cells[place], study.labels[cell], ErrorBound(study.cells[cell]), Summarise(study.cells[cell], trials[place])});
  }
  WriteFileAtomically(folder.staging() / "config.yaml", study.used);
  WriteFileAtomically(folder.staging() / "study.csv", StudyCsv(results));
  WriteFileAtomically(folder.staging() / "study.txt", StudyTable(results));
  WriteStudyPlots(results, folder.staging());
  folder.Commit();
  if (!FLAGS_quiet) std::cout << StudyTable(results) << "results: " << output.string() << std::endl;
  return kDone;
}

}  // namespace heba
