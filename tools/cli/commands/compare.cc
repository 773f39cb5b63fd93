#include <algorithm>
#include <iostream>
#include <map>
#include <variant>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/io/result_file.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/config/finished_run.h"
#include "tools/files/result_folder.h"
#include "tools/pages/comparison.h"
#include "tools/pages/rig_comparison.h"
#include "tools/text/console.h"

namespace heba {
namespace {

// Returns the folder itself if it is a run, or the runs in a batch's folder, sorted by name.
std::vector<std::filesystem::path> RunsIn(const std::filesystem::path& path) {
  namespace fs = std::filesystem;
  const fs::path folder = RunFolderOf(path);
  std::error_code error;
  if (fs::exists(folder / "result.json", error) || !fs::is_directory(folder, error)) return {folder};
  std::vector<fs::path> runs;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    const bool is_hidden = entry.path().filename().string().starts_with(".");
    if (!is_hidden && fs::exists(entry.path() / "result.json", error)) runs.push_back(entry.path());
  }
  if (runs.empty()) throw InputError(folder.string() + ": contains no run (no result.json)");
  std::sort(runs.begin(), runs.end());
  return runs;
}

// A finished run of one camera or of a rig.
struct FinishedResult {
  std::string folder;
  std::variant<RunResult, RigResult> result;
  std::string label = {};  // The name of the run, or its folder if names are not unique.

  const std::string& name() const {
    return std::visit([](const auto& of_run) -> const std::string& { return of_run.name; }, result);
  }
  bool is_rig() const { return std::holds_alternative<RigResult>(result); }
};

std::vector<FinishedResult> ReadRuns(const std::vector<std::string>& arguments) {
  std::vector<FinishedResult> runs;
  std::map<std::string, int> names;
  for (const std::string& argument : arguments) {
    for (const std::filesystem::path& folder : RunsIn(argument)) {
      const std::filesystem::path file = folder / "result.json";
      if (IsRigResult(file)) {
        runs.push_back({folder.string(), ReadRigResult(file)});
      } else {
        runs.push_back({folder.string(), ReadResult(file)});
      }
      ++names[runs.back().name()];
    }
  }
  for (FinishedResult& run : runs) run.label = names[run.name()] == 1 ? run.name() : run.folder;
  return runs;
}

// The comparison as it is printed and written.
struct ComparisonOutput {
  std::string table;
  std::string runs_csv;
  std::string pairs_csv;
  std::string page;
};

ComparisonOutput OutputOf(const Comparison& comparison) {
  return {ComparisonTable(comparison), ComparisonRunsCsv(comparison), ComparisonPairsCsv(comparison),
          ComparisonPage(comparison)};
}

ComparisonOutput OutputOf(const RigComparison& comparison) {
  return {RigComparisonTable(comparison), RigComparisonRunsCsv(comparison), RigComparisonPairsCsv(comparison),
          RigComparisonPage(comparison)};
}

// Compares the runs by their cells if one of them is a rig.
ComparisonOutput Compare(const std::vector<FinishedResult>& runs) {
  if (std::any_of(runs.begin(), runs.end(), [](const FinishedResult& run) { return run.is_rig(); })) {
    std::vector<ComparedCell> cells;
    for (const FinishedResult& run : runs) {
      cells.push_back(std::visit([&](const auto& result) { return CellOf(run.label, result); }, run.result));
    }
    return OutputOf(CompareRigs(std::move(cells)));
  }
  std::vector<ComparedRun> compared;
  for (const FinishedResult& run : runs) compared.push_back({run.label, std::get<RunResult>(run.result)});
  return OutputOf(CompareRuns(std::move(compared)));
}

}  // namespace

int RunCommand_compare(const std::vector<std::string>& arguments) {
  const ComparisonOutput output = Compare(ReadRuns(arguments));
  if (!FLAGS_quiet) std::cout << ForTerminal(output.table);
  if (FLAGS_out.empty()) return kDone;
  StagedFolder folder(FLAGS_out, "a comparison");
  WriteFileAtomically(folder.staging() / "compare.csv", output.runs_csv);
  WriteFileAtomically(folder.staging() / "pairs.csv", output.pairs_csv);
  WriteFileAtomically(folder.staging() / "compare.html", output.page);
  folder.Commit();
  if (!FLAGS_quiet) std::cout << "results: " << std::filesystem::absolute(FLAGS_out).string() << std::endl;
  return kDone;
}

}  // namespace heba
