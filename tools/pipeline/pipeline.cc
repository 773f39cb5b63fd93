#include "tools/pipeline/pipeline.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>
#include <vector>

#include "heba/base/files.h"
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

// The texts of a run's folder that every run has.
struct RunTexts {
  std::string report;
  std::string result;
};

// Writes them, with the config as used, the log and the inputs, and commits the folder. Returns a Failure if files of
// the config are not those of `inputs` any more.
template <class Config>
std::optional<Failure> WriteAndCommit(const Config& config, const std::string& inputs, const Console& console,
                                      const RunTexts& texts, StagedFolder* folder) {
  if (RunInputsText(config) != inputs) {
    return Failure{"images or other input files were changed during the run; run it again"};
  }
  const std::filesystem::path& staging = folder->staging();
  WriteFileAtomically(staging / "config.yaml", config.used);
  WriteFileAtomically(staging / "log.txt", console.log());
  WriteFileAtomically(staging / "report.html", texts.report);
  WriteFileAtomically(staging / "inputs.json", inputs);
  WriteFileAtomically(staging / "result.json", texts.result);
  folder->Commit();
  return std::nullopt;
}

// Returns whether captures that show the target were left out, other than copies.
bool HasContradictions(const RunResult& result) {
  return std::any_of(result.images.begin(), result.images.end(), [](const ImageResult& image) {
    return !image.used && !image.targets.empty() && image.repeat_of.empty();
  });
}

// Inserts the doctor's first fault before the findings of a result that is not good, or that has left captures out.
void AppendDiagnosis(const PairConfig& config, int num_threads, RunResult* result) {
  result->verdict = JudgeRun(*result);
  const bool is_good = result->verdict.grade == Grade::kGood;
  if (is_good && !HasContradictions(*result)) return;
  Diagnosis diagnosis = Diagnose(config, num_threads, Verbosity::kQuiet, Examine::kInputs);
  // The doctor looks for an arm that reaches all poses in one configuration. One whose errors explain the captures is
  // the right one, in several.
  if (FindEstimatedArm(*result, 0) != nullptr) {
    std::erase_if(diagnosis.symptoms, [](const Symptom& symptom) { return symptom.code.name().starts_with("robot_"); });
  }
  // Poses that the doctor cannot explain are no cause of a fit that is only doubtful.
  const bool explains = diagnosis.NumWrong() > 0 && diagnosis.symptoms.front().code.name() != "poses_unexplained";
  if (result->verdict.grade != Grade::kBad && !explains) return;
  // The cause of captures that were left out does not make the rest doubtful.
  if (is_good && !IsOfSingleCaptures(diagnosis.symptoms.front())) return;
  InsertCause(diagnosis, &result->observations);
  if (is_good) result->observations.front().grade = Grade::kGood;
  result->verdict = JudgeRun(*result);
}

Outcome<RunResult> RunAndWrite(const PairConfig& config, const std::filesystem::path& output, int num_threads,
                                Console* console, RunObserver* listener) {
  const auto start = std::chrono::steady_clock::now();
  // The folder is created first, so that a run that cannot be written fails before the work.
  StagedFolder folder(output, "the results of a run");
  const std::string inputs = RunInputsText(config);
  PairDataset data = config.data;
  if (config.truth) data.truth = ReadTruth(*config.truth, data.setup);
  PairRunOptions options = config.options;
  options.num_threads = num_threads;
  options.detect = CachedDetection(data, config.target_used);
  SharedObserver<ConsoleObserver> observer(listener, data, console);
  const Outcome<PairRunOutput> run = Run(data, options, &observer);
  if (!run) return run.failure();
  const bool has_images = data.target_poses.empty();
  RunResult result = run->result;
  if (has_images && data.target->Symmetries().size() > 1) {
    const auto num_symmetries = static_cast<double>(data.target->Symmetries().size());
    result.observations.push_back({Grade::kGood, FindingCode("symmetric_target"), {{"symmetries", num_symmetries}}});
  }
  AppendDiagnosis(config, num_threads, &result);
  Describe(&result);
  result.timing.total_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (has_images) {
    WriteFileAtomically(folder.staging() / "detections.json", DetectionsToJson(run->dataset.captures, run->detections));
  }
  const std::string report = ReportPage(ReportDataOf(*run, result), ContextOf(config.file, config.used, output));
  if (std::optional<Failure> fault =
          WriteAndCommit(config, inputs, *console, {report, ResultToJson(result)}, &folder)) {
    return *std::move(fault);
  }
  return result;
}

}  // namespace

Outcome<RunResult> RunPipeline(const PairConfig& config, const std::filesystem::path& output, int num_threads,
                                Console* console, RunObserver* listener) {
  if (config.imported) {
    console->Note(config.data.name + ": read as a data set of " + config.imported->format);
    for (const std::string& remark : config.imported->remarks) console->Note(config.data.name + ": " + remark);
  }
  Outcome<RunResult> result = RunAndWrite(config, output, num_threads, console, listener);
  if (result || result.failure().code == kCancelled) return result;
  return Failure{
      WithDiagnosis(FailureText(result.failure()), Diagnose(config, num_threads, Verbosity::kQuiet, Examine::kInputs))};
}

Outcome<RunResult> RunPipeline(const RunConfig& config, const std::filesystem::path& output, int num_threads,
                               Console* console, RunObserver* listener) {
  // The folder is created first, so that a run that cannot be written fails before the work.
  StagedFolder folder(output, "the results of a run");
  const std::string inputs = RunInputsText(config);
  Dataset data = config.data;
  if (config.truth) data.truth = ReadCellTruth(*config.truth, data.rig);
  for (const LeftOutImages& entry : data.left_out) console->Note(data.name + ": " + entry.name + ": " + entry.reason);
  RunOptions options = config.options;
  options.num_threads = num_threads;
  for (const std::string& target : config.targets_used) options.detect.push_back(CachedDetection(target));
  SharedObserver<ProgressObserver> observer(listener, console->verbosity());
  Outcome<RunOutput> run = Run(data, options, &observer);
  const auto diagnose = [&] { return Diagnose(config, num_threads, Verbosity::kQuiet, Examine::kInputs); };
  if (!run) return Failure{WithDiagnosis(FailureText(run.failure()), diagnose())};
  for (const std::string& note : DetectionNotes(run->dataset, run->detections)) console->Note(note);
  RunResult& result = run->result;
  for (const std::string& note : LeftOutNotes(result.images)) console->Note(data.name + ": " + note);
  if (result.verdict.grade == Grade::kBad) {
    // A motion that the adjustment has measured is not replaced by its consequences.
    Diagnosis diagnosis = diagnose();
    std::erase_if(diagnosis.symptoms,
                  [&](const Symptom& symptom) { return IsExplainedByMotion(symptom, run->calibration); });
    InsertCause(diagnosis, &result.observations);
    result.verdict = JudgeRun(result);
  }
  Describe(&result);
  WriteDetections(run->dataset, run->detections, folder.staging() / "detections");
  const std::string report = ReportPage(ReportDataOf(*run), ContextOf(config.file, config.used, output));
  if (std::optional<Failure> fault =
          WriteAndCommit(config, inputs, *console, {report, ResultToJson(result)}, &folder)) {
    return *std::move(fault);
  }
  return result;
}

}  // namespace heba
