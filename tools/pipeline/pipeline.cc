#include "tools/pipeline/pipeline.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>
#include <vector>

#include "heba/base/files.h"
#include "heba/evaluation/metrics.h"
#include "heba/evaluation/verdict.h"
#include "heba/io/result_file.h"
#include "heba/run.h"
#include "tools/doctor/doctor.h"
#include "tools/files/cached_detector.h"
#include "tools/files/detection_file.h"
#include "tools/files/result_folder.h"
#include "tools/pages/report.h"
#include "tools/pipeline/run_inputs.h"
#include "tools/run/captures.h"
#include "tools/text/finding_text.h"
#include "tools/text/run_console.h"

namespace heba {
namespace {

// Returns the captures for the report, with residuals under the refined estimate.
std::vector<ReportedCapture> ReportedCaptures(const RunOutput& run) {
  const Dataset& data = run.dataset;
  const std::vector<CaptureDetection>& detections = run.detections;
  const Calibration& calibration = run.calibration;
  const Solution& solution = *calibration.refined;
  std::vector<const View*> view_of(data.captures.size(), nullptr);
  for (const View& view : calibration.views) view_of[view.capture] = &view;
  std::vector<ReportedCapture> all;
  for (size_t i = 0; i < data.captures.size(); ++i) {
    const Capture& capture = data.captures[i];
    ReportedCapture shown;
    shown.image = capture.name;
    shown.base_from_gripper = capture.base_from_gripper;
    shown.small_jpeg = detections[i].small_jpeg;
    const Rigid3d camera_from_target = PredictedPose(data, solution, i);
    const auto measure = [&](const Observations& observations, Points2* pixels, Points2* residuals) {
      const std::optional<Points2> found =
          Residuals(solution.camera, camera_from_target, ApplyShape(observations, solution.shape));
      if (!found) return;
      *pixels = observations.pixels;
      *residuals = *found;
    };
    const View* const view = view_of[i];
    const bool is_used = view != nullptr;
    if (is_used) measure(view->observations, &shown.pixels, &shown.residuals);
    Detection left_out;
    for (size_t k = 0; k < detections[i].detection.ids.size(); ++k) {
      const int id = detections[i].detection.ids[k];
      if (is_used && std::count(view->observations.ids.begin(), view->observations.ids.end(), id) > 0) continue;
      left_out.ids.push_back(id);
      left_out.pixels.push_back(detections[i].detection.pixels[k]);
    }
    if (!left_out.ids.empty()) {
      measure(ObservationsOf(*data.target, left_out), &shown.left_out_pixels, &shown.left_out_residuals);
    }
    all.push_back(std::move(shown));
  }
  return all;
}

ReportContext ContextOf(const RunConfig& config, const std::filesystem::path& output) {
  return {TimeNow(), std::filesystem::absolute(config.file).lexically_normal(), config.used,
          std::filesystem::absolute(output).lexically_normal()};
}

// Inserts the doctor's first fault before the findings of a result that is not good.
void AppendDiagnosis(const RunConfig& config, int num_threads, RunResult* result) {
  result->verdict = JudgeRun(*result);
  if (result->verdict.grade == Grade::kGood) return;
  const Diagnosis diagnosis = Diagnose(config, num_threads, Verbosity::kQuiet, Examine::kInputs);
  // Poses that the doctor cannot explain are no cause of a fit that is only doubtful.
  const bool explains = diagnosis.NumWrong() > 0 && diagnosis.symptoms.front().code.name() != "poses_unexplained";
  if (result->verdict.grade != Grade::kBad && !explains) return;
  InsertCause(diagnosis, &result->observations);
  result->verdict = JudgeRun(*result);
}

Outcome<RunResult> RunAndWrite(const RunConfig& config, const std::filesystem::path& output, int num_threads,
                               Console* console, RunObserver* listener) {
  const auto start = std::chrono::steady_clock::now();
  // The folder is created first, so that a run that cannot be written fails before the work.
  StagedFolder folder(output, "the results of a run");
  const std::string inputs = RunInputsText(config);
  Dataset data = config.data;
  if (config.truth) data.truth = ReadTruth(*config.truth, data.setup);
  RunOptions options = config.options;
  options.num_threads = num_threads;
  options.detect = CachedDetection(data, config.target_used);
  SharedObserver<ConsoleObserver> observer(listener, data, console);
  const Outcome<RunOutput> run = Run(data, options, &observer);
  if (!run) return Failure{run.reason()};
  const bool has_images = data.target_poses.empty();
  RunResult result = run->result;
  if (has_images && data.target->Symmetries().size() > 1) {
    const auto num_symmetries = static_cast<double>(data.target->Symmetries().size());
    result.observations.push_back({Grade::kGood, FindingCode("symmetric_target"), {{"symmetries", num_symmetries}}});
  }
  AppendDiagnosis(config, num_threads, &result);
  DescribeAll(&result.verdict.findings);
  result.timing.total_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  WriteFileAtomically(folder.staging() / "config.yaml", config.used);
  if (has_images) {
    WriteFileAtomically(folder.staging() / "detections.json", DetectionsToJson(run->dataset.captures, run->detections));
  }
  WriteFileAtomically(folder.staging() / "log.txt", console->log());
  WriteFileAtomically(
      folder.staging() / "report.html",
      ReportPage(result, has_images ? ReportedCaptures(*run) : std::vector<ReportedCapture>(),
                 has_images ? AllPoints(*data.target).points_in_target : Points3(3, 0), ContextOf(config, output)));
  if (RunInputsText(config) != inputs) {
    return Failure{"images or other input files were changed during the run; run it again"};
  }
  WriteFileAtomically(folder.staging() / "inputs.json", inputs);
  WriteFileAtomically(folder.staging() / "result.json", ResultToJson(result));
  folder.Commit();
  return result;
}

}  // namespace

Outcome<RunResult> RunPipeline(const RunConfig& config, const std::filesystem::path& output, int num_threads,
                               Console* console, RunObserver* listener) {
  if (config.imported) {
    console->Note(config.data.name + ": read as a data set of " + config.imported->format);
    for (const std::string& remark : config.imported->remarks) console->Note(config.data.name + ": " + remark);
  }
  Outcome<RunResult> result = RunAndWrite(config, output, num_threads, console, listener);
  if (result || result.reason() == kCancelled) return result;
  return Failure{WithDiagnosis(result.reason(), Diagnose(config, num_threads, Verbosity::kQuiet, Examine::kInputs))};
}

}  // namespace heba
