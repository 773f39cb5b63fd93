#include <exception>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <pybind11/functional.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "heba/base/error.h"
#include "heba/io/result_file.h"
#include "heba/run.h"
#include "python/bindings/bindings.h"
#include "tools/batch/pipeline.h"
#include "tools/config/run_config.h"
#include "tools/doctor/doctor.h"
#include "tools/text/console.h"
#include "tools/text/result_table.h"

namespace heba {
namespace {

// Tells a function in Python how far a run is: the stage, the steps that are done, and their number. An exception of
// that function, or an interrupt from the keyboard, ends the run.
class PythonObserver final : public RunObserver {
 public:
  explicit PythonObserver(pybind11::object progress) : progress_(std::move(progress)) {}

  void OnStage(RunStage stage, int num_steps) override {
    num_done_ = 0;
    num_steps_ = num_steps;
    Tell(stage);
  }
  void OnStep(RunStage stage) override {
    ++num_done_;
    Tell(stage);
  }
  bool IsCancelled() override {
    const pybind11::gil_scoped_acquire acquire;
    if (!raised_ && PyErr_CheckSignals() != 0) raised_ = pybind11::error_already_set();
    return raised_.has_value();
  }
  void RethrowIfRaised() const {
    if (raised_) throw pybind11::error_already_set(*raised_);
  }

 private:
  void Tell(RunStage stage) {
    constexpr const char* kNames[] = {"detection", "second detection", "hold-out"};
    const pybind11::gil_scoped_acquire acquire;
    if (progress_.is_none() || raised_) return;
    try {
      progress_(kNames[static_cast<size_t>(stage)], num_done_, num_steps_);
    } catch (const pybind11::error_already_set& error) {
      raised_ = error;
    }
  }

  pybind11::object progress_;
  int num_done_ = 0;
  int num_steps_ = 0;
  std::optional<pybind11::error_already_set> raised_;
};

// Runs a config, writes its folder and returns the folder.
std::filesystem::path RunFile(const std::filesystem::path& config_path, const std::vector<std::string>& settings,
                              const std::optional<std::filesystem::path>& out, int num_threads,
                              const pybind11::object& progress) {
  PythonObserver observer(progress);
  std::filesystem::path output;
  Outcome<RunResult> result = Failure{""};
  {
    const pybind11::gil_scoped_release release;
    const RunConfig config = ReadRunConfig(config_path, settings);
    output = out ? std::filesystem::absolute(*out) : config.output;
    Console console(Verbosity::kQuiet);
    result = RunPipeline(config, output, num_threads, &console, &observer);
  }
  observer.RethrowIfRaised();
  if (!result) throw InputError(config_path.string() + ": " + result.reason());
  return output;
}

// Returns the symptoms as (code, is wrong, what, cure).
std::vector<std::tuple<std::string, bool, std::string, std::string>> DiagnoseFile(
    const std::filesystem::path& config_path, const std::vector<std::string>& settings, int num_threads) {
  Diagnosis diagnosis;
  {
    const pybind11::gil_scoped_release release;
    diagnosis = Diagnose(ReadRunConfig(config_path, settings), num_threads, Verbosity::kQuiet);
  }
  std::vector<std::tuple<std::string, bool, std::string, std::string>> symptoms;
  for (const Symptom& symptom : diagnosis.symptoms) {
    symptoms.emplace_back(symptom.code.name(), symptom.severity == Severity::kWrong, symptom.what, symptom.cure);
  }
  return symptoms;
}

std::string TableOf(const std::filesystem::path& result_file) {
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
