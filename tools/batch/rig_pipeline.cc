#include "tools/batch/rig_pipeline.h"

#include <algorithm>
#include <vector>

#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/io/rig_result_file.h"
#include "heba/rig_run.h"
#include "solvers/initial/usable_views.h"
#include "tools/batch/run_inputs.h"
#include "tools/doctor/rig_doctor.h"
#include "tools/files/cached_detector.h"
#include "tools/files/detection_file.h"
#include "tools/files/result_folder.h"
#include "tools/pages/rig_report.h"
#include "tools/text/finding_text.h"
#include "tools/text/run_console.h"

namespace heba {

std::vector<std::string> DetectionNotes(const RigDataset& data, const std::vector<RigDetection>& detections) {
  std::vector<std::string> notes;
  for (size_t c = 0; c < data.rig.cameras.size(); ++c) {
    for (size_t t = 0; t < data.targets.size(); ++t) {
      int num_seen = 0;
      int num_images = 0;
      for (const RigDetection& detection : detections) {
        if (detection.camera != c || detection.target != t) continue;
        ++num_images;
        num_seen += static_cast<int>(detection.detection.detection.ids.size()) >= kMinPosePoints ? 1 : 0;
      }
      notes.push_back(data.name + ": camera " + data.rig.cameras[c].name + " sees target " + data.rig.targets[t].name +
                      " in " + std::to_string(num_seen) + " of " + std::to_string(num_images) + " images");
    }
  }
  return notes;
}

Outcome<RigResult> RunRigPipeline(const RigConfig& config, const std::filesystem::path& output, int num_threads,
                                  Console* console, RunObserver* listener) {
  // The folder is created first, so that a run that cannot be written fails before the work.
  StagedFolder folder(output, "the results of a run");
  const std::string inputs = RunInputsText(config);
  RigDataset data = config.data;
  if (config.truth) data.truth = ReadRigTruth(*config.truth, data.rig);
  for (const RigLeftOut& entry : data.left_out) console->Note(data.name + ": " + entry.name + ": " + entry.reason);
  RigRunOptions options = config.options;
  options.num_threads = num_threads;
  for (const std::string& target : config.targets_used) options.detect.push_back(CachedDetection(target));
  SharedObserver<ProgressObserver> observer(listener, console->verbosity());
  Outcome<RigRunOutput> run = RunRig(data, options, &observer);
  const auto diagnose = [&] { return Diagnose(config, num_threads, Verbosity::kQuiet, Examine::kInputs); };
  if (!run) return Failure{WithDiagnosis(run.reason(), diagnose())};
  for (const std::string& note : DetectionNotes(data, run->detections)) console->Note(note);
  RigResult& result = run->result;
  for (const RigImageResult& image : result.images) {
    if (!image.reason.empty() && !image.targets.empty()) {
      console->Note(data.name + ": " + image.capture + ", camera " + image.camera + ": " + image.reason);
    }
  }
  if (result.verdict.grade == Grade::kBad) {
    const Diagnosis diagnosis = diagnose();
    // A motion that the adjustment has measured is not replaced by what the pixels show of it.
    const bool is_known = diagnosis.NumWrong() > 0 && diagnosis.symptoms.front().code.name() == "camera_moved" &&
                          std::any_of(result.observations.begin(), result.observations.end(),
                                      [](const Finding& finding) { return finding.code == "camera_moved"; });
    if (!is_known) InsertCause(diagnosis, &result.observations);
    result.verdict = JudgeRig(result);
  }
  DescribeAll(&result.verdict.findings);
  WriteFileAtomically(folder.staging() / "config.yaml", config.used);
  WriteRigDetections(data, run->detections, folder.staging() / "detections");
  WriteFileAtomically(folder.staging() / "log.txt", console->log());
  WriteFileAtomically(folder.staging() / "report.html",
                      RigReportPage(data, *run,
                                    {TimeNow(), std::filesystem::absolute(config.file).lexically_normal(), config.used,
                                     std::filesystem::absolute(output).lexically_normal()}));
  if (RunInputsText(config) != inputs) {
    return Failure{"images or other input files were changed during the run; run it again"};
  }
  WriteFileAtomically(folder.staging() / "inputs.json", inputs);
  WriteFileAtomically(folder.staging() / "result.json", RigResultToJson(result));
  folder.Commit();
  return result;
}

std::optional<RigResult> CurrentRigResult(const std::filesystem::path& output, const RigConfig& config) {
  const std::filesystem::path inputs = output / "inputs.json";
  std::error_code error;
  if (!std::filesystem::exists(inputs, error) || !std::filesystem::exists(output / "result.json", error)) return {};
  try {
    if (ReadTextFile(inputs) != RunInputsText(config)) return std::nullopt;
    return ReadRigResult(output / "result.json");
  } catch (const InputError&) {
    return std::nullopt;
  }
}

}  // namespace heba
