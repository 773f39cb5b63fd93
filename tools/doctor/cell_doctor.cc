#include "tools/doctor/cell_doctor.h"

#include <algorithm>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "heba/base/text.h"
#include "heba/image_detection.h"
#include "tools/doctor/cell_symptoms.h"
#include "tools/doctor/checks.h"
#include "tools/doctor/examination.h"
#include "tools/doctor/mounts.h"
#include "tools/doctor/pairs.h"
#include "tools/files/cached_detector.h"
#include "tools/run/arm_setup.h"
#include "tools/text/failure_text.h"
#include "tools/text/finding_text.h"
#include "tools/text/run_console.h"

namespace heba {

namespace {

// Examines whether joints and poses are those of the arms that the config names. Recorded joints need no images.
// Otherwise arms and tools are compared by the images of one pair of each arm, the one that is seen most.
std::vector<Symptom> SymptomsOfArms(const RunConfig& config, const std::vector<DiagnosedPair>& pairs, int num_threads) {
  std::vector<Symptom> symptoms;
  for (size_t r = 0; r < config.data.rig.robots.size(); ++r) {
    if (!config.data.arms[r]) continue;
    const bool is_recorded = AreJointsRecorded(config.data, r);
    std::optional<DoctorPair> best;
    for (const DiagnosedPair& diagnosed : pairs) {
      const DoctorPair& pair = diagnosed.pair;
      if (pair.robot == r && (!best || pair.num_seen > best->num_seen)) best = pair;
    }
    if (!best) continue;
    best->captures.clear();
    for (size_t i = 0; i < config.data.captures.size(); ++i) {
      if (is_recorded || !config.data.captures[i].images[best->camera].empty()) best->captures.push_back(i);
    }
    Examination examination;
    examination.config = ConfigWithArm(config, *best);
    if (config.data.has_camera[best->camera]) examination.camera = config.data.rig.cameras[best->camera].camera;
    examination.num_threads = num_threads;
    if (!is_recorded) examination.detections = Detections(examination.config, num_threads, Verbosity::kQuiet);
    for (Symptom& symptom : Check_robot(examination).symptoms) {
      symptoms.push_back(InLongForm(config, *best, std::move(symptom)));
      if (config.data.rig.robots.size() == 1) continue;
      symptoms.back().what = "arm " + config.data.rig.robots[r] + ": " + symptoms.back().what;
    }
  }
  return symptoms;
}

// Reports targets that no camera sees, with the target that the images show instead, if there is one.
std::vector<Symptom> UnseenTargets(const RunConfig& config, const std::vector<TargetDetection>& detections,
                                   int num_threads) {
  const Dataset& data = config.data;
  std::vector<Symptom> symptoms;
  for (size_t t = 0; t < data.rig.targets.size(); ++t) {
    const bool is_seen = std::any_of(detections.begin(), detections.end(), [&](const TargetDetection& detection) {
      return detection.target == t && IsSeen(detection);
    });
    if (is_seen) continue;
    Symptom unseen{Severity::kWrong, "target_not_seen",
                   "target " + data.rig.targets[t].name + " is detected in no image of any camera",
                   "check its section in the config (targets." + data.rig.targets[t].name + "), or leave it out"};
    for (size_t c = 0; c < data.rig.cameras.size() && unseen.settings.empty(); ++c) {
      DoctorPair pair{c, t, 0, {}, 0};
      for (size_t i = 0; i < data.captures.size(); ++i) {
        if (!data.captures[i].images[c].empty()) pair.captures.push_back(i);
      }
      if (pair.captures.empty()) continue;
      const Diagnosis diagnosis = DiagnosePair(config, pair, num_threads, Verbosity::kQuiet);
      for (const Symptom& symptom : diagnosis.symptoms) {
        if (symptom.code.name() != "target") continue;
        unseen = InLongForm(config, pair, symptom);
        unseen.what = WhereText(config, {pair}) + ": " + unseen.what;
        break;
      }
    }
    symptoms.push_back(std::move(unseen));
  }
  return symptoms;
}

// Reports the images and poses that the config read but cannot use.
std::vector<Symptom> Unpaired(const std::vector<LeftOutImages>& left_out) {
  constexpr size_t kMostNamed = 4;
  if (left_out.empty()) return {};
  std::vector<std::string> texts;
  for (size_t i = 0; i < std::min(left_out.size(), kMostNamed); ++i) {
    texts.push_back(left_out[i].name + " (" + left_out[i].reason + ")");
  }
  if (left_out.size() > kMostNamed) texts.emplace_back("...");
  return {{Severity::kRemark, "unpaired",
           std::to_string(left_out.size()) + " images or poses are not used: " + Join(texts, ", "),
           "complete the poses file if these captures are wanted; list them in captures.exclude if not"}};
}

// Returns whether a motion of the cameras that have a symptom might explain it.
bool MayBeMotion(const Symptom& symptom) {
  return !symptom.cameras.empty() && (symptom.code.name() == "poses_unexplained" ||
                                      symptom.code.name() == "poses_jump" || IsOfSingleCaptures(symptom));
}

// Returns the diagnosis with what the adjustment of the whole rig finds. If something is wrong with the inputs, only
// cameras that were moved are added, and the symptoms that they explain are removed.
Diagnosis WithResult(Diagnosis diagnosis, const RunConfig& config, const std::vector<DetectFunction>& detect,
                     int num_threads) {
  RunOptions options = config.options;
  options.num_threads = num_threads;
  options.detect = detect;
  const Outcome<RunOutput> run = Run(config.data, options);
  if (!run) {
    if (diagnosis.NumWrong() > 0) return diagnosis;
    diagnosis.symptoms.push_back({Severity::kWrong, "no_result", FailureText(run.failure()), ""});
    return diagnosis;
  }
  std::erase_if(diagnosis.symptoms,
                [&](const Symptom& symptom) { return IsExplainedByMotion(symptom, run->calibration); });
  const bool is_wrong = diagnosis.NumWrong() > 0;
  for (const Finding& finding : run->result.verdict.findings) {
    if (finding.grade == Grade::kGood || (is_wrong && finding.code != "camera_moved")) continue;
    diagnosis.symptoms.push_back(SymptomOf(finding));
  }
  return diagnosis;
}

}  // namespace

bool IsExplainedByMotion(const Symptom& symptom, const Calibration& calibration) {
  if (calibration.moved.empty()) return false;
  if (symptom.code.name() == "camera_moved") return true;
  if (!MayBeMotion(symptom)) return false;
  return std::all_of(symptom.cameras.begin(), symptom.cameras.end(), [&](const std::string& camera) {
    std::set<std::string> left_out;
    for (const MovedCamera& moved : calibration.moved) {
      if (calibration.problem.cameras[moved.camera].name != camera) continue;
      for (const size_t i : moved.left_out) left_out.insert(calibration.problem.captures[i].name);
    }
    const bool is_of_all = !IsOfSingleCaptures(symptom);
    return !left_out.empty() &&
           (is_of_all || (!symptom.captures.empty() &&
                          std::all_of(symptom.captures.begin(), symptom.captures.end(),
                                      [&](const std::string& capture) { return left_out.contains(capture); })));
  });
}

Diagnosis Diagnose(const RunConfig& config, int num_threads, Verbosity verbosity, Examine examine) {
  if (IsShort(config.data.rig)) return DiagnosePair(config, num_threads, verbosity, examine);
  const std::vector<DetectFunction> detect = CachedDetections(config.data, config.targets_used);
  ProgressObserver observer(verbosity);
  const std::vector<TargetDetection> detections = DetectDataset(config.data, detect, num_threads, &observer);
  Diagnosis diagnosis;
  diagnosis.num_captures = static_cast<int>(config.data.captures.size());
  std::set<std::pair<size_t, size_t>> images;
  std::set<std::pair<size_t, size_t>> seen;
  for (const TargetDetection& detection : detections) {
    images.insert({detection.capture, detection.camera});
    if (IsSeen(detection)) seen.insert({detection.capture, detection.camera});
  }
  diagnosis.num_images = static_cast<int>(images.size());
  diagnosis.num_seen = static_cast<int>(seen.size());
  diagnosis.symptoms = UnseenTargets(config, detections, num_threads);
  std::vector<DiagnosedPair> pairs = DiagnosePairs(config, PairsOf(config, detections), num_threads, verbosity);
  const auto add = [&](const std::vector<Symptom>& symptoms) {
    diagnosis.symptoms.insert(diagnosis.symptoms.end(), symptoms.begin(), symptoms.end());
  };
  const MountSymptoms of_arms = SymptomsOfOtherArms(config, pairs);
  add(of_arms.symptoms);
  const MountSymptoms of_mounts = WrongMounts(config, detections, of_arms.misplaced);
  add(of_mounts.symptoms);
  std::erase_if(pairs, [&](const DiagnosedPair& entry) {
    const auto [camera, target] = std::pair(entry.pair.camera, entry.pair.target);
    return of_arms.misplaced.Contains(camera, target) || of_mounts.misplaced.Contains(camera, target);
  });
  add(SymptomsOfPairs(config, pairs));
  // Poses that are read wrongly are those of no arm.
  if (diagnosis.NumWrong() == 0) add(SymptomsOfArms(config, pairs, num_threads));
  add(Unpaired(config.data.left_out));
  const bool may_be_motion =
      std::all_of(diagnosis.symptoms.begin(), diagnosis.symptoms.end(),
                  [](const Symptom& symptom) { return symptom.severity != Severity::kWrong || MayBeMotion(symptom); });
  if (may_be_motion && examine == Examine::kInputsAndResult) {
    diagnosis = WithResult(std::move(diagnosis), config, detect, num_threads);
  }
  diagnosis.symptoms = BySeverity(std::move(diagnosis.symptoms));
  return diagnosis;
}

}  // namespace heba
