#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "heba/base/error.h"
#include "python/bindings/bindings.h"
#include "python/bindings/python_observer.h"
#include "tools/config/study_config.h"
#include "tools/files/result_folder.h"
#include "tools/study/cell_run.h"
#include "tools/study/study_cells.h"
#include "tools/study/study_files.h"
#include "tools/study/study_tables.h"

namespace heba {
namespace {

// Runs all cells of a study, and writes its folder if there is one. Returns its table, and its rows as CSV.
std::pair<std::string, std::string> Study(const std::filesystem::path& config,
                                          const std::optional<std::filesystem::path>& out, int num_threads,
                                          const Cancellation& cancellation) {
  const pybind11::gil_scoped_release release;
  const StudyConfig study = ReadStudyConfig(config);
  std::optional<FolderLock> lock;
  std::optional<StudyCells> cells;
  if (out) {
    lock.emplace(*out, ".heba.lock", FolderLock::Kind::kAlone);
    cells.emplace(*out, study);
  }
  const auto end_if_cancelled = [&] {
    if (cancellation.is_requested()) throw InputError("the study was interrupted");
  };
  std::vector<CellResult> results;
  for (size_t cell = 0; cell < study.cells.size(); ++cell) {
    const std::vector<CellResult> of_cell = RunCell(study, static_cast<int>(cell), num_threads, end_if_cancelled);
    if (cells) cells->Keep(of_cell);
    results.insert(results.end(), of_cell.begin(), of_cell.end());
  }
  if (out) WriteStudy(study, results, *out);
  return {StudyTable(results), StudyCsv(results)};
}

}  // namespace

void BindStudies(pybind11::module_& module) {
  using pybind11::arg;
  module.def("study", &Study, arg("config"), arg("out"), arg("num_threads"), arg("cancellation"));
}

}  // namespace heba
