#include "tools/doctor/rig_doctor.h"

#include <algorithm>
#include <cctype>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "heba/base/median.h"
#include "heba/base/text.h"
#include "heba/rig_run.h"
#include "solvers/initial/usable_views.h"
#include "tools/doctor/examination.h"
#include "tools/files/cached_detector.h"
#include "tools/run/arm_keys.h"
#include "tools/text/finding_text.h"
#include "tools/text/run_console.h"

namespace heba {

std::vector<Symptom> Check_robot(Examination* examination);

namespace {

// A camera and a target that one arm moves against each other.
struct DoctorPair {
  size_t camera = 0;
  size_t target = 0;
  size_t robot = 0;
  std::vector<size_t> captures;  // Those in which the camera sees the target, or no target at all.
  int num_seen = 0;
};

// Symptoms that are not those of a part of a rig: its mounts state the setup, and PairsOfOtherArms tells about arms.
constexpr std::string_view kNotOfPairs[] = {"either_set_up", "other_arm"};
// Faults of a camera alone that the other cameras of a rig may make up for.
constexpr std::string_view kOthersMayHelp[] = {"few_captures", "motion", "little_rotation", "target_often_missed"};
// Faults because of which the images of a pair do not fit its poses.
constexpr std::string_view kOfPoses[] = {"rotation_format", "angle_unit",       "pose_units",
                                         "pose_direction",  "rotation_inverse", "other_arm",
                                         "pairing",         "target_scale",     "poses_unexplained"};
// Faults because of which the images of a pair do not tell whether they fit.
constexpr std::string_view kDoNotTell[] = {"motion", "few_captures"};
// Fewer images do not tell whether they fit the poses.
constexpr int kEnoughImages = 6;

template <class Names>
bool IsIn(const Names& names, const SymptomCode& code) {
  return std::find(std::begin(names), std::end(names), code.name()) != std::end(names);
}

bool IsSeen(const RigDetection& detection) {
  return static_cast<int>(detection.detection.detection.ids.size()) >= kMinPosePoints;
}

// Returns the arm that moves the camera against the target; nothing if none or several do.
std::optional<size_t> ArmOf(const RigProblem& rig, size_t camera, size_t target) {
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

// Returns the pairs to diagnose: those with enough images and, for a camera without such a pair, the one with the most.
std::vector<DoctorPair> PairsOf(const RigConfig& config, const std::vector<RigDetection>& detections) {
  const RigProblem& rig = config.data.rig;
  std::vector<DoctorPair> pairs;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    std::vector<int> num_targets(config.data.captures.size(), 0);
    for (const RigDetection& detection : detections) {
      if (detection.camera == c && IsSeen(detection)) ++num_targets[detection.capture];
    }
    std::vector<DoctorPair> of_camera;
    for (size_t t = 0; t < rig.targets.size(); ++t) {
      const std::optional<size_t> arm = ArmOf(rig, c, t);
      if (!arm) continue;
      DoctorPair pair{c, t, *arm, {}, 0};
      for (const RigDetection& detection : detections) {
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

// Returns the data set of a pair as that of one camera.
RunConfig ConfigOf(const RigConfig& config, const DoctorPair& pair) {
  const RigDataset& data = config.data;
  const RigCamera& camera = data.rig.cameras[pair.camera];
  RunConfig of_pair;
  of_pair.file = config.file;
  of_pair.data.name = data.name;
  of_pair.data.setup = camera.mount == Mount{pair.robot, Mount::Part::kGripper} ? Setup::kEyeInHand : Setup::kEyeToHand;
  of_pair.data.target = data.targets[pair.target];
  of_pair.target_used = config.targets_used[pair.target];
  of_pair.has_target_keys = config.has_target_keys[pair.target];
  if (data.has_camera[pair.camera]) {
    of_pair.data.camera = camera.camera;
    of_pair.data.camera_source = data.camera_sources[pair.camera];
  }
  of_pair.options.choose_camera_model = camera.camera.model.empty();
  of_pair.options.camera_model = camera.camera.model.empty() ? "auto" : camera.camera.model;
  of_pair.options.bundle.free_intrinsics = camera.free_intrinsics;
  const RigArmPoses& arm = config.arms[pair.robot];
  of_pair.poses_file = arm.file;
  of_pair.pose_reading = arm.reading;
  of_pair.num_images = pair.captures.size();
  for (const size_t i : pair.captures) {
    Capture capture;
    capture.name = data.captures[i].name;
    capture.image = data.captures[i].images[pair.camera];
    capture.base_from_gripper = data.captures[i].base_from_gripper[pair.robot];
    of_pair.data.captures.push_back(std::move(capture));
    of_pair.pose_numbers.push_back(arm.numbers[i]);
  }
  return of_pair;
}

// Returns the data set of a pair with the kinematics and the recorded joints of its arm.
RunConfig ConfigWithArm(const RigConfig& config, const DoctorPair& pair) {
  RunConfig of_pair = ConfigOf(config, pair);
  of_pair.data.robot = config.data.arms[pair.robot];
  of_pair.joints_are_deg = config.arms[pair.robot].joints_are_deg;
  of_pair.options.kinematics = config.options.kinematics;
  for (size_t k = 0; k < pair.captures.size(); ++k) {
    of_pair.data.captures[k].joints = config.data.captures[pair.captures[k]].joints[pair.robot];
  }
  return of_pair;
}

// What the keys of a config of one camera are called in that of a rig.
std::vector<std::pair<std::string, std::string>> RigKeys(const RigConfig& config, const DoctorPair& pair) {
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

// Returns the symptom with the keys of the rig's config.
Symptom InRig(const RigConfig& config, const DoctorPair& pair, Symptom symptom) {
  const std::vector<std::pair<std::string, std::string>> keys = RigKeys(config, pair);
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

// A pair, diagnosed as a data set of one camera.
struct DiagnosedPair {
  DoctorPair pair;
  Diagnosis diagnosis;
};

template <class Codes>
bool HasWrong(const DiagnosedPair& diagnosed, const Codes& codes) {
  const std::vector<Symptom>& symptoms = diagnosed.diagnosis.symptoms;
  return std::any_of(symptoms.begin(), symptoms.end(), [&](const Symptom& symptom) {
    return symptom.severity == Severity::kWrong && IsIn(codes, symptom.code);
  });
}

// Returns whether the images of a pair are known to fit the poses of its arm.
bool FitsPoses(const DiagnosedPair& diagnosed) {
  const std::optional<PoseFit>& fit = diagnosed.diagnosis.pose_fit;
  return diagnosed.pair.num_seen >= kEnoughImages && fit && fit->fits && !HasWrong(diagnosed, kOfPoses) &&
         !HasWrong(diagnosed, kDoNotTell);
}

// A symptom, and the pairs that have it.
struct SharedSymptom {
  Symptom symptom;
  std::vector<DoctorPair> pairs;
};

std::string WithoutNumbers(const std::string& text) {
  std::string letters;
  for (const char c : text) {
    if (std::isalpha(static_cast<unsigned char>(c)) != 0) letters += c;
  }
  return letters;
}

// Returns whether a pair has a symptom that others have, with the same cure up to its figures.
bool IsShared(const SharedSymptom& shared, const Symptom& symptom, const DoctorPair& pair) {
  const Symptom& known = shared.symptom;
  if (symptom.reading == kInversePoses && pair.robot != shared.pairs.front().robot) return false;
  return known.code == symptom.code && known.reading == symptom.reading && known.settings == symptom.settings &&
         WithoutNumbers(known.cure) == WithoutNumbers(symptom.cure) && !IsOfSingleCaptures(symptom.code);
}

std::string NamesText(const char* one, const char* several, const std::set<std::string>& names) {
  const std::vector<std::string> list(names.begin(), names.end());
  return (list.size() == 1 ? one : several) + std::string(" ") + Join(list, ", ");
}

// Names the parts of the rig that have a symptom: "cameras left, right, target plate".
std::string WhereText(const RigConfig& config, const std::vector<DoctorPair>& pairs) {
  const RigProblem& rig = config.data.rig;
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

// The cameras that have a fault, and their keys.
class FaultyCameras {
 public:
  FaultyCameras(const RigConfig& config, const std::vector<DoctorPair>& pairs) : data_(config.data) {
    for (const DoctorPair& pair : pairs) {
      cameras_.insert(pair.camera);
      targets_.insert(pair.target);
    }
  }

  bool Contain(size_t camera) const { return cameras_.contains(camera); }
  // Returns one of their keys, such as "cameras.left.images, cameras.right.images".
  std::string Keys(const std::string& key) const {
    std::vector<std::string> keys;
    for (const size_t c : cameras_) keys.push_back("cameras." + data_.rig.cameras[c].name + "." + key);
    return Join(keys, ", ");
  }
  std::string TargetMounts() const {
    std::vector<std::string> keys;
    for (const size_t t : targets_) keys.push_back("targets." + data_.rig.targets[t].name + ".mount");
    return Join(keys, ", ");
  }
  bool AreGiven() const {
    return std::all_of(cameras_.begin(), cameras_.end(), [&](size_t c) { return data_.has_camera[c]; });
  }

 private:
  const RigDataset& data_;
  std::set<size_t> cameras_;
  std::set<size_t> targets_;
};

// The cures of faults that are those of cameras, because their images or intrinsics are wrong, not the poses or the
// target: other cameras of the same arm, or that see the same target, do not have them. `others` names those,
// `same_target` states whether one of them sees the target.
struct CureOfCamera {
  std::string_view code;
  bool is_of_arm;  // Whether the others are those of the same arm, not those that see the same target.
  std::string (*cure)(const FaultyCameras& cameras, const std::string& others, bool same_target);
};
constexpr CureOfCamera kCuresOfCameras[] = {
    {"pairing", true,
     [](const FaultyCameras& cameras, const std::string& others, bool) {
       return "the images of " + others + " fit the poses, so correct " + cameras.Keys("images") +
              ", or name the images of each capture in the poses file (columns image.CAMERA)";
     }},
    {"target_scale", false,
     [](const FaultyCameras& cameras, const std::string& others, bool) {
       return "the images of " + others + " show the target in its size, so " +
              (cameras.AreGiven()
                   ? "check " + cameras.Keys("intrinsics") + ", or leave it out to have it estimated"
                   : "state " + cameras.Keys("intrinsics") + ", which the captures do not determine well");
     }},
    {"poses_unexplained", true,
     [](const FaultyCameras& cameras, const std::string& others, bool same_target) {
       return "the images of " + others + " fit the poses, so check " + cameras.Keys("images") + ", " +
              cameras.Keys("mount") + (same_target ? "" : ", " + cameras.TargetMounts()) + " and " +
              cameras.Keys("intrinsics");
     }},
};

// Returns whether the images of other cameras of the same arm belong to other rows.
bool ArePairedDifferently(const std::vector<DiagnosedPair>& diagnosed, const SharedSymptom& shared) {
  return std::any_of(diagnosed.begin(), diagnosed.end(), [&](const DiagnosedPair& other) {
    const std::vector<Symptom>& symptoms = other.diagnosis.symptoms;
    return other.pair.robot == shared.pairs.front().robot &&
           std::any_of(symptoms.begin(), symptoms.end(), [&](const Symptom& symptom) {
             return symptom.code == shared.symptom.code && symptom.reading != shared.symptom.reading;
           });
  });
}

// Returns such a cure if it applies, otherwise an empty text.
std::string CureIfOfCamera(const RigConfig& config, const std::vector<DiagnosedPair>& diagnosed,
                           const SharedSymptom& shared) {
  const auto of_camera = std::find_if(std::begin(kCuresOfCameras), std::end(kCuresOfCameras),
                                      [&](const auto& entry) { return shared.symptom.code.name() == entry.code; });
  if (of_camera == std::end(kCuresOfCameras)) return "";
  const FaultyCameras faulty(config, shared.pairs);
  const auto is_alike = [&](const DoctorPair& a, const DoctorPair& b) {
    return of_camera->is_of_arm ? a.robot == b.robot : a.target == b.target;
  };
  const auto fits = [&](const DiagnosedPair& other) {
    return FitsPoses(other) && (of_camera->is_of_arm || other.diagnosis.pose_fit->tells_scale);
  };
  std::set<std::string> others;
  bool same_target = false;
  for (const DoctorPair& pair : shared.pairs) {
    std::set<std::string> of_pair;
    for (const DiagnosedPair& other : diagnosed) {
      if (!is_alike(other.pair, pair)) continue;
      const bool is_faulty = faulty.Contain(other.pair.camera);
      // The camera fits with another target: the fault is not the camera's.
      if (is_faulty && fits(other)) return "";
      const bool is_in_doubt = std::any_of(diagnosed.begin(), diagnosed.end(), [&](const DiagnosedPair& same) {
        return same.pair.camera == other.pair.camera && is_alike(same.pair, pair) && HasWrong(same, kOfPoses);
      });
      if (is_faulty || is_in_doubt || !fits(other)) continue;
      of_pair.insert(config.data.rig.cameras[other.pair.camera].name);
      same_target = same_target || other.pair.target == pair.target;
    }
    if (of_pair.empty()) return "";
    others.insert(of_pair.begin(), of_pair.end());
  }
  return of_camera->cure(faulty, NamesText("camera", "cameras", others), same_target);
}

// Returns the settings that exchange what is carried in these pairs: their cameras or their targets.
std::vector<ConfigSetting> OtherMounts(const RigConfig& config, const std::vector<DoctorPair>& pairs) {
  const RigProblem& rig = config.data.rig;
  std::map<std::string, std::string> mount_of;
  for (const DoctorPair& pair : pairs) {
    const Mount gripper{pair.robot, Mount::Part::kGripper};
    const bool carries_camera = rig.cameras[pair.camera].mount == gripper;
    const std::string on_gripper = MountText(rig.robots, gripper);
    mount_of["cameras." + rig.cameras[pair.camera].name + ".mount"] = carries_camera ? "world" : on_gripper;
    mount_of["targets." + rig.targets[pair.target].name + ".mount"] = carries_camera ? on_gripper : "world";
  }
  std::vector<ConfigSetting> settings;
  for (const auto& [key, mount] : mount_of) settings.push_back({key, mount});
  return settings;
}

// Adds what to change if the poses of an arm are the inverse of what the config says: `poses_are` or, if other images
// fit the poses, the mounts. If all images of the arm are those of carried cameras, or all those of carried targets,
// both are possible.
void AddCureOfDirection(const RigConfig& config, const std::vector<DiagnosedPair>& diagnosed, SharedSymptom* shared) {
  const RigProblem& rig = config.data.rig;
  const size_t robot = shared->pairs.front().robot;
  const Mount gripper{robot, Mount::Part::kGripper};
  std::set<bool> carries_camera;
  for (const DoctorPair& pair : shared->pairs) carries_camera.insert(rig.cameras[pair.camera].mount == gripper);
  std::set<std::string> others;
  for (const DiagnosedPair& other : diagnosed) {
    if (other.pair.robot == robot && FitsPoses(other)) others.insert(rig.cameras[other.pair.camera].name);
  }
  const RigArmPoses& arm = config.arms[robot];
  const ConfigSetting direction{arm.section + ".poses_are",
                                arm.reading.is_base_from_gripper ? "gripper_from_base" : "base_from_gripper"};
  const std::vector<ConfigSetting> mounts = OtherMounts(config, shared->pairs);
  Symptom& symptom = shared->symptom;
  std::string cure;
  if (!others.empty()) {
    cure = "the images of " + NamesText("camera", "cameras", others) + " fit the poses, so set " + SettingsText(mounts);
    symptom.settings.insert(symptom.settings.end(), mounts.begin(), mounts.end());
  } else if (carries_camera.size() == 2) {
    cure = "set " + SettingsText({direction});
    symptom.settings.push_back(direction);
  } else {
    cure = "set " + SettingsText({direction}) + " or, if the arm carries what the mounts say is fixed, " +
           SettingsText(mounts) + "; the data cannot distinguish these two, but you can see which one applies";
    symptom.settings.clear();
  }
  symptom.cure += (symptom.cure.empty() ? "" : "; ") + cure;
}

RigContext ContextOf(const RigConfig& config, const DoctorPair& pair) {
  const RigDataset& data = config.data;
  RigContext context;
  for (size_t t = 0; t < data.targets.size(); ++t) {
    if (t == pair.target) continue;
    for (std::string& code : data.targets[t]->Codes()) context.other_codes.push_back(std::move(code));
  }
  context.place = pair.captures;
  for (size_t r = 0; r < data.rig.robots.size(); ++r) {
    std::vector<Rigid3d> poses;
    for (const RigRecording& capture : data.captures) poses.push_back(capture.base_from_gripper[r]);
    if (r == pair.robot) {
      context.base_from_gripper = std::move(poses);
    } else {
      context.other_arms.push_back({data.rig.robots[r], std::move(poses)});
    }
  }
  for (const RigRecording& capture : data.captures) context.captures.push_back(capture.name);
  return context;
}

// Diagnoses a pair as a data set of one camera.
Diagnosis DiagnosePair(const RigConfig& config, const DoctorPair& pair, int num_threads, Verbosity verbosity) {
  return Diagnose(ConfigOf(config, pair), num_threads, verbosity, Examine::kInputs, ContextOf(config, pair));
}

std::vector<DiagnosedPair> DiagnosePairs(const RigConfig& config, std::vector<DoctorPair> pairs, int num_threads,
                                         Verbosity verbosity) {
  std::vector<DiagnosedPair> diagnosed;
  for (DoctorPair& pair : pairs) {
    Diagnosis diagnosis = DiagnosePair(config, pair, num_threads, verbosity);
    diagnosed.push_back({std::move(pair), std::move(diagnosis)});
  }
  return diagnosed;
}

// The cameras and targets with a wrong mount, which may be the cause of anything else that is wrong with them.
struct Misplaced {
  std::set<size_t> cameras;
  std::set<size_t> targets;
  bool Contains(size_t camera, size_t target) const { return cameras.contains(camera) || targets.contains(target); }
};

// Pairs that fit the poses of another arm than that of their mounts.
class PairsOfOtherArms {
 public:
  PairsOfOtherArms(const RigConfig& config, const std::vector<DiagnosedPair>& diagnosed)
      : config_(config), rig_(config.data.rig) {
    for (const DiagnosedPair& entry : diagnosed) {
      const std::optional<size_t> arm = OtherArmOf(entry);
      if (arm) pairs_.push_back({&entry, *arm});
      // The files of two arms are exchanged if all images that tell fit the poses of the other one.
      if (!arm && !FitsPoses(entry)) continue;
      const auto [known, is_new] = file_of_.emplace(entry.pair.robot, arm);
      if (!is_new && known->second != arm) known->second = std::nullopt;
    }
  }

  // Returns what they show: files of poses that are exchanged, or mounts that name the wrong arm, which are added to
  // `misplaced`.
  std::vector<Symptom> Symptoms(Misplaced* misplaced) const {
    std::vector<Symptom> symptoms;
    std::set<std::vector<size_t>> known_cycles;
    for (const PairOfOtherArm& pair : pairs_) {
      const size_t robot = pair.diagnosed->pair.robot;
      if (const std::vector<size_t> cycle = CycleOf(robot); !cycle.empty()) {
        if (known_cycles.insert(cycle).second) symptoms.push_back(ExchangedFiles(cycle, pair));
        continue;
      }
      const size_t c = pair.diagnosed->pair.camera;
      const bool is_camera = rig_.cameras[c].mount == Mount{robot, Mount::Part::kGripper};
      const bool is_new = is_camera ? misplaced->cameras.insert(c).second
                                    : misplaced->targets.insert(pair.diagnosed->pair.target).second;
      if (is_new) symptoms.push_back(WrongArm(is_camera, pair));
    }
    return symptoms;
  }

 private:
  struct PairOfOtherArm {
    const DiagnosedPair* diagnosed = nullptr;
    size_t arm = 0;
  };

  std::optional<size_t> OtherArmOf(const DiagnosedPair& diagnosed) const {
    for (const Symptom& symptom : diagnosed.diagnosis.symptoms) {
      if (symptom.code.name() != "other_arm") continue;
      const auto arm = std::find(rig_.robots.begin(), rig_.robots.end(), symptom.reading);
      return static_cast<size_t>(arm - rig_.robots.begin());
    }
    return std::nullopt;
  }

  // Returns the arms, in their order, each of which has the file of another one of them; empty if `robot` has its own
  // file, or if the images contradict each other.
  std::vector<size_t> CycleOf(size_t robot) const {
    std::set<size_t> cycle;
    for (size_t r = robot; cycle.insert(r).second;) {
      const auto file = file_of_.find(r);
      if (file == file_of_.end() || !file->second) return {};
      r = *file->second;
      if (cycle.contains(r) && r != robot) return {};
    }
    return {cycle.begin(), cycle.end()};
  }

  std::string EvidenceOf(const PairOfOtherArm& pair) const {
    for (const Symptom& symptom : pair.diagnosed->diagnosis.symptoms) {
      if (symptom.code.name() == "other_arm") return symptom.evidence;
    }
    return "";
  }

  bool HaveOneFormat(const std::vector<size_t>& arms) const {
    return std::all_of(arms.begin(), arms.end(), [&](size_t r) {
      const PoseReading& first = config_.arms[arms.front()].reading;
      const PoseReading& reading = config_.arms[r].reading;
      return PoseFormatText(reading.format) == PoseFormatText(first.format) &&
             reading.is_base_from_gripper == first.is_base_from_gripper;
    });
  }

  Symptom ExchangedFiles(const std::vector<size_t>& arms, const PairOfOtherArm& pair) const {
    std::vector<std::string> names;
    for (const size_t r : arms) names.push_back(rig_.robots[r]);
    Symptom symptom{Severity::kWrong, "other_arm", "the poses of the arms " + Joined(names) + " are exchanged", ""};
    symptom.evidence = WhereText(config_, {pair.diagnosed->pair}) + ": " + EvidenceOf(pair);
    // A file that is read in another format has other poses.
    const bool is_file_only = HaveOneFormat(arms);
    std::vector<std::string> sections;
    for (const size_t r : arms) {
      sections.push_back(config_.arms[r].section + (is_file_only ? ".poses" : ""));
      if (!is_file_only) continue;
      const std::filesystem::path file = std::filesystem::absolute(config_.arms[*file_of_.at(r)].file);
      symptom.settings.push_back({sections.back(), file.lexically_normal().string()});
    }
    symptom.cure = "exchange " + Joined(sections) + " or, if these are right, the arms in the mounts";
    return symptom;
  }

  Symptom WrongArm(bool is_camera, const PairOfOtherArm& pair) const {
    const std::string& name =
        is_camera ? rig_.cameras[pair.diagnosed->pair.camera].name : rig_.targets[pair.diagnosed->pair.target].name;
    const std::string part = is_camera ? "camera " : "target ";
    Symptom symptom{Severity::kWrong, "other_arm",
                    part + name + " is carried by arm " + rig_.robots[pair.arm] + ", not by arm " +
                        rig_.robots[pair.diagnosed->pair.robot],
                    ""};
    symptom.evidence = EvidenceOf(pair);
    symptom.settings = {{(is_camera ? "cameras." : "targets.") + name + ".mount",
                         MountText(rig_.robots, {pair.arm, Mount::Part::kGripper})}};
    symptom.cure = "set " + SettingsText(symptom.settings);
    return symptom;
  }

  static std::string Joined(std::vector<std::string> names) {
    const std::string last = std::move(names.back());
    names.pop_back();
    return Join(names, ", ") + " and " + last;
  }

  const RigConfig& config_;
  const RigProblem& rig_;
  std::vector<PairOfOtherArm> pairs_;
  // For each arm with images that tell, the arm that has its poses; nothing if these are its own, or if the images
  // contradict each other.
  std::map<size_t, std::optional<size_t>> file_of_;
};

std::vector<Symptom> SymptomsOfPairs(const RigConfig& config, const std::vector<DiagnosedPair>& diagnosed) {
  std::vector<SharedSymptom> shared;
  for (const DiagnosedPair& entry : diagnosed) {
    const DoctorPair& pair = entry.pair;
    const Diagnosis& diagnosis = entry.diagnosis;
    for (const Symptom& of_pair : diagnosis.symptoms) {
      if (IsIn(kNotOfPairs, of_pair.code)) continue;
      // A fault of all captures may cause those of single ones.
      const bool is_certain = diagnosis.NumWrong() == 0 || of_pair.severity == Severity::kWrong;
      if (!is_certain && IsOfSingleCaptures(of_pair.code)) continue;
      Symptom symptom = InRig(config, pair, of_pair);
      const auto known = std::find_if(shared.begin(), shared.end(),
                                      [&](const SharedSymptom& other) { return IsShared(other, symptom, pair); });
      if (known == shared.end()) {
        shared.push_back({std::move(symptom), {pair}});
      } else {
        known->pairs.push_back(pair);
      }
    }
  }
  std::vector<Symptom> symptoms;
  for (SharedSymptom& entry : shared) {
    const std::string cure = CureIfOfCamera(config, diagnosed, entry);
    if (!cure.empty()) {
      entry.symptom.cure = cure;
      entry.symptom.settings.clear();
    } else if (entry.symptom.code.name() == "pairing" && ArePairedDifferently(diagnosed, entry)) {
      entry.symptom.cure =
          "other cameras are paired otherwise, so name the images of each capture in the poses file "
          "(columns image.CAMERA)";
    }
    if (entry.symptom.reading == kInversePoses) AddCureOfDirection(config, diagnosed, &entry);
    std::set<std::string> cameras;
    for (const DoctorPair& pair : entry.pairs) cameras.insert(config.data.rig.cameras[pair.camera].name);
    entry.symptom.cameras.assign(cameras.begin(), cameras.end());
    entry.symptom.what = WhereText(config, entry.pairs) + ": " + entry.symptom.what;
    symptoms.push_back(std::move(entry.symptom));
  }
  return symptoms;
}

// Returns whether the joints of an arm are recorded in all captures.
bool AreJointsRecorded(const RigConfig& config, size_t robot) {
  return std::all_of(config.data.captures.begin(), config.data.captures.end(),
                     [&](const RigRecording& capture) { return !capture.joints[robot].empty(); });
}

// Examines whether joints and poses are those of the arms that the config names. Recorded joints need no images.
// Otherwise arms and tools are compared by the images of one pair of each arm, the one that is seen most.
std::vector<Symptom> SymptomsOfArms(const RigConfig& config, const std::vector<DiagnosedPair>& pairs, int num_threads) {
  std::vector<Symptom> symptoms;
  for (size_t r = 0; r < config.data.rig.robots.size(); ++r) {
    if (!config.data.arms[r]) continue;
    const bool is_recorded = AreJointsRecorded(config, r);
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
    examination.camera = examination.config.data.camera;
    examination.num_threads = num_threads;
    if (!is_recorded) examination.detections = Detections(examination.config, num_threads, Verbosity::kQuiet);
    for (Symptom& symptom : Check_robot(&examination)) {
      symptoms.push_back(InRig(config, *best, std::move(symptom)));
      if (config.data.rig.robots.size() == 1) continue;
      symptoms.back().what = "arm " + config.data.rig.robots[r] + ": " + symptoms.back().what;
    }
  }
  return symptoms;
}

// Reports targets that no camera sees, with the target that the images show instead, if there is one.
std::vector<Symptom> UnseenTargets(const RigConfig& config, const std::vector<RigDetection>& detections,
                                   int num_threads) {
  const RigDataset& data = config.data;
  std::vector<Symptom> symptoms;
  for (size_t t = 0; t < data.rig.targets.size(); ++t) {
    const bool is_seen = std::any_of(detections.begin(), detections.end(), [&](const RigDetection& detection) {
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
        unseen = InRig(config, pair, symptom);
        unseen.what = WhereText(config, {pair}) + ": " + unseen.what;
        break;
      }
    }
    symptoms.push_back(std::move(unseen));
  }
  return symptoms;
}

// A target in the images of a camera, in the order of the captures.
struct PointMotion {
  double median_px = 0;  // The median over the images of the distance from the first image; 0 for one image.
  struct Step {
    size_t from = 0;  // The captures of two successive images.
    size_t to = 0;
    double distance_px = 0;  // The median over the points that both show.
  };
  std::vector<Step> steps;
};

using Pixels = std::map<int, Eigen::Vector2d>;

// Returns the median distance of the points that both images show; nothing if they share none.
std::optional<double> MedianDistancePx(const Pixels& before, const Pixels& after) {
  std::vector<double> distances_px;
  for (const auto& [id, pixel] : after) {
    const auto found = before.find(id);
    if (found != before.end()) distances_px.push_back((pixel - found->second).norm());
  }
  if (distances_px.empty()) return std::nullopt;
  return Median(distances_px);
}

PointMotion MotionOfPoints(const std::vector<RigDetection>& detections, size_t camera, size_t target) {
  PointMotion motion;
  std::vector<double> from_first_px;
  Pixels first;
  std::optional<std::pair<size_t, Pixels>> last;
  for (const RigDetection& detection : detections) {
    if (detection.camera != camera || detection.target != target || !IsSeen(detection)) continue;
    const Detection& points = detection.detection.detection;
    Pixels pixels;
    for (size_t k = 0; k < points.ids.size(); ++k) pixels[points.ids[k]] = points.pixels[k];
    if (first.empty()) first = pixels;
    if (last) {
      if (const std::optional<double> distance_px = MedianDistancePx(first, pixels)) {
        from_first_px.push_back(*distance_px);
      }
      if (const std::optional<double> distance_px = MedianDistancePx(last->second, pixels)) {
        motion.steps.push_back({last->first, detection.capture, *distance_px});
      }
    }
    last.emplace(detection.capture, std::move(pixels));
  }
  if (!from_first_px.empty()) motion.median_px = Median(from_first_px);
  return motion;
}

constexpr double kMovesPx = 10;  // Vibration moves points by less.

// Returns the larger step if the points stay at two or three places, in several successive images each.
std::optional<PointMotion::Step> StepBetweenPlaces(const PointMotion& motion) {
  constexpr int kFewestAtPlace = 3;
  constexpr int kMostSteps = 2;
  std::optional<PointMotion::Step> largest;
  int num_at_place = 1;
  int num_steps = 0;
  for (const PointMotion::Step& step : motion.steps) {
    if (step.distance_px < kMovesPx) {
      ++num_at_place;
      continue;
    }
    if (num_at_place < kFewestAtPlace) return std::nullopt;
    num_at_place = 1;
    ++num_steps;
    if (!largest || step.distance_px > largest->distance_px) largest = step;
  }
  if (num_at_place < kFewestAtPlace || num_steps > kMostSteps) return std::nullopt;
  return largest;
}

// Returns whether the points move between many successive images; between all of them, if no pose is repeated.
bool KeepsMoving(const PointMotion& motion) {
  constexpr double kMany = 0.25;
  const auto num_moving = std::count_if(motion.steps.begin(), motion.steps.end(),
                                        [](const PointMotion::Step& step) { return step.distance_px >= kMovesPx; });
  return static_cast<double>(num_moving) > kMany * static_cast<double>(motion.steps.size()) &&
         motion.median_px >= kMovesPx;
}

// Reports cameras and targets that stand on one mount by the config, but move against each other in the images: all the
// time, because a mount is wrong, which adds the camera to `misplaced`; or once, because one of them was moved. What is
// in `misplaced` already is not reported.
std::vector<Symptom> WrongMounts(const RigConfig& config, const std::vector<RigDetection>& detections,
                                 Misplaced* misplaced) {
  const RigProblem& rig = config.data.rig;
  std::vector<Symptom> symptoms;
  const Misplaced known = *misplaced;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    for (size_t t = 0; t < rig.targets.size(); ++t) {
      if (known.Contains(c, t)) continue;
      if (MovesAgainst(rig.cameras[c].mount, rig.targets[t].mount)) continue;
      const PointMotion motion = MotionOfPoints(detections, c, t);
      const std::string& camera = rig.cameras[c].name;
      const std::string& target = rig.targets[t].name;
      if (const std::optional<PointMotion::Step> step = StepBetweenPlaces(motion)) {
        symptoms.push_back({Severity::kWrong, "camera_moved",
                            "camera " + camera + " (" + MountText(rig, rig.cameras[c]) + ") or target " + target +
                                " (" + MountText(rig, rig.targets[t]) + ") was moved between the captures " +
                                config.data.captures[step->from].name + " and " + config.data.captures[step->to].name +
                                ": the points of the target stay at their pixels before and after, but move by " +
                                Significant(step->distance_px, 2) + " px between these two",
                            "fix the mount of the camera or of the target and record all captures again, or calibrate "
                            "from the captures after the motion only (captures.exclude)"});
      } else if (KeepsMoving(motion)) {
        misplaced->cameras.insert(c);
        symptoms.push_back({Severity::kWrong, "mount",
                            "camera " + camera + " (" + MountText(rig, rig.cameras[c]) + ") and target " + target +
                                " (" + MountText(rig, rig.targets[t]) +
                                ") cannot move against each other with these mounts, but the points of the target "
                                "move by " +
                                Significant(motion.median_px, 2) + " px between the images",
                            "correct cameras." + camera + ".mount or targets." + target +
                                ".mount: one of them is on the gripper of an arm"});
      }
    }
  }
  return symptoms;
}

// Reports the images and poses that the config read but cannot use.
std::vector<Symptom> Unpaired(const std::vector<RigLeftOut>& left_out) {
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
  return !symptom.cameras.empty() && (symptom.code.name() == "poses_unexplained" || IsOfSingleCaptures(symptom.code));
}

// Adds what the adjustment of the whole rig finds. If something is wrong with the inputs, only cameras that were moved
// are added, and the symptoms that they explain are removed.
void AddResult(const RigConfig& config, const std::vector<DetectFunction>& detect, int num_threads,
               Diagnosis* diagnosis) {
  RigRunOptions options = config.options;
  options.num_threads = num_threads;
  options.detect = detect;
  const Outcome<RigRunOutput> run = RunRig(config.data, options);
  if (!run) {
    if (diagnosis->NumWrong() > 0) return;
    diagnosis->symptoms.push_back({Severity::kWrong, "no_result", run.reason(), ""});
    return;
  }
  std::erase_if(diagnosis->symptoms,
                [&](const Symptom& symptom) { return IsExplainedByMotion(symptom, run->calibration); });
  const bool is_wrong = diagnosis->NumWrong() > 0;
  for (const Finding& finding : run->result.verdict.findings) {
    if (finding.grade == Grade::kGood || (is_wrong && finding.code != "camera_moved")) continue;
    diagnosis->symptoms.push_back(SymptomOf(finding));
  }
}

}  // namespace

bool IsExplainedByMotion(const Symptom& symptom, const RigCalibration& calibration) {
  if (calibration.moved.empty()) return false;
  if (symptom.code.name() == "camera_moved") return true;
  if (!MayBeMotion(symptom)) return false;
  return std::all_of(symptom.cameras.begin(), symptom.cameras.end(), [&](const std::string& camera) {
    std::set<std::string> left_out;
    for (const MovedCamera& moved : calibration.moved) {
      if (calibration.problem.cameras[moved.camera].name != camera) continue;
      for (const size_t i : moved.left_out) left_out.insert(calibration.problem.captures[i].name);
    }
    const bool is_of_all = !IsOfSingleCaptures(symptom.code);
    return !left_out.empty() &&
           (is_of_all || (!symptom.captures.empty() &&
                          std::all_of(symptom.captures.begin(), symptom.captures.end(),
                                      [&](const std::string& capture) { return left_out.contains(capture); })));
  });
}

Diagnosis Diagnose(const RigConfig& config, int num_threads, Verbosity verbosity, Examine examine) {
  std::vector<DetectFunction> detect;
  for (const std::string& target : config.targets_used) detect.push_back(CachedDetection(target));
  ProgressObserver observer(verbosity);
  const std::vector<RigDetection> detections = DetectRig(config.data, detect, num_threads, &observer);
  Diagnosis diagnosis;
  diagnosis.num_captures = static_cast<int>(config.data.captures.size());
  std::set<std::pair<size_t, size_t>> images;
  std::set<std::pair<size_t, size_t>> seen;
  for (const RigDetection& detection : detections) {
    images.insert({detection.capture, detection.camera});
    if (IsSeen(detection)) seen.insert({detection.capture, detection.camera});
  }
  diagnosis.num_images = static_cast<int>(images.size());
  diagnosis.num_seen = static_cast<int>(seen.size());
  diagnosis.symptoms = UnseenTargets(config, detections, num_threads);
  std::vector<DiagnosedPair> pairs = DiagnosePairs(config, PairsOf(config, detections), num_threads, verbosity);
  Misplaced misplaced;
  for (Symptom& symptom : PairsOfOtherArms(config, pairs).Symptoms(&misplaced)) {
    diagnosis.symptoms.push_back(std::move(symptom));
  }
  for (Symptom& symptom : WrongMounts(config, detections, &misplaced)) {
    diagnosis.symptoms.push_back(std::move(symptom));
  }
  std::erase_if(pairs,
                [&](const DiagnosedPair& entry) { return misplaced.Contains(entry.pair.camera, entry.pair.target); });
  for (Symptom& symptom : SymptomsOfPairs(config, pairs)) diagnosis.symptoms.push_back(std::move(symptom));
  // Poses that are read wrongly are those of no arm.
  if (diagnosis.NumWrong() == 0) {
    for (Symptom& symptom : SymptomsOfArms(config, pairs, num_threads)) {
      diagnosis.symptoms.push_back(std::move(symptom));
    }
  }
  for (Symptom& symptom : Unpaired(config.data.left_out)) diagnosis.symptoms.push_back(std::move(symptom));
  const bool may_be_motion =
      std::all_of(diagnosis.symptoms.begin(), diagnosis.symptoms.end(),
                  [](const Symptom& symptom) { return symptom.severity != Severity::kWrong || MayBeMotion(symptom); });
  if (may_be_motion && examine == Examine::kInputsAndResult) AddResult(config, detect, num_threads, &diagnosis);
  SortBySeverity(&diagnosis);
  return diagnosis;
}

}  // namespace heba
