#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "heba/base/error.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "python/bindings/bindings.h"
#include "targets/render/papers.h"
#include "tools/pipeline/target_sheet.h"

namespace heba {
namespace {

// Writes the printed sheet of a target. Returns the file with the positions of its points, and the warnings.
std::pair<std::filesystem::path, std::vector<std::string>> WriteSheetOf(const std::string& target,
                                                                        const std::filesystem::path& out,
                                                                        const std::string& paper_name, double dpi) {
  const pybind11::gil_scoped_release release;
  SheetOptions options;
  options.dpi = dpi;
  if (!paper_name.empty()) {
    const Paper* const paper = FindEntry(Papers(), paper_name);
    if (paper == nullptr) throw InputError("paper: " + UnknownName(paper_name, NamesOf(Papers())));
    options.paper = *paper;
  }
  if (const std::string faults = options.Check(); !faults.empty()) {
    throw InputError("dpi: " + Join(Split(faults, '\n'), "; "));
  }
  TargetSheet written = WriteTargetSheet(target, options, out);
  return {std::move(written.points_file), std::move(written.warnings)};
}

}  // namespace

void BindSheets(pybind11::module_& module) {
  using pybind11::arg;
  module.def("write_sheet", &WriteSheetOf, arg("target"), arg("out"), arg("paper"), arg("dpi"));
}

}  // namespace heba
