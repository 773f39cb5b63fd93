#include "tools/doctor/cell_symptoms.h"

#include <algorithm>
#include <cctype>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "heba/base/text.h"

namespace heba {
namespace {

// Symptoms that are not those of a part of a rig: its mounts state the setup, and SymptomsOfOtherArms tells about arms.
constexpr std::string_view kNotOfPairs[] = {"either_set_up", "other_arm"};

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
         WithoutNumbers(known.cure) == WithoutNumbers(symptom.cure) && !IsOfSingleCaptures(symptom);
}

// The cameras that have a fault, and their keys.
class FaultyCameras {
 public:
  FaultyCameras(const RunConfig& config, const std::vector<DoctorPair>& pairs) : data_(config.data) {
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
  const Dataset& data_;
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
std::string CureIfOfCamera(const RunConfig& config, const std::vector<DiagnosedPair>& diagnosed,
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
std::vector<ConfigSetting> OtherMounts(const RunConfig& config, const std::vector<DoctorPair>& pairs) {
  const Problem& rig = config.data.rig;
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

// Returns the symptom with what to change if the poses of an arm are the inverse of what the config says: `poses_are`
// or, if other images fit the poses, the mounts. If all images of the arm are those of carried cameras, or all those of
// carried targets, both are possible.
Symptom WithCureOfDirection(const RunConfig& config, const std::vector<DiagnosedPair>& diagnosed,
                            const SharedSymptom& shared) {
  const Problem& rig = config.data.rig;
  const size_t robot = shared.pairs.front().robot;
  const Mount gripper{robot, Mount::Part::kGripper};
  std::set<bool> carries_camera;
  for (const DoctorPair& pair : shared.pairs) carries_camera.insert(rig.cameras[pair.camera].mount == gripper);
  std::set<std::string> others;
  for (const DiagnosedPair& other : diagnosed) {
    if (other.pair.robot == robot && FitsPoses(other)) others.insert(rig.cameras[other.pair.camera].name);
  }
  const PosesFileOfArm& arm = config.arms[robot];
  const ConfigSetting direction{arm.section + ".poses_are",
                                arm.reading.is_base_from_gripper ? "gripper_from_base" : "base_from_gripper"};
  const std::vector<ConfigSetting> mounts = OtherMounts(config, shared.pairs);
  Symptom symptom = shared.symptom;
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
  return symptom;
}

}  // namespace

std::vector<Symptom> SymptomsOfPairs(const RunConfig& config, const std::vector<DiagnosedPair>& diagnosed) {
  std::vector<SharedSymptom> shared;
  for (const DiagnosedPair& entry : diagnosed) {
    const DoctorPair& pair = entry.pair;
    const Diagnosis& diagnosis = entry.diagnosis;
    for (const Symptom& of_pair : diagnosis.symptoms) {
      if (IsIn(kNotOfPairs, of_pair.code)) continue;
      // A fault of all captures may cause those of single ones.
      const bool is_certain = diagnosis.NumWrong() == 0 || of_pair.severity == Severity::kWrong;
      if (!is_certain && IsOfSingleCaptures(of_pair)) continue;
      Symptom symptom = InLongForm(config, pair, of_pair);
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
    if (entry.symptom.reading == kInversePoses) entry.symptom = WithCureOfDirection(config, diagnosed, entry);
    std::set<std::string> cameras;
    for (const DoctorPair& pair : entry.pairs) cameras.insert(config.data.rig.cameras[pair.camera].name);
    entry.symptom.cameras.assign(cameras.begin(), cameras.end());
    entry.symptom.what = WhereText(config, entry.pairs) + ": " + entry.symptom.what;
    symptoms.push_back(std::move(entry.symptom));
  }
  return symptoms;
}

}  // namespace heba
