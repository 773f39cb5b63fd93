#include "tools/pipeline/pipeline.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "heba/base/files.h"
#include "heba/base/stopwatch.h"
#include "heba/evaluation/verdict.h"
#include "heba/io/result_file.h"
#include "heba/run.h"
#include "tools/doctor/cell_doctor.h"
#include "tools/doctor/doctor.h"
#include "tools/files/cached_detector.h"
#include "tools/files/detection_file.h"
#include "tools/files/result_folder.h"
#include "tools/pages/report.h"
#include "tools/pipeline/run_inputs.h"
#include "tools/text/finding_text.h"
#include "tools/text/run_console.h"
#include "tools/text/run_notes.h"

namespace heba {
namespace {

ReportContext ContextOf(const std::filesystem::path& config_file, const std::string& config_used,
                        const std::filesystem::path& output) {
  return {TimeNow(), std::filesystem::absolute(config_file).lexically_normal(), config_used,
          std::filesystem::absolute(output).lexically_normal()};
}

// Returns whether captures that show the target were left out, other than copies.
bool HasContradictions(const RunResult& result) {
  return std::any_of(result.images.begin(), result.images.end(), [](const ImageResult& image) {
    return !image.used && !image.targets.empty() && image.repeat_of.empty();
  });
}

// Returns the run with its verdict, and with the doctor's first fault before the findings of a result that is not good,
// or that has left captures out; of a rig only if the result is bad.
RunOutput WithVerdict(RunOutput run, const RunConfig& config, int num_threads) {
  RunResult& result = run.result;
  result.verdict = JudgeRun(result);
  const bool is_good = result.verdict.grade == Grade::kGood;
  const bool is_bad = result.verdict.grade == Grade::kBad;
  if (IsShort(result) ? is_good && !HasContradictions(result) : !is_bad) return run;
  Diagnosis diagnosis = Diagnose(config, num_threads, Verbosity::kQuiet, Examine::kInputs);
  // A motion that the adjustment has measured is not replaced by its consequences. The doctor looks for an arm that
  // reaches all poses in one configuration; one whose errors explain the captures is the right one, in several.
  const bool has_arm = result.arms.size() == 1 && FindEstimatedArm(result, 0) != nullptr;
  std::erase_if(diagnosis.symptoms, [&](const Symptom& symptom) {
    return IsExplainedByMotion(symptom, run.calibration) || (has_arm && symptom.code.name().starts_with("robot_"));
  });
  // Poses that the doctor cannot explain are no cause of a fit that is only doubtful.
  const bool explains = diagnosis.NumWrong() > 0 && diagnosis.symptoms.front().code.name() != "poses_unexplained";
  if (!is_bad && !explains) return run;
  // The cause of captures that were left out does not make the rest doubtful.
  if (is_good && !IsOfSingleCaptures(diagnosis.symptoms.front())) return run;
  result.observations = WithCause(diagnosis, std::move(result.observations));
  if (is_good) result.observations.front().grade = Grade::kGood;
  result.verdict = JudgeRun(result);
  return run;
}

// Returns findings that name the targets that look the same in several orientations.
std::vector<Finding> SymmetriesOf(const Dataset& dataset) {
  std::vector<Finding> findings;
  for (size_t t = 0; t < dataset.targets.size(); ++t) {
    if (dataset.targets[t]->Symmetries().size() < 2) continue;
    const auto num_symmetries = static_cast<double>(dataset.targets[t]->Symmetries().size());
    Finding finding{Grade::kGood, FindingCode("symmetric_target"), {{"symmetries", num_symmetries}}};
    const std::string& name = dataset.rig.targets[t].name;
    if (!name.empty()) finding.names.emplace_back("of_target", name);
    findings.push_back(std::move(finding));
  }
  return findings;
}

// Runs the data set of a config, and adds notes on the run to the console.
Outcome<RunOutput> RunData(const RunConfig& config, int num_threads, Console* console, RunObserver* listener) {
  Dataset data = config.data;
  if (config.truth) data.truth = ReadCellTruth(*config.truth, data.rig);
  if (config.imported) {
    console->Note(data.name + ": read as a data set of " + config.imported->format);
    for (const std::string& remark : config.imported->remarks) console->Note(data.name + ": " + remark);
  }
  RunOptions options = config.options;
  options.num_threads = num_threads;
  options.detect = CachedDetections(data, config.targets_used);
  if (IsShort(data.rig)) {
    SharedObserver<ConsoleObserver> observer(listener, data, console);
    return Run(data, options, &observer);
  }
  for (const LeftOutImages& entry : data.left_out) console->Note(data.name + ": " + entry.name + ": " + entry.reason);
  SharedObserver<ProgressObserver> observer(listener, console->verbosity());
  Outcome<RunOutput> run = Run(data, options, &observer);
  if (!run) return run;
  for (const std::string& note : DetectionNotes(run->dataset, run->detections)) console->Note(note);
  for (const std::string& note : LeftOutNotes(run->result.images)) console->Note(data.name + ": " + note);
  return run;
}

}  // namespace

Outcome<RunResult> RunPipeline(const RunConfig& config, const std::filesystem::path& output, int num_threads,
                               Console* console, RunObserver* listener) {
  const Stopwatch watch;
  // The folder is created first, so that a run that cannot be written fails before the work.
  StagedFolder folder(output, "the results of a run");
  const std::string inputs = RunInputsText(config);
  Outcome<RunOutput> run = RunData(config, num_threads, console, listener);
  if (!run && run.failure().code == kCancelled) return run.failure();
  if (!run) {
    const Diagnosis diagnosis = Diagnose(config, num_threads, Verbosity::kQuiet, Examine::kInputs);
    return Failure{WithDiagnosis(FailureText(run.failure()), diagnosis)};
  }
  RunResult& result = run->result;
  if (!run->detections.empty()) {
    for (Finding& finding : SymmetriesOf(run->dataset)) result.observations.push_back(std::move(finding));
  }
  *run = WithVerdict(std::move(*run), config, num_threads);
  result = Described(std::move(result));
  result.timing.total_s = watch.Seconds();
  const std::filesystem::path& staging = folder.staging();
  if (!run->detections.empty()) WriteDetections(run->dataset, run->detections, staging);
  const std::string report = ReportPage(ReportDataOf(*run), ContextOf(config.file, config.used, output));
  if (RunInputsText(config) != inputs) {
    return Failure{"images or other input files were changed during the run; run it again"};
  }
  WriteFileAtomically(staging / "config.yaml", config.used);
  WriteFileAtomically(staging / "log.txt", console->log());
  WriteFileAtomically(staging / "report.html", report);
  WriteFileAtomically(staging / "inputs.json", inputs);
  WriteFileAtomically(staging / "result.json", ResultToJson(result));
  folder.Commit();
  return result;
}

std::optional<RunResult> CurrentResult(const std::filesystem::path& output, const RunConfig& config) {
  const std::filesystem::path inputs = output / "inputs.json";
  const std::filesystem::path result = output / "result.json";
  std::error_code error;
  if (!std::filesystem::exists(inputs, error) || !std::filesystem::exists(result, error)) return std::nullopt;
  try {
    if (ReadTextFile(inputs) != RunInputsText(config)) return std::nullopt;
    return ReadRunResult(result);
  } catch (const InputError&) {
    return std::nullopt;
  }
}

}  // namespace heba
