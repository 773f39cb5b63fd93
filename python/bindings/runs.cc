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
#include "python/bindings/bindings.h"
#include "python/bindings/python_observer.h"
#include "tools/doctor/cell_doctor.h"
#include "tools/doctor/doctor.h"
#include "tools/pipeline/pipeline.h"
#include "tools/text/console.h"
#include "tools/text/failure_text.h"

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

}  // namespace

void BindRuns(pybind11::module_& module) {
  using pybind11::arg;
  pybind11::class_<Cancellation>(module, "Cancellation").def(pybind11::init<>()).def("request", &Cancellation::Request);
  module.def("run", &RunFile, arg("config"), arg("settings"), arg("out"), arg("num_threads"), arg("progress"),
             arg("cancellation"));
  module.def("diagnose", &DiagnoseFile, arg("config"), arg("settings"), arg("num_threads"));
}

}  // namespace heba
