#include <filesystem>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include <pybind11/functional.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "heba/base/error.h"
#include "heba/base/registry.h"
#include "heba/io/export_files.h"
#include "heba/io/result_file.h"
#include "python/bindings/bindings.h"
#include "python/bindings/python_observer.h"
#include "tools/config/run_export.h"
#include "tools/doctor/cell_doctor.h"
#include "tools/doctor/doctor.h"
#include "tools/pipeline/pipeline.h"
#include "tools/text/console.h"
#include "tools/text/failure_text.h"
#include "tools/text/result_table.h"

namespace heba {
namespace {

// Runs a config, writes its folder and returns the folder.
std::filesystem::path RunFile(const std::filesystem::path& config_path, const std::vector<std::string>& settings,
                              const std::optional<std::filesystem::path>& out, int num_threads,
                              const pybind11::object& progress, const Cancellation& cancellation) {
  PythonObserver observer(progress, cancellation);
  std::filesystem::path output;
  std::optional<std::string> failure;
  {
    const pybind11::gil_scoped_release release;
    const RunConfig config = ReadRunConfig(config_path, settings);
    output = out ? std::filesystem::absolute(*out) : config.output;
    Console console(Verbosity::kQuiet);
    const Outcome<RunResult> result = RunPipeline(config, output, num_threads, &console, &observer);
    if (!result) failure = FailureText(result.failure());
  }
  observer.RethrowIfRaised();
  if (failure) throw InputError(config_path.string() + ": " + *failure);
  return output;
}

// A symptom: code, is wrong, what, cure, and the settings that the cure changes, as KEY=VALUE.
using SymptomTuple = std::tuple<std::string, bool, std::string, std::string, std::vector<std::string>>;

std::vector<SymptomTuple> DiagnoseFile(const std::filesystem::path& config_path,
                                       const std::vector<std::string>& settings, int num_threads) {
  Diagnosis diagnosis;
  {
    const pybind11::gil_scoped_release release;
    diagnosis = Diagnose(ReadRunConfig(config_path, settings), num_threads, Verbosity::kQuiet);
  }
  std::vector<SymptomTuple> symptoms;
  for (const Symptom& symptom : diagnosis.symptoms) {
    std::vector<std::string> changes;
    for (const auto& [key, value] : symptom.settings) changes.push_back(key + "=" + value);
    symptoms.emplace_back(symptom.code.name(), symptom.severity == Severity::kWrong, symptom.what, symptom.cure,
                          std::move(changes));
  }
  return symptoms;
}

// Returns the names and the texts of the files of an export.
std::vector<std::pair<std::string, std::string>> ExportOf(const std::filesystem::path& result_file,
                                                          const std::string& format_name, bool is_forced) {
  const pybind11::gil_scoped_release release;
  const ExportFormat* const format = FindEntry(ExportFormats(), format_name);
  if (format == nullptr) throw InputError("format: " + UnknownName(format_name, NamesOf(ExportFormats())));
  const RunResult result = ReadWholeResult(result_file);
  const ExportRequests requests = ExportRequestsOf(result_file.parent_path(), result, kBundleMethod);
  std::vector<std::pair<std::string, std::string>> files;
  std::string reason;
  for (const ExportedFile& file :
       FilesToExport({*format}, requests, result.verdict.grade, is_forced, "force=True exports it")) {
    if (!file.text.empty()) files.emplace_back(file.name, file.text);
    if (reason.empty()) reason = file.reason;
  }
  if (files.empty()) throw InputError("format " + format_name + ": " + reason);
  return files;
}

std::string TableOf(const std::filesystem::path& result_file) {
  const pybind11::gil_scoped_release release;
  return ResultTable(ReadRunResult(result_file), Colour::kPlain);
}

}  // namespace

void BindRuns(pybind11::module_& module) {
  using pybind11::arg;
  pybind11::class_<Cancellation>(module, "Cancellation").def(pybind11::init<>()).def("request", &Cancellation::Request);
  module.def("run", &RunFile, arg("config"), arg("settings"), arg("out"), arg("num_threads"), arg("progress"),
             arg("cancellation"));
  module.def("diagnose", &DiagnoseFile, arg("config"), arg("settings"), arg("num_threads"));
  module.def("export", &ExportOf, arg("result_file"), arg("format"), arg("force"));
  module.def("table", &TableOf, arg("result_file"));
}

}  // namespace heba
