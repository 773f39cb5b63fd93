#include "tools/pipeline/rig_pipeline.h"

#include <algorithm>
#include <map>
#include <set>
#include <vector>

#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/io/rig_result_file.h"
#include "heba/rig_run.h"
#include "solvers/initial/usable_views.h"
#include "tools/doctor/rig_doctor.h"
#include "tools/files/cached_detector.h"
#include "tools/files/detection_file.h"
#include "tools/files/result_folder.h"
#include "tools/pages/rig_report.h"
#include "tools/pipeline/run_inputs.h"
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

std::vector<std::string> LeftOutNotes(const std::vector<RigImageResult>& images) {
  // The images of one camera, in the order of the captures, that were left out for the same reasons.
  struct Group {
    const RigImageResult* first = nullptr;
    const RigImageResult* last = nullptr;
    std::map<std::string, std::set<std::string>> targets_of;  // By the reason; an empty one is that of used targets.
    int num_images = 0;
  };
  std::vector<Group> groups;
  for (const RigImageResult& image : images) {
    if (image.reason.empty() || image.targets.empty()) continue;
    std::map<std::string, std::set<std::string>> targets_of;
    for (const RigTargetInImage& target : image.targets) targets_of[target.reason].insert(target.target);
    const auto known = std::find_if(groups.begin(), groups.end(), [&](const Group& group) {
      return group.first->camera == image.camera &&
             std::equal(group.targets_of.begin(), group.targets_of.end(), targets_of.begin(), targets_of.end(),
                        [](const auto& a, const auto& b) { return a.first == b.first; });
    });
    Group& group = known == groups.end() ? groups.emplace_back(Group{&image, &image, {}, 0}) : *known;
    group.last = &image;
    ++group.num_images;
    for (const auto& [reason, targets] : targets_of) group.targets_of[reason].insert(targets.begin(), targets.end());
  }
  std::vector<std::string> notes;
  for (const Group& group : groups) {
    if (group.num_images == 1) {
      notes.push_back(group.first->capture + ", camera " + group.first->camera + ": " + group.first->reason);
      continue;
    }
    std::vector<std::string> texts;
    for (const auto& [reason, targets] : group.targets_of) {
      const std::vector<std::string> names(targets.begin(), targets.end());
      if (!reason.empty())
        texts.push_back((names.size() == 1 ? "target " : "targets ") + Join(names, ", ") + ": " + reason);
    }
    notes.push_back("camera " + group.first->camera + ": " + std::to_string(group.num_images) + " images, from " +
                    group.first->capture + " to " + group.last->capture + ": " + Join(texts, "; "));
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
  for (const std::string& note : LeftOutNotes(result.images)) console->Note(data.name + ": " + note);
  if (result.verdict.grade == Grade::kBad) {
    // A motion that the adjustment has measured is not replaced by its consequences.
    Diagnosis diagnosis = diagnose();
    std::erase_if(diagnosis.symptoms,
                  [&](const Symptom& symptom) { return IsExplainedByMotion(symptom, run->calibration); });
    InsertCause(diagnosis, &result.observations);
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
