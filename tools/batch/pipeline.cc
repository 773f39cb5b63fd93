#include "tools/batch/pipeline.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <mutex>

#include <opencv2/core.hpp>

#include "heba/base/files.h"
#include "heba/base/parallel.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/evaluation/verdict.h"
#include "heba/io/result_file.h"
#include "solvers/calibration/calibration.h"
#include "targets/guided_detection.h"
#include "targets/images/image.h"
#include "tools/doctor/doctor.h"
#include "tools/files/detection_file.h"
#include "tools/files/result_folder.h"
#include "tools/pages/report.h"
#include "tools/run/assessment.h"
#include "tools/run/captures.h"
#include "tools/run/duplicate_images.h"
#include "tools/run/run_inputs.h"
#include "tools/text/result_text.h"
#include "tools/text/target_symmetry.h"

namespace heba {
namespace {

class Stopwatch {
 public:
  double Seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// Returns whether a calibration from more points is no worse: it uses at least as many views, and its residuals are at
// most 5 % larger than those of the first.
bool IsAtLeastAsGood(const Calibration& second, const Calibration& first) {
  constexpr double kMaxRise = 1.05;
  return second.views.size() >= first.views.size() &&
         second.refined->pixel_sigma_px <= kMaxRise * first.refined->pixel_sigma_px;
}

// Searches again for missing points at the positions that the calibration predicts. Returns whether anything changed.
bool RedetectMissing(const RunConfig& config, const Calibration& calibration, int num_threads, Verbosity verbosity,
                     std::vector<CaptureDetection>* detections) {
  // A target with symmetries has no ids that a second pass could complete.
  if (config.target->Symmetries().size() > 1 || !config.given_detections.empty()) return false;
  const Solution& solution = *calibration.refined;
  const std::optional<SquaredErrors> errors =
      ReprojectionErrors(solution.hand_eye, solution.camera, ApplyShape(calibration.views, solution.shape));
  if (!errors) return false;
  constexpr double kMinTolerancePx = 2;
  constexpr double kToleranceRatio = 4;  // Relative to the captures' RMS, which includes the robot noise.
  const double tolerance_px = std::max(kMinTolerancePx, kToleranceRatio * errors->RmsPx().value_or(0));
  std::vector<size_t> incomplete;
  std::vector<std::vector<std::optional<Eigen::Vector2d>>> expected(config.captures.size());
  for (size_t i = 0; i < config.captures.size(); ++i) {
    const Rigid3d mount = CameraMountFromTargetMount(config.setup, config.captures[i].base_from_gripper);
    expected[i] = ExpectedPixels(*config.target, solution, CameraFromTarget(solution.hand_eye, mount));
    const auto num_expected =
        std::count_if(expected[i].begin(), expected[i].end(), [](const auto& pixel) { return pixel.has_value(); });
    if (static_cast<size_t>(num_expected) > (*detections)[i].detection.ids.size()) incomplete.push_back(i);
  }
  if (incomplete.empty()) return false;
  Progress progress("detect again", static_cast<int>(incomplete.size()), verbosity);
  std::mutex mutex;
  bool has_changed = false;
  ParallelFor(static_cast<int>(incomplete.size()), num_threads, [&](int k) {
    const size_t i = incomplete[static_cast<size_t>(k)];
    const cv::Mat grey = ReadGreyImage(config.captures[i].image);
    cv::theRNG() = cv::RNG(static_cast<uint64_t>(i) + 1);
    GuidedDetection guided = DetectGuided(*config.target, grey, (*detections)[i].detection, expected[i], tolerance_px);
    const std::lock_guard<std::mutex> lock(mutex);
    if (guided.num_added > 0 || guided.num_dropped > 0) {
      has_changed = true;
      if (guided.num_dropped > 0) {
        guided.detection.reason += std::string(guided.detection.reason.empty() ? "" : "; ") +
                                   std::to_string(guided.num_dropped) +
                                   " points rejected that are not where the other captures predict them";
      }
      (*detections)[i].detection = std::move(guided.detection);
      (*detections)[i].num_second_pass = guided.num_added;
    }
    progress.Step();
  });
  return has_changed;
}

// Returns the captures for the report, with residuals under the refined estimate.
std::vector<ReportedCapture> CaptureViews(const RunConfig& config, const std::vector<CaptureDetection>& detections,
                                          const Calibration& calibration) {
  const Solution& solution = *calibration.refined;
  std::vector<ReportedCapture> all;
  for (size_t i = 0; i < config.captures.size(); ++i) {
    const Capture& capture = config.captures[i];
    ReportedCapture shown;
    shown.image = capture.name;
    shown.base_from_gripper = capture.base_from_gripper;
    shown.small_jpeg = detections[i].small_jpeg;
    const Rigid3d camera_from_target =
        CameraFromTarget(solution.hand_eye, CameraMountFromTargetMount(config.setup, capture.base_from_gripper));
    const auto measure = [&](const Observations& observations, Points2* pixels, Points2* residuals) {
      const std::optional<Points2> found =
          Residuals(solution.camera, camera_from_target, ApplyShape(observations, solution.shape));
      if (!found) return;
      *pixels = observations.pixels;
      *residuals = *found;
    };
    const auto view = std::find_if(calibration.views.begin(), calibration.views.end(),
                                   [&](const View& entry) { return entry.name == capture.name; });
    const bool is_used = view != calibration.views.end();
    if (is_used) measure(view->observations, &shown.pixels, &shown.residuals);
    Detection left_out;
    for (size_t k = 0; k < detections[i].detection.ids.size(); ++k) {
      const int id = detections[i].detection.ids[k];
      if (is_used && std::count(view->observations.ids.begin(), view->observations.ids.end(), id) > 0) continue;
      left_out.ids.push_back(id);
      left_out.pixels.push_back(detections[i].detection.pixels[k]);
    }
    if (!left_out.ids.empty()) {
      measure(ObservationsOf(*config.target, left_out), &shown.left_out_pixels, &shown.left_out_residuals);
    }
    all.push_back(std::move(shown));
  }
  return all;
}

ReportContext ContextOf(const RunConfig& config, const std::filesystem::path& output) {
  return {TimeNow(), std::filesystem::absolute(config.file).lexically_normal(), config.used,
          std::filesystem::absolute(output).lexically_normal()};
}

// Explains why a run failed: the first fault that the doctor finds, because it is the cause, then how the calibration
// ended. A text that both contain is given once.
std::string WithDiagnosis(const std::string& reason, const RunConfig& config, int num_threads) {
  const Diagnosis diagnosis = Diagnose(config, num_threads, Verbosity::kQuiet, Examine::kInputs);
  if (diagnosis.NumWrong() == 0) return reason;
  const Symptom& first = diagnosis.symptoms.front();
  if (reason.find(first.what) != std::string::npos) return reason + (first.cure.empty() ? "" : "; " + first.cure);
  return "heba doctor: " + FirstWrong(diagnosis) + "; the calibration itself ended with: " + reason;
}

// Inserts the doctor's first fault before the findings of a result that is bad.
void AppendDiagnosis(const RunConfig& config, int num_threads, RunResult* result) {
  result->verdict = JudgeRun(*result);
  if (result->verdict.grade != Grade::kBad) return;
  const Diagnosis diagnosis = Diagnose(config, num_threads, Verbosity::kQuiet, Examine::kInputs);
  if (diagnosis.NumWrong() == 0) return;
  const Symptom& first = diagnosis.symptoms.front();
  Finding cause{Grade::kBad, first.code, first.what, first.cure};
  cause.is_cause = true;
  // The run may have found the same fault itself.
  std::erase_if(result->observations, [&](const Finding& finding) { return finding.code == cause.code; });
  result->observations.insert(result->observations.begin(), std::move(cause));
  result->verdict = JudgeRun(*result);
}

// Calibrates from poses of the target that others estimated, with the evaluation that is possible without images.
Outcome<RunResult> RunOnPoses(const RunConfig& config, const std::filesystem::path& output, int num_threads,
                              Console* console) {
  const Stopwatch total;
  StagedFolder folder(output, "the results of a run");
  const std::string inputs = RunInputsText(config);
  std::optional<Truth> truth;
  if (config.truth) truth = ReadTruth(*config.truth, config.setup);
  Calibration calibration;
  for (size_t i = 0; i < config.captures.size(); ++i) {
    const Rigid3d mount = CameraMountFromTargetMount(config.setup, config.captures[i].base_from_gripper);
    calibration.pairs.push_back({mount, config.target_poses[i], config.captures[i].role, std::nullopt});
  }
  CalibratePoses(config.methods, config.seed, &calibration);
  if (!calibration.chain) return Failure{calibration.chain.reason()};
  // The same limits as for bundle adjustment, which rejects a result that is known to 10 cm or 6 deg only.
  constexpr double kWorthlessMm = 100;
  constexpr double kWorthlessDeg = 6;
  const std::optional<BoardScatter> scatter = ComputeBoardScatter(calibration.pairs, calibration.chain->hand_eye);
  if (scatter && (scatter->translation_rms_mm > kWorthlessMm || scatter->rotation_rms_deg > kWorthlessDeg)) {
    return Failure{"the target scatters by " + Significant(scatter->translation_rms_mm, 2) + " mm and " +
                   Significant(scatter->rotation_rms_deg, 2) + " deg, but should be stationary"};
  }
  console->Note(config.name + ": " + calibration.refined.reason());
  RunResult result;
  result.name = config.name;
  result.about = config.about;
  result.setup = config.setup;
  result.target_type = config.target ? config.target->type() : "";
  result.num_target_points = config.target ? static_cast<int>(config.target->points().size()) : 0;
  result.estimates = MakeEstimates(calibration, {}, truth, {Rigid3d()});
  for (const Capture& capture : config.captures) {
    CaptureResult described;
    described.image = capture.name;
    described.role = capture.role;
    described.used = true;
    result.captures.push_back(std::move(described));
  }
  AppendDiagnosis(config, num_threads, &result);
  result.timing.total_s = total.Seconds();
  WriteFileAtomically(folder.staging() / "config.yaml", config.used);
  WriteFileAtomically(folder.staging() / "log.txt", console->log());
  WriteFileAtomically(folder.staging() / "report.html",
                      ReportPage(result, {}, Points3(3, 0), ContextOf(config, output)));
  WriteFileAtomically(folder.staging() / "inputs.json", inputs);
  WriteFileAtomically(folder.staging() / "result.json", ResultToJson(result));
  folder.Commit();
  return result;
}

Outcome<RunResult> Run(const RunConfig& config_in, const std::filesystem::path& output, int num_threads,
                       Console* console) {
  const Stopwatch total;
  RunConfig config = config_in;
  // The folder is created first, so that a run that cannot be written fails before the work.
  StagedFolder folder(output, "the results of a run");
  const std::string inputs = RunInputsText(config);
  std::optional<Truth> truth;
  if (config.truth) truth = ReadTruth(*config.truth, config.setup);

  const Stopwatch detect_watch;
  CheckCameraByHeader(config);
  std::vector<CaptureDetection> detections = DetectCaptures(config, num_threads, console->verbosity());
  FitCameraToImages(detections.front(), &config);
  RunResult result;
  result.timing.detect_s = detect_watch.Seconds();
  const LeftOutCaptures left_out = LeaveOutSharedImages(&config, &detections);
  for (const std::string& note : left_out.notes) console->Note(config.name + ": " + note);
  if (detections.empty()) return Failure{Join(left_out.notes, "; ")};
  const std::vector<View> views = ViewsOf(config, detections);
  if (views.empty()) {
    const std::string first = detections.front().detection.reason;
    return Failure{"the target was not detected in any of the " + std::to_string(detections.size()) + " images" +
                   (first.empty() ? "" : " (" + config.captures[0].name + ": " + first + ")") +
                   "; is it the target that the config names?"};
  }
  console->Note(config.name + ": the target was detected in " + std::to_string(views.size()) + " of " +
                std::to_string(detections.size()) + " images");
  for (const LeftOut& entry : config.left_out)
    console->Note(config.name + ": without " + entry.name + ": " + entry.reason);
  if (config.target->Symmetries().size() > 1) console->Note(config.name + ": " + SymmetryRemark(*config.target));

  const Stopwatch solve_watch;
  CalibrationOptions options = OptionsOf(config, detections.front().width_px, detections.front().height_px);
  options.bundle.num_threads = num_threads;
  Outcome<Calibration> calibration = Calibrate(views, options);
  if (!calibration) return Failure{calibration.reason()};
  if (calibration->refined) {
    std::vector<CaptureDetection> again = detections;
    if (RedetectMissing(config, *calibration, num_threads, console->verbosity(), &again)) {
      Outcome<Calibration> second = Calibrate(ViewsOf(config, again), options);
      if (second && second->refined && IsAtLeastAsGood(*second, *calibration)) {
        calibration = std::move(second);
        detections = std::move(again);
      }
    }
  }
  for (const UnusedView& unused : calibration->unused) console->Note("not used: " + unused.name + ": " + unused.reason);
  if (!calibration->refined) {
    // Notes on each method help to understand the failure.
    std::vector<MethodReason> outcomes;
    for (const MethodResult& method : calibration->methods) {
      outcomes.emplace_back(method.method, method.hand_eye
                                               ? Significant(method.reprojection_rms_px.value_or(NAN), 3) + " px"
                                               : method.hand_eye.reason());
    }
    for (const auto& [reason, methods] : GroupedByReason(outcomes)) console->Note(methods + ": " + reason);
    return Failure{calibration->refined.reason()};
  }
  result.timing.refine_s = calibration->refined->convergence.seconds;
  result.timing.seed_s = solve_watch.Seconds() - result.timing.refine_s;
  console->Note("seed: " + calibration->seed);
  const Timing timing = result.timing;
  result = Assess(config, detections, *calibration, options, truth, num_threads, console);
  result.timing = timing;
  InsertLeftOut(left_out, &result.captures);
  if (config.target->Symmetries().size() > 1) {
    result.observations.push_back({Grade::kGood, "symmetric_target", SymmetryRemark(*config.target), ""});
  }
  AppendDiagnosis(config_in, num_threads, &result);
  result.timing.total_s = total.Seconds();
  WriteFileAtomically(folder.staging() / "config.yaml", config.used);
  WriteFileAtomically(folder.staging() / "detections.json", DetectionsToJson(config.captures, detections));
  WriteFileAtomically(folder.staging() / "log.txt", console->log());
  WriteFileAtomically(folder.staging() / "report.html",
                      ReportPage(result, CaptureViews(config, detections, *calibration),
                                 AllPoints(*config.target).points_in_target, ContextOf(config, output)));
  if (RunInputsText(config_in) != inputs) {
    return Failure{"images or other input files were changed during the run; run it again"};
  }
  WriteFileAtomically(folder.staging() / "inputs.json", inputs);
  WriteFileAtomically(folder.staging() / "result.json", ResultToJson(result));
  folder.Commit();
  return result;
}

}  // namespace

Outcome<RunResult> RunPipeline(const RunConfig& config, const std::filesystem::path& output, int num_threads,
                               Console* console) {
  if (config.imported) {
    console->Note(config.name + ": read as a data set of " + config.imported->format);
    for (const std::string& remark : config.imported->remarks) console->Note(config.name + ": " + remark);
  }
  Outcome<RunResult> result = config.target_poses.empty() ? Run(config, output, num_threads, console)
                                                          : RunOnPoses(config, output, num_threads, console);
  if (result) return result;
  return Failure{WithDiagnosis(result.reason(), config, num_threads)};
}

}  // namespace heba
