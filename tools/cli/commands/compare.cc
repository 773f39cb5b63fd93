#include <algorithm>
#include <iostream>
#include <map>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/io/result_file.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/config/run_folder.h"
#include "tools/files/result_folder.h"
#include "tools/pages/comparison.h"
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

std::vector<ComparedRun> ReadRuns(const std::vector<std::string>& arguments) {
  std::vector<ComparedRun> runs;
  std::map<std::string, int> names;
  for (const std::string& argument : arguments) {
    for (const std::filesystem::path& folder : RunsIn(argument)) {
      runs.push_back(ComparedRunOf(folder.string(), ReadRunResult(folder / "result.json")));
      ++names[runs.back().name];
    }
  }
  for (ComparedRun& run : runs) {
    if (names[run.name] == 1) run.label = run.name;
  }
  return runs;
}

}  // namespace

int RunCommand_compare(const std::vector<std::string>& arguments) {
  const Comparison comparison = CompareRuns(ReadRuns(arguments));
  if (!FLAGS_quiet) std::cout << ForTerminal(ComparisonTable(comparison));
  if (FLAGS_out.empty()) return kDone;
  StagedFolder folder(FLAGS_out, "a comparison");
  WriteFileAtomically(folder.staging() / "compare.csv", ComparisonRunsCsv(comparison));
  WriteFileAtomically(folder.staging() / "pairs.csv", ComparisonPairsCsv(comparison));
  WriteFileAtomically(folder.staging() / "compare.html", ComparisonPage(comparison));
  folder.Commit();
  if (!FLAGS_quiet) std::cout << "results: " << std::filesystem::absolute(FLAGS_out).string() << std::endl;
  return kDone;
}

}  // namespace heba
