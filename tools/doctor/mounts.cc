#include "tools/doctor/mounts.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "heba/base/median.h"
#include "heba/base/text.h"

namespace heba {
namespace {

// Pairs that fit the poses of another arm than that of their mounts.
class PairsOfOtherArms {
 public:
  PairsOfOtherArms(const RunConfig& config, const std::vector<DiagnosedPair>& diagnosed)
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

  // Returns what they show: files of poses that are exchanged, or mounts that name the wrong arm.
  MountSymptoms Symptoms() const {
    MountSymptoms found;
    std::set<std::vector<size_t>> known_cycles;
    for (const PairOfOtherArm& pair : pairs_) {
      const size_t robot = pair.diagnosed->pair.robot;
      if (const std::vector<size_t> cycle = CycleOf(robot); !cycle.empty()) {
        if (known_cycles.insert(cycle).second) found.symptoms.push_back(ExchangedFiles(cycle, pair));
        continue;
      }
      const size_t c = pair.diagnosed->pair.camera;
      const bool is_camera = rig_.cameras[c].mount == Mount{robot, Mount::Part::kGripper};
      const bool is_new = is_camera ? found.misplaced.cameras.insert(c).second
                                    : found.misplaced.targets.insert(pair.diagnosed->pair.target).second;
      if (is_new) found.symptoms.push_back(WrongArm(is_camera, pair));
    }
    return found;
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

  const RunConfig& config_;
  const Problem& rig_;
  std::vector<PairOfOtherArm> pairs_;
  // For each arm with images that tell, the arm that has its poses; nothing if these are its own, or if the images
  // contradict each other.
  std::map<size_t, std::optional<size_t>> file_of_;
};

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

PointMotion MotionOfPoints(const std::vector<TargetDetection>& detections, size_t camera, size_t target) {
  PointMotion motion;
  std::vector<double> from_first_px;
  Pixels first;
  std::optional<std::pair<size_t, Pixels>> last;
  for (const TargetDetection& detection : detections) {
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

}  // namespace

MountSymptoms SymptomsOfOtherArms(const RunConfig& config, const std::vector<DiagnosedPair>& diagnosed) {
  return PairsOfOtherArms(config, diagnosed).Symptoms();
}

MountSymptoms WrongMounts(const RunConfig& config, const std::vector<TargetDetection>& detections,
                          const Misplaced& known) {
  const Problem& rig = config.data.rig;
  MountSymptoms found;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    for (size_t t = 0; t < rig.targets.size(); ++t) {
      if (known.Contains(c, t)) continue;
      if (MovesAgainst(rig.cameras[c].mount, rig.targets[t].mount)) continue;
      const PointMotion motion = MotionOfPoints(detections, c, t);
      const std::string& camera = rig.cameras[c].name;
      const std::string& target = rig.targets[t].name;
      if (const std::optional<PointMotion::Step> step = StepBetweenPlaces(motion)) {
        found.symptoms.push_back(
            {Severity::kWrong, "camera_moved",
             "camera " + camera + " (" + MountText(rig, rig.cameras[c]) + ") or target " + target + " (" +
                 MountText(rig, rig.targets[t]) + ") was moved between the captures " +
                 config.data.captures[step->from].name + " and " + config.data.captures[step->to].name +
                 ": the points of the target stay at their pixels before and after, but move by " +
                 Significant(step->distance_px, 2) + " px between these two",
             "fix the mount of the camera or of the target and record all captures again, or calibrate "
             "from the captures after the motion only (captures.exclude)"});
      } else if (KeepsMoving(motion)) {
        found.misplaced.cameras.insert(c);
        found.symptoms.push_back(
            {Severity::kWrong, "mount",
             "camera " + camera + " (" + MountText(rig, rig.cameras[c]) + ") and target " + target + " (" +
                 MountText(rig, rig.targets[t]) +
                 ") cannot move against each other with these mounts, but the points of the target "
                 "move by " +
                 Significant(motion.median_px, 2) + " px between the images",
             "correct cameras." + camera + ".mount or targets." + target +
                 ".mount: one of them is on the gripper of an arm"});
      }
    }
  }
  return found;
}

}  // namespace heba
