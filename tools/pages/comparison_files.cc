#include "tools/pages/comparison_files.h"

#include <algorithm>
#include <map>
#include <string>
#include <system_error>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/io/result_file.h"
#include "tools/config/run_folder.h"
#include "tools/files/result_folder.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

// Returns the folder itself if it is a run, or the runs in a batch's folder, sorted by name.
std::vector<fs::path> RunsIn(const fs::path& path) {
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

}  // namespace

std::vector<ComparedRun> ReadComparedRuns(const std::vector<fs::path>& paths) {
  std::vector<ComparedRun> runs;
  std::map<std::string, int> names;
  for (const fs::path& path : paths) {
    for (const fs::path& folder : RunsIn(path)) {
      runs.push_back(ComparedRunOf(folder.string(), ReadRunResult(folder / "result.json")));
      ++names[runs.back().name];
    }
  }
  for (ComparedRun& run : runs) {
    if (names[run.name] == 1) run.label = run.name;
  }
  return runs;
}

void WriteComparison(const Comparison& comparison, const fs::path& folder) {
  StagedFolder staged(folder, "a comparison");
  WriteFileAtomically(staged.staging() / "compare.csv", ComparisonRunsCsv(comparison));
  WriteFileAtomically(staged.staging() / "pairs.csv", ComparisonPairsCsv(comparison));
  WriteFileAtomically(staged.staging() / "compare.html", ComparisonPage(comparison));
  staged.Commit();
}

}  // namespace heba
