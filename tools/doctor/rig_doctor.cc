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

// Symptoms that do not apply to a part of a rig: its mounts state the setup.
constexpr std::string_view kNotOfPairs[] = {"either_set_up"};
// Faults of a camera alone that the other cameras of a rig may make up for.
constexpr std::string_view kOthersMayHelp[] = {"few_captures", "motion", "little_rotation", "target_often_missed"};
// Symptoms of single captures, which are never reported for several pairs together.
constexpr std::string_view kOfCaptures[] = {"swapped",       "wrong_pose",          "contradicts",
                                            "same_picture",  "same_pose",           "unpaired",
                                            "joint_pairing", "target_often_missed", "repeated_image"};

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
    constexpr int kEnough = 6;
    for (DoctorPair& pair : of_camera) {
      const bool is_best = pairs.empty() || pairs.back().camera != c;
      if (is_best || pair.num_seen >= kEnough) pairs.push_back(std::move(pair));
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
  const RigProblem& rig = config.data.rig;
  const std::string camera = "cameras." + rig.cameras[pair.camera].name;
  const std::string target = "targets." + rig.targets[pair.target].name;
  const std::string& arm = config.arms[pair.robot].section;
  const std::string gripper = MountText(rig.robots, {pair.robot, Mount::Part::kGripper});
  std::vector<std::pair<std::string, std::string>> keys = {
      {"setup: eye_in_hand", camera + ".mount: " + gripper + ", " + target + ".mount: world"},
      {"setup: eye_to_hand", camera + ".mount: world, " + target + ".mount: " + gripper},
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

// Returns whether two pairs have the same symptom, with the same cure up to its figures.
bool AreOne(const Symptom& a, const Symptom& b) {
  return a.code == b.code && a.settings == b.settings && WithoutNumbers(a.cure) == WithoutNumbers(b.cure) &&
         !IsIn(kOfCaptures, a.code);
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

// The cures of faults that one camera has and others of the same arm, or of the same target, do not have: its images or
// its intrinsics are wrong, not the poses or the target. "CAMERA" stands for its section of the config.
struct CureOfCamera {
  std::string_view code;
  bool is_of_arm;  // Whether the others are those of the same arm, not those that see the same target.
  const char* cure;
};
constexpr CureOfCamera kCuresOfCameras[] = {
    {"pairing", true,
     "the images of the other cameras fit the poses, so correct those of this one (CAMERA.images), or name the image "
     "of "
     "each capture in a column image.NAME of the poses file"},
    {"target_scale", false,
     "the other cameras see the target in its size, so check the intrinsics of this one (CAMERA.intrinsics), or leave "
     "them out to have them estimated"},
    {"poses_unexplained", true,
     "the images of the other cameras fit the poses, so check those of this one (CAMERA.images), its mount "
     "(CAMERA.mount) and "
     "its intrinsics (CAMERA.intrinsics)"},
};

// Returns such a cure if it applies, otherwise an empty text.
std::string CureIfOfCamera(const RigConfig& config, const std::vector<DoctorPair>& pairs, const SharedSymptom& shared) {
  const auto of_camera = std::find_if(std::begin(kCuresOfCameras), std::end(kCuresOfCameras),
                                      [&](const auto& entry) { return shared.symptom.code.name() == entry.code; });
  if (of_camera == std::end(kCuresOfCameras)) return "";
  const DoctorPair& first = shared.pairs.front();
  const auto num_alike = std::count_if(pairs.begin(), pairs.end(), [&](const DoctorPair& pair) {
    return of_camera->is_of_arm ? pair.robot == first.robot : pair.target == first.target;
  });
  if (static_cast<size_t>(num_alike) == shared.pairs.size()) return "";
  return Replaced(of_camera->cure, {{"CAMERA", "cameras." + config.data.rig.cameras[first.camera].name}});
}

// Diagnoses a pair as a data set of one camera.
Diagnosis DiagnosePair(const RigConfig& config, const DoctorPair& pair, int num_threads, Verbosity verbosity) {
  std::vector<std::string> other_codes;
  for (size_t t = 0; t < config.data.targets.size(); ++t) {
    if (t == pair.target) continue;
    for (std::string& code : config.data.targets[t]->Codes()) other_codes.push_back(std::move(code));
  }
  return Diagnose(ConfigOf(config, pair), num_threads, verbosity, Examine::kInputs, other_codes);
}

std::vector<Symptom> SymptomsOfPairs(const RigConfig& config, const std::vector<DoctorPair>& pairs, int num_threads,
                                     Verbosity verbosity) {
  std::vector<SharedSymptom> shared;
  for (const DoctorPair& pair : pairs) {
    const Diagnosis diagnosis = DiagnosePair(config, pair, num_threads, verbosity);
    for (const Symptom& of_pair : diagnosis.symptoms) {
      if (IsIn(kNotOfPairs, of_pair.code)) continue;
      // Rows that are paired wrongly have gaps where the camera sees another target, so that some captures do not fit
      // the corrected rows.
      const bool is_certain = diagnosis.NumWrong() == 0 || of_pair.severity == Severity::kWrong;
      if (!is_certain && IsIn(kOfCaptures, of_pair.code)) continue;
      Symptom symptom = InRig(config, pair, of_pair);
      const auto known = std::find_if(shared.begin(), shared.end(),
                                      [&](const SharedSymptom& other) { return AreOne(other.symptom, symptom); });
      if (known == shared.end()) {
        shared.push_back({std::move(symptom), {pair}});
      } else {
        known->pairs.push_back(pair);
      }
    }
  }
  std::vector<Symptom> symptoms;
  for (SharedSymptom& entry : shared) {
    const std::string cure = CureIfOfCamera(config, pairs, entry);
    if (!cure.empty()) {
      entry.symptom.cure = cure;
      entry.symptom.settings.clear();
    }
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
std::vector<Symptom> SymptomsOfArms(const RigConfig& config, const std::vector<DoctorPair>& pairs, int num_threads) {
  std::vector<Symptom> symptoms;
  for (size_t r = 0; r < config.data.rig.robots.size(); ++r) {
    if (!config.data.arms[r]) continue;
    const bool is_recorded = AreJointsRecorded(config, r);
    std::optional<DoctorPair> best;
    for (const DoctorPair& pair : pairs) {
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
// time, because a mount is wrong, which adds the camera to `misplaced`; or once, because one of them was moved.
std::vector<Symptom> WrongMounts(const RigConfig& config, const std::vector<RigDetection>& detections,
                                 std::set<size_t>* misplaced) {
  const RigProblem& rig = config.data.rig;
  std::vector<Symptom> symptoms;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    for (size_t t = 0; t < rig.targets.size(); ++t) {
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
        misplaced->insert(c);
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

// Reports what the adjustment of the whole rig finds.
std::vector<Symptom> SymptomsOfRig(const RigConfig& config, const std::vector<DetectFunction>& detect,
                                   int num_threads) {
  RigRunOptions options = config.options;
  options.num_threads = num_threads;
  options.detect = detect;
  const Outcome<RigRunOutput> run = RunRig(config.data, options);
  if (!run) return {{Severity::kWrong, "no_result", run.reason(), ""}};
  std::vector<Symptom> symptoms;
  for (const Finding& finding : run->result.verdict.findings) {
    if (finding.grade == Grade::kGood) continue;
    symptoms.push_back(SymptomOf(finding));
  }
  return symptoms;
}

}  // namespace

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
  std::set<size_t> misplaced;
  for (Symptom& symptom : WrongMounts(config, detections, &misplaced)) {
    diagnosis.symptoms.push_back(std::move(symptom));
  }
  // Whatever else is wrong with a camera may be due to its mount.
  std::vector<DoctorPair> pairs = PairsOf(config, detections);
  std::erase_if(pairs, [&](const DoctorPair& pair) { return misplaced.contains(pair.camera); });
  for (Symptom& symptom : SymptomsOfPairs(config, pairs, num_threads, verbosity)) {
    diagnosis.symptoms.push_back(std::move(symptom));
  }
  // Poses that are read wrongly are those of no arm.
  if (diagnosis.NumWrong() == 0) {
    for (Symptom& symptom : SymptomsOfArms(config, pairs, num_threads)) {
      diagnosis.symptoms.push_back(std::move(symptom));
    }
  }
  for (Symptom& symptom : Unpaired(config.data.left_out)) diagnosis.symptoms.push_back(std::move(symptom));
  if (diagnosis.NumWrong() == 0 && examine == Examine::kInputsAndResult) {
    for (Symptom& symptom : SymptomsOfRig(config, detect, num_threads)) {
      diagnosis.symptoms.push_back(std::move(symptom));
    }
  }
  SortBySeverity(&diagnosis);
  return diagnosis;
}

}  // namespace heba
