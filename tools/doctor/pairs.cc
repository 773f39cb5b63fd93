#include "tools/doctor/pairs.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "heba/base/text.h"
#include "solvers/initial/usable_views.h"
#include "tools/text/arm_keys.h"

namespace heba {
namespace {

// Faults of a camera alone that the other cameras of a rig may make up for.
constexpr std::string_view kOthersMayHelp[] = {"few_captures", "motion", "little_rotation", "target_often_missed"};
// Faults because of which the images of a pair do not tell whether they fit.
constexpr std::string_view kDoNotTell[] = {"motion", "few_captures"};

// Returns the arm that moves the camera against the target; nothing if none or several do.
std::optional<size_t> ArmOf(const Problem& rig, size_t camera, size_t target) {
  std::optional<size_t> arm;
  for (size_t r = 0; r < rig.robots.size(); ++r) {
    if (!IsMovedBy(rig.cameras[camera].mount, rig.targets[target].mount, r)) continue;
    if (arm) return std::nullopt;
    arm = r;
  }
  return arm;
}

// Returns whether the images of a pair tell anything about it. One or two images of a target that no image misses do
// not; other targets may join the camera to the rig.
bool IsToBeDiagnosed(const DoctorPair& pair) {
  constexpr int kFewest = 3;
  const bool is_missed = static_cast<int>(pair.captures.size()) > pair.num_seen;
  return pair.num_seen > 0 && (pair.num_seen >= kFewest || is_missed);
}

// Returns, for each target, whether some images of the cell show the whole of it.
std::vector<bool> AreKnown(const Dataset& data, const std::vector<TargetDetection>& detections) {
  constexpr double kWhole = 0.9;
  constexpr int kSome = 3;
  std::vector<int> num_whole(data.targets.size(), 0);
  for (const TargetDetection& detection : detections) {
    const auto num_points = static_cast<double>(detection.detection.detection.ids.size());
    const auto num_all = static_cast<double>(data.targets[detection.target]->points().size());
    if (IsSeen(detection) && num_points >= kWhole * num_all) ++num_whole[detection.target];
  }
  std::vector<bool> are_known;
  for (const int num : num_whole) are_known.push_back(num >= kSome);
  return are_known;
}

// Returns the given detections of a pair in its captures.
std::vector<TargetDetection> GivenDetectionsOf(const Dataset& data, const DoctorPair& pair) {
  std::vector<TargetDetection> given;
  for (size_t k = 0; k < pair.captures.size(); ++k) {
    for (const TargetDetection& detection : data.given_detections) {
      if (detection.capture == pair.captures[k] && detection.camera == pair.camera && detection.target == pair.target) {
        given.push_back({k, 0, 0, detection.detection});
      }
    }
  }
  return given;
}

// Returns the config of a pair in the short form, without the kinematics of the arm.
RunConfig ConfigOf(const RunConfig& config, const DoctorPair& pair) {
  const Dataset& data = config.data;
  const ProblemCamera& camera = data.rig.cameras[pair.camera];
  const bool is_carried = camera.mount == Mount{pair.robot, Mount::Part::kGripper};
  RunConfig of_pair;
  of_pair.file = config.file;
  of_pair.data = DatasetOf(is_carried ? Setup::kEyeInHand : Setup::kEyeToHand, data.targets[pair.target]);
  Dataset& of_data = of_pair.data;
  of_data.name = data.name;
  ProblemCamera& only = of_data.rig.cameras.front();
  only.camera = camera.camera;
  only.free_intrinsics = camera.free_intrinsics;
  only.prior = camera.prior;
  of_data.has_camera = {data.has_camera[pair.camera]};
  of_data.camera_sources = {data.camera_sources[pair.camera]};
  of_data.arms = {std::nullopt};
  of_data.given_detections = GivenDetectionsOf(data, pair);
  of_data.detections_source = data.detections_source;
  of_data.stream = data.stream;
  of_pair.options.estimates_time_offset = config.options.estimates_time_offset;
  of_pair.targets_used = {config.targets_used[pair.target]};
  of_pair.has_target_keys = {config.has_target_keys[pair.target]};
  const PosesFileOfArm& arm = config.arms[pair.robot];
  of_pair.arms = {{"captures", arm.file, arm.reading, {}, arm.joints_are_deg}};
  of_pair.num_images = pair.captures.size();
  for (const size_t i : pair.captures) {
    const Recording& capture = data.captures[i];
    of_data.captures.push_back({capture.name, {capture.base_from_gripper[pair.robot]}, {capture.images[pair.camera]}});
    of_data.captures.back().time_s = capture.time_s;
    of_pair.arms.front().numbers.push_back(arm.numbers[i]);
  }
  return of_pair;
}

// Returns the names that the keys of a config of one camera have in that of a rig.
std::vector<std::pair<std::string, std::string>> LongFormKeys(const RunConfig& config, const DoctorPair& pair) {
  const std::string camera = "cameras." + config.data.rig.cameras[pair.camera].name;
  const std::string& arm = config.arms[pair.robot].section;
  std::vector<std::pair<std::string, std::string>> keys = {
      {"camera.model", camera + ".model"},
      {"camera.intrinsics", camera + ".intrinsics"},
  };
  for (const char* key : {"pose_format", "poses_are", "robot", "joint_angles"}) {
    keys.emplace_back("captures." + std::string(key), arm + "." + key);
  }
  for (std::pair<std::string, std::string>& key : ArmKeys(arm)) keys.push_back(std::move(key));
  return keys;
}

std::string Replaced(std::string text, const std::vector<std::pair<std::string, std::string>>& words) {
  for (const auto& [word, replacement] : words) {
    for (size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + replacement.size())) {
      text.replace(at, word.size(), replacement);
    }
  }
  return text;
}

CellContext ContextOf(const RunConfig& config, const DoctorPair& pair) {
  const Dataset& data = config.data;
  CellContext context;
  context.is_target_known = pair.is_target_known;
  for (size_t t = 0; t < data.targets.size(); ++t) {
    if (t == pair.target) continue;
    for (std::string& code : data.targets[t]->Codes()) context.other_codes.push_back(std::move(code));
  }
  context.place = pair.captures;
  for (size_t r = 0; r < data.rig.robots.size(); ++r) {
    std::vector<Rigid3d> poses;
    for (const Recording& capture : data.captures) poses.push_back(capture.base_from_gripper[r]);
    if (r == pair.robot) {
      context.base_from_gripper = std::move(poses);
    } else {
      context.other_arms.push_back({data.rig.robots[r], std::move(poses)});
    }
  }
  for (const Recording& capture : data.captures) context.captures.push_back(capture.name);
  return context;
}

}  // namespace

bool IsSeen(const TargetDetection& detection) {
  return static_cast<int>(detection.detection.detection.ids.size()) >= kMinPosePoints;
}

std::vector<DoctorPair> PairsOf(const RunConfig& config, const std::vector<TargetDetection>& detections) {
  const Problem& rig = config.data.rig;
  const std::vector<bool> are_known = AreKnown(config.data, detections);
  std::vector<DoctorPair> pairs;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    std::vector<int> num_targets(config.data.captures.size(), 0);
    for (const TargetDetection& detection : detections) {
      if (detection.camera == c && IsSeen(detection)) ++num_targets[detection.capture];
    }
    std::vector<DoctorPair> of_camera;
    for (size_t t = 0; t < rig.targets.size(); ++t) {
      const std::optional<size_t> arm = ArmOf(rig, c, t);
      if (!arm) continue;
      DoctorPair pair{c, t, *arm, {}, 0, are_known[t]};
      for (const TargetDetection& detection : detections) {
        if (detection.camera != c || detection.target != t) continue;
        if (IsSeen(detection)) ++pair.num_seen;
        if (IsSeen(detection) || num_targets[detection.capture] == 0) pair.captures.push_back(detection.capture);
      }
      if (IsToBeDiagnosed(pair)) of_camera.push_back(std::move(pair));
    }
    std::stable_sort(of_camera.begin(), of_camera.end(),
                     [](const DoctorPair& a, const DoctorPair& b) { return a.num_seen > b.num_seen; });
    for (DoctorPair& pair : of_camera) {
      const bool is_best = pairs.empty() || pairs.back().camera != c;
      if (is_best || pair.num_seen >= kEnoughImages) pairs.push_back(std::move(pair));
    }
  }
  return pairs;
}

RunConfig ConfigWithArm(const RunConfig& config, const DoctorPair& pair) {
  RunConfig of_pair = ConfigOf(config, pair);
  of_pair.data.arms = {config.data.arms[pair.robot]};
  of_pair.options.kinematics = config.options.kinematics;
  for (size_t k = 0; k < pair.captures.size(); ++k) {
    of_pair.data.captures[k].joints = {config.data.captures[pair.captures[k]].joints[pair.robot]};
  }
  return of_pair;
}

Symptom InLongForm(const RunConfig& config, const DoctorPair& pair, Symptom symptom) {
  const std::vector<std::pair<std::string, std::string>> keys = LongFormKeys(config, pair);
  symptom.what = Replaced(std::move(symptom.what), keys);
  symptom.cure = Replaced(std::move(symptom.cure), keys);
  for (ConfigSetting& setting : symptom.settings) {
    if (setting.key == "target" || setting.key.starts_with("target.")) {
      setting.key = "targets." + config.data.rig.targets[pair.target].name + "." + setting.key;
    } else {
      setting.key = Replaced(std::move(setting.key), keys);
    }
  }
  if (IsIn(kOthersMayHelp, symptom.code)) symptom.severity = Severity::kRemark;
  return symptom;
}

bool FitsPoses(const DiagnosedPair& diagnosed) {
  const std::optional<PoseFit>& fit = diagnosed.diagnosis.pose_fit;
  return diagnosed.pair.num_seen >= kEnoughImages && fit && fit->fits && !HasWrong(diagnosed, kOfPoses) &&
         !HasWrong(diagnosed, kDoNotTell);
}

std::string NamesText(const char* one, const char* several, const std::set<std::string>& names) {
  const std::vector<std::string> list(names.begin(), names.end());
  return (list.size() == 1 ? one : several) + std::string(" ") + Join(list, ", ");
}

std::string WhereText(const RunConfig& config, const std::vector<DoctorPair>& pairs) {
  const Problem& rig = config.data.rig;
  std::set<std::string> cameras;
  std::set<std::string> targets;
  std::set<std::string> arms;
  for (const DoctorPair& pair : pairs) {
    cameras.insert(rig.cameras[pair.camera].name);
    targets.insert(rig.targets[pair.target].name);
    arms.insert(rig.robots[pair.robot]);
  }
  std::string text = NamesText("camera", "cameras", cameras);
  if (rig.targets.size() > 1) text += ", " + NamesText("target", "targets", targets);
  if (rig.robots.size() > 1) text += ", " + NamesText("arm", "arms", arms);
  return text;
}

Diagnosis DiagnosePair(const RunConfig& config, const DoctorPair& pair, int num_threads, Verbosity verbosity) {
  return DiagnosePair(ConfigOf(config, pair), num_threads, verbosity, Examine::kInputs, ContextOf(config, pair));
}

std::vector<DiagnosedPair> DiagnosePairs(const RunConfig& config, std::vector<DoctorPair> pairs, int num_threads,
                                         Verbosity verbosity) {
  std::vector<DiagnosedPair> diagnosed;
  for (DoctorPair& pair : pairs) {
    Diagnosis diagnosis = DiagnosePair(config, pair, num_threads, verbosity);
    diagnosed.push_back({std::move(pair), std::move(diagnosis)});
  }
  return diagnosed;
}

}  // namespace heba
