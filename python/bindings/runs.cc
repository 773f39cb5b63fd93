#include <filesystem>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <pybind11/functional.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "heba/base/error.h"
#include "heba/io/result_file.h"
#include "python/bindings/bindings.h"
#include "python/bindings/python_observer.h"
#include "tools/pipeline/pipeline.h"
#include "tools/config/rig_config.h"
#include "tools/config/run_config.h"
#include "tools/doctor/doctor.h"
#include "tools/doctor/rig_doctor.h"
#include "tools/text/console.h"
#include "tools/text/result_table.h"
#include "tools/text/rig_table.h"

namespace heba {
namespace {

// Runs a config, writes its folder and returns the folder.
std::filesystem::path RunFile(const std::filesystem::path& config_path, const std::vector<std::string>& settings,
                              const std::optional<std::filesystem::path>& out, int num_threads,
                              const pybind11::object& progress) {
  PythonObserver observer(progress);
  std::filesystem::path output;
  std::optional<std::string> failure;
  const auto run = [&](const auto& config) {
    output = out ? std::filesystem::absolute(*out) : config.output;
    Console console(Verbosity::kQuiet);
    const auto result = RunPipeline(config, output, num_threads, &console, &observer);
    if (!result) failure = result.reason();
  };
  {
    const pybind11::gil_scoped_release release;
    if (IsRigConfig(config_path, settings)) {
      run(ReadRigConfig(config_path, settings));
    } else {
      run(ReadRunConfig(config_path, settings));
    }
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
    diagnosis = IsRigConfig(config_path, settings)
                    ? Diagnose(ReadRigConfig(config_path, settings), num_threads, Verbosity::kQuiet)
                    : Diagnose(ReadRunConfig(config_path, settings), num_threads, Verbosity::kQuiet);
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

std::string TableOf(const std::filesystem::path& result_file) {
  const pybind11::gil_scoped_release release;
  if (IsRigResult(result_file)) return RigTable(ReadRigResult(result_file), Colour::kPlain);
  return ResultTable(ReadResult(result_file), Colour::kPlain);
}

}  // namespace

void BindRuns(pybind11::module_& module) {
  using pybind11::arg;
  module.def("run", &RunFile, arg("config"), arg("settings"), arg("out"), arg("num_threads"), arg("progress"));
  module.def("diagnose", &DiagnoseFile, arg("config"), arg("settings"), arg("num_threads"));
  module.def("table", &TableOf, arg("result_file"));
}

}  // namespace heba
