#include <algorithm>
#include <iostream>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/config/study_config.h"
#include "tools/files/result_folder.h"
#include "tools/study/cell_run.h"
#include "tools/study/study_cells.h"
#include "tools/study/study_files.h"
#include "tools/study/study_tables.h"
#include "tools/text/console.h"

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
  const Shard shard = ParseShard();
  const bool is_whole = shard.count == 1;
  const FolderLock lock(output, ".heba.lock", is_whole ? FolderLock::Kind::kAlone : FolderLock::Kind::kShared);
  const StudyCells cells(output, study);
  std::vector<CellResult> results;
  std::vector<int> to_do;
  size_t num_known = 0;
  for (const int cell : CellsOf(shard, static_cast<int>(study.cells.size()))) {
    const std::optional<std::vector<CellResult>> known = FLAGS_resume ? cells.Find(cell) : std::nullopt;
    if (known) {
      results.insert(results.end(), known->begin(), known->end());
      ++num_known;
    } else {
      to_do.push_back(cell);
    }
  }
  if (num_known > 0 && !FLAGS_quiet) {
    std::cerr << num_known << " of " << num_known + to_do.size() << " cells were already complete" << std::endl;
  }
  // The first trial of a large cell may take a while.
  if (!FLAGS_quiet) {
    std::cerr << to_do.size() << (to_do.size() == 1 ? " cell, " : " cells, ") << study.num_trials << " trials each"
              << std::endl;
  }
  Progress progress("trial", static_cast<int64_t>(to_do.size()) * study.num_trials,
                    FLAGS_quiet ? Verbosity::kQuiet : Verbosity::kNormal);
  for (const int index : to_do) {
    const std::vector<CellResult> of_cell = RunCell(study, index, NumThreads(), [&] { progress.Step(); });
    cells.Keep(of_cell);
    results.insert(results.end(), of_cell.begin(), of_cell.end());
  }
  std::stable_sort(results.begin(), results.end(),
                   [](const CellResult& a, const CellResult& b) { return a.cell < b.cell; });
  if (is_whole) WriteStudy(study, results, output);
  if (!FLAGS_quiet) std::cout << ForTerminal(StudyTable(results)) << "results: " << output.string() << std::endl;
  return kDone;
}

}  // namespace heba
