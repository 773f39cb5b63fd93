// Checks whether the robot's poses mean what the config says, and whether they belong to these images. Every other
// meaning of the same numbers and every likely shift of the rows is compared with the images; one that explains them
// decidedly better is reported.
//
// Between two captures, the robot's motion and the camera's motion have the same rotation angle and the same
// translation along the rotation axis: this distinguishes angle conventions and units. Both are also the same for
// poses and their inverses, which only a solve can distinguish (solvers/initial/pose_consistency.h). Eye-to-hand with
// poses is equivalent to eye-in-hand with their inverses; no data can distinguish these two.
#include <algorithm>
#include <cmath>
#include <limits>

#include "heba/base/even_indices.h"
#include "heba/base/median.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "solvers/closed_form/motion_analysis.h"
#include "tools/config/capture_section.h"
#include "tools/doctor/examination.h"
#include "tools/doctor/symptom.h"
#include "tools/run/captures.h"
#include "tools/text/failure_text.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {

// The limits of the comparison of readings. Misfits are those of PoseConsistency.
struct ReadingLimits {
  double better = 2.5;       // A reading whose misfit is smaller by this factor is another one, not chance or noise.
  double alike = 1.5;        // Readings within this factor are equally good.
  double good_share = 1e-3;  // Poses that fit to this share of the working distance are read correctly.
  double poor_share = 0.1;   // A reading that leaves so much of it explains nothing, however bad the others are.
  // A remaining scale of the positions is reported beyond `scale`, as a ratio, and beyond so many of its sigmas, if it
  // reduces the misfit of the positions to less than `scale_gain`. Prints and intrinsics are rarely wrong by less.
  double scale = 0.04;
  double scale_sigmas = 5;
  double scale_gain = 0.87;
  // Scales outside of this range belong to a unit, or to the fit of unrelated data.
  double min_scale = 0.2;
  double max_scale = 5;
  // RMS rotations that the images show, deg: below the first, any reading fits; beyond the second, a second axis is
  // clear.
  double no_rotation_deg = 1;
  double clear_rotation_deg = 6;
  double unrecorded_ratio = 3;  // Images that show so many times the rotation of the poses show one that these lack.
};
constexpr ReadingLimits kLimits;

// The weights of the mistakes that lead from a reading to the config's: of readings that fit equally well, the one with
// the smallest sum is reported. A wrong name, unit or direction is the likeliest mistake.
struct MistakeWeights {
  double name = 1;
  double unit = 1;
  double inverse = 1;
  double inverse_rotation = 2;
  double scale = 1.2;
  double other_arm = 1.3;
  double other_order = 1.5;
  double shift = 1.4;  // Rows that are shifted; each row adds shift_per_row.
  double shift_per_row = 0.1;
  double part = 0.3;  // Rows that are shifted from one on.
};
constexpr MistakeWeights kMistakes;

enum class Direction { kAsRead, kInverse, kInverseRotation };

// One way to read the poses file.
struct Reading {
  PoseFormat format;
  Direction direction = Direction::kAsRead;
  std::string pairing;                         // The fault of the rows, as a clause; empty if there is none.
  std::string arm;                             // The other arm whose poses these are; empty if there is none.
  std::vector<std::optional<Rigid3d>> mounts;  // Per view; not set if the pairing has none.
  double oddness = 0;  // Weighted number of mistakes that lead from this reading to the config's.
  RobotScale scale = RobotScale::kOne;
};

struct JudgedReading {
  Reading reading;
  PoseConsistency consistency;
  std::string unit;               // Unit of the positions that explains the scale.
  std::string target_unit = "m";  // That of given poses of the target.
  double oddness = 0;
  bool has_other_scale = false;  // Beyond the unit, and significantly.
};

constexpr std::string_view kUnits[] = {"m", "cm", "mm", "in"};

double MetresOf(std::string_view unit) { return ParseQuantity("1 " + std::string(unit), Quantity::kLength).value; }

// Returns the unit of positions that explains the scale, if one does; the remaining scale is that of the target.
std::string UnitFor(const PoseFormat& format, const PoseConsistency& consistency) {
  if (!format.robot.empty()) return format.translation_unit;
  constexpr double kNear = 0.08;
  for (const std::string_view unit : kUnits) {
    const double ratio = MetresOf(unit) / MetresOf(format.translation_unit);
    if (std::abs(consistency.robot_scale / ratio - 1) < kNear) return std::string(unit);
  }
  return format.translation_unit;
}

// Returns whether a target that was measured wrongly may have this scale. Any other scale is due to a unit, or to a
// fit of unrelated data.
bool IsPlausibleScale(double scale) { return scale > kLimits.min_scale && scale < kLimits.max_scale; }

// Returns the unit of given poses of the target that explains a scale between the robot's positions and theirs; "m" if
// none does.
std::string TargetUnitFor(double scale) {
  constexpr double kNear = 0.08;
  for (const std::string_view unit : kUnits) {
    if (std::abs(scale * MetresOf(unit) - 1) < kNear) return std::string(unit);
  }
  return "m";
}

// Returns the scale that the units do not explain.
double RestScale(const JudgedReading& judged) {
  return judged.consistency.robot_scale * MetresOf(judged.reading.format.translation_unit) / MetresOf(judged.unit) *
         MetresOf(judged.target_unit);
}

Rigid3d MountOf(const RunConfig& config, const Rigid3d& pose, Direction direction) {
  const Rigid3d read =
      direction == Direction::kInverseRotation ? Rigid3d(pose.rotation.conjugate(), pose.translation) : pose;
  const Rigid3d base_from_gripper = BaseFromGripper(config.arms.front().reading, read);
  return CameraMountFromTargetMount(SetupOf(config.data),
                                    direction == Direction::kInverse ? Inverse(base_from_gripper) : base_from_gripper);
}

std::vector<Reading> ReadingsOfNumbers(const Examination& examination) {
  const RunConfig& config = examination.config;
  const PoseFormat& now = config.arms.front().reading.format;
  std::vector<Reading> readings;
  for (const PoseFormat& format : FormatsOfSameColumns(now)) {
    for (const Direction direction : {Direction::kAsRead, Direction::kInverse, Direction::kInverseRotation}) {
      Reading reading;
      reading.format = format;
      reading.direction = direction;
      reading.scale = RobotScale::kFree;
      reading.oddness =
          (format.rotation != now.rotation || format.robot != now.robot ? kMistakes.name : 0) +
          (format.angle_unit != now.angle_unit && !now.angle_unit.empty() && !format.angle_unit.empty() ? kMistakes.unit
                                                                                                        : 0) +
          (direction == Direction::kInverse ? kMistakes.inverse : 0) +
          (direction == Direction::kInverseRotation ? kMistakes.inverse_rotation : 0);
      for (const ExaminedView& view : examination.views) {
        const Outcome<Rigid3d> pose = PoseFromNumbers(format, config.arms.front().numbers[view.capture]);
        if (!pose) break;
        reading.mounts.emplace_back(MountOf(config, *pose, direction));
      }
      if (reading.mounts.size() == examination.views.size()) readings.push_back(std::move(reading));
    }
  }
  return readings;
}

// The captures with the poses of the arm: those of the data set or, if it is a part of a rig, all of the rig.
struct Rows {
  std::vector<std::string> names;
  std::vector<Rigid3d> base_from_gripper;
  std::vector<size_t> place;  // For each capture of the data set, its row.
};

Rows RowsOf(const Examination& examination) {
  const CellContext& rig = examination.rig;
  if (!rig.captures.empty()) return {rig.captures, rig.base_from_gripper, rig.place};
  Rows rows;
  for (const Recording& capture : examination.config.data.captures) {
    rows.place.push_back(rows.names.size());
    rows.names.push_back(capture.name);
    rows.base_from_gripper.push_back(capture.base_from_gripper.front());
  }
  return rows;
}

// Pairs the capture of row i with the pose of row `other(i)`, if there is one.
template <class Other>
Reading Repaired(const Examination& examination, const Rows& rows, const std::string& pairing, double oddness,
                 const Other& other) {
  const RunConfig& config = examination.config;
  Reading reading;
  reading.format = config.arms.front().reading.format;
  reading.pairing = pairing;
  reading.oddness = oddness;
  for (const ExaminedView& view : examination.views) {
    const std::optional<size_t> from = other(rows.place[view.capture]);
    reading.mounts.push_back(
        from ? std::optional(CameraMountFromTargetMount(SetupOf(config.data), rows.base_from_gripper[*from]))
             : std::nullopt);
  }
  return reading;
}

// Returns, for each row in one order, its index in the other, for data in which names sorted as 1, 2, ..., 10 were
// paired with names sorted as 1, 10, ..., 2.
std::vector<size_t> PlaceInOtherOrder(const std::vector<std::string>& names, bool by_letters_first) {
  std::vector<size_t> by_letters(names.size());
  for (size_t i = 0; i < by_letters.size(); ++i) by_letters[i] = i;
  std::vector<size_t> by_number = by_letters;
  std::sort(by_letters.begin(), by_letters.end(), [&](size_t a, size_t b) { return names[a] < names[b]; });
  std::sort(by_number.begin(), by_number.end(), [&](size_t a, size_t b) { return NaturalLess(names[a], names[b]); });
  std::vector<size_t> place(names.size());
  for (size_t i = 0; i < place.size(); ++i) {
    if (by_letters_first) {
      place[by_letters[i]] = by_number[i];
    } else {
      place[by_number[i]] = by_letters[i];
    }
  }
  return place;
}

// Returns the distance at the target between its pose in a view and the one that a hand-eye calibration predicts there.
double MisfitM(const HandEye& hand_eye, const Rigid3d& mount, const ExaminedView& view, double distance_m) {
  const Rigid3d predicted = CameraFromTarget(hand_eye, mount);
  double least = std::numeric_limits<double>::infinity();
  for (const Rigid3d& seen : view.camera_from_target) {
    least = std::min(least, std::hypot(DistanceM(predicted, seen), distance_m * AngleRad(predicted, seen)));
  }
  return least;
}

// A part of fewer captures is as likely one of wrong poses.
constexpr std::ptrdiff_t kLeastPart = 3;

// Returns the reading in which the images belong to their poses up to a capture and, from there on, to those `step`
// rows away, at the capture for which this explains most; nothing if either part alone determines no hand-eye pose.
std::optional<Reading> ShiftedFromOn(const Examination& examination, const Rows& rows, std::ptrdiff_t step) {
  const RunConfig& config = examination.config;
  const std::vector<ExaminedView>& views = examination.views;
  const double distance_m = WorkingDistanceM(views);
  const auto num = static_cast<std::ptrdiff_t>(rows.names.size());
  const auto mount_of = [&](size_t v, std::ptrdiff_t by) -> std::optional<Rigid3d> {
    const std::ptrdiff_t j = static_cast<std::ptrdiff_t>(rows.place[views[v].capture]) + by;
    if (j < 0 || j >= num) return std::nullopt;
    return CameraMountFromTargetMount(SetupOf(config.data), rows.base_from_gripper[static_cast<size_t>(j)]);
  };
  std::optional<size_t> best_from;
  double least = std::numeric_limits<double>::infinity();
  // One half of the captures or the other is in one part alone.
  for (const bool is_first : {true, false}) {
    std::vector<PoseCandidates> half;
    const size_t middle = views.size() / 2;
    for (size_t v = is_first ? 0 : middle; v < (is_first ? middle : views.size()); ++v) {
      if (const std::optional<Rigid3d> mount = mount_of(v, is_first ? 0 : step)) {
        half.push_back({*mount, views[v].camera_from_target});
      }
    }
    const std::optional<PoseConsistency> known = FindPoseConsistency(half, RobotScale::kOne);
    if (!known) continue;
    // A misfit counts up to that of a capture that fits nothing.
    const double most_m = kPoorShare * distance_m;
    const auto cost = [&](size_t v, std::ptrdiff_t by) {
      const std::optional<Rigid3d> mount = mount_of(v, by);
      return mount ? std::min(most_m, MisfitM(known->hand_eye, *mount, views[v], distance_m)) : most_m;
    };
    double total = 0;
    for (size_t v = 0; v < views.size(); ++v) total += cost(v, step);
    for (size_t v = 0; v < views.size(); ++v) {
      // A row that is there twice fits in both parts: it belongs to the first.
      if (total <= least + 1e-9) {
        least = std::min(least, total);
        best_from = v;
      }
      total += cost(v, 0) - cost(v, step);
    }
  }
  const auto least_part = static_cast<size_t>(kLeastPart);
  if (!best_from || *best_from < least_part || views.size() - *best_from < least_part) return std::nullopt;
  const size_t from = rows.place[views[*best_from].capture];
  return Repaired(examination, rows, ShiftedFromOnText(rows.names[from], step),
                  kMistakes.shift + kMistakes.part + kMistakes.shift_per_row * static_cast<double>(std::abs(step)),
                  [&](size_t i) -> std::optional<size_t> {
                    const std::ptrdiff_t j = static_cast<std::ptrdiff_t>(i) + (i < from ? 0 : step);
                    return j < 0 || j >= num ? std::nullopt : std::optional(static_cast<size_t>(j));
                  });
}

std::vector<Reading> Pairings(const Examination& examination) {
  const Rows rows = RowsOf(examination);
  const auto num = static_cast<std::ptrdiff_t>(rows.names.size());
  std::vector<Reading> readings;
  for (const std::ptrdiff_t step : {1, -1, 2, -2, 3, -3}) {
    const std::string distance = std::to_string(std::abs(step)) + (std::abs(step) == 1 ? " row" : " rows");
    readings.push_back(Repaired(
        examination, rows, "each image belongs to the pose " + distance + (step > 0 ? " further down" : " further up"),
        kMistakes.shift + kMistakes.shift_per_row * static_cast<double>(std::abs(step)),
        [&](size_t i) -> std::optional<size_t> {
          const std::ptrdiff_t j = static_cast<std::ptrdiff_t>(i) + step;
          return j < 0 || j >= num ? std::nullopt : std::optional(static_cast<size_t>(j));
        }));
  }
  for (const std::ptrdiff_t step : {1, -1, 2, -2}) {
    if (std::optional<Reading> shifted = ShiftedFromOn(examination, rows, step)) {
      readings.push_back(std::move(*shifted));
    }
  }
  readings.push_back(Repaired(examination, rows, "the images are in the reverse order of the poses",
                              kMistakes.other_order,
                              [&](size_t i) { return std::optional(rows.names.size() - 1 - i); }));
  for (const bool by_letters_first : {true, false}) {
    const std::vector<size_t> place = PlaceInOtherOrder(rows.names, by_letters_first);
    readings.push_back(Repaired(examination, rows,
                                "images and poses were sorted differently (1, 10, 11, ..., 2 against 1, 2, "
                                "..., 10)",
                                kMistakes.other_order, [&](size_t i) { return std::optional(place[i]); }));
  }
  return readings;
}

// Takes the poses of the other arms of a rig for those of this one.
std::vector<Reading> OtherArms(const Examination& examination) {
  const RunConfig& config = examination.config;
  std::vector<Reading> readings;
  for (const CellContext::OtherArm& arm : examination.rig.other_arms) {
    Reading& reading = readings.emplace_back();
    reading.format = config.arms.front().reading.format;
    reading.arm = arm.name;
    reading.oddness = kMistakes.other_arm;
    for (const ExaminedView& view : examination.views) {
      reading.mounts.emplace_back(
          CameraMountFromTargetMount(SetupOf(config.data), arm.base_from_gripper[examination.rig.place[view.capture]]));
    }
  }
  return readings;
}

// The sigma of a fit's scale, relative to it.
double RelativeScaleSigma(const PoseConsistency& fit) { return fit.robot_scale_stddev / std::abs(fit.robot_scale); }

std::optional<JudgedReading> Judge(const Examination& examination, const Reading& reading) {
  // This number is enough to distinguish readings.
  constexpr size_t kMostViews = 40;
  std::vector<PoseCandidates> captures;
  for (size_t i = 0; i < reading.mounts.size(); ++i) {
    if (reading.mounts[i]) captures.push_back({*reading.mounts[i], examination.views[i].camera_from_target});
  }
  std::vector<PoseCandidates> some;
  for (const size_t i : EvenIndices(captures.size(), kMostViews)) some.push_back(captures[i]);
  std::optional<PoseConsistency> consistency = FindPoseConsistency(some, reading.scale);
  if (!consistency) return std::nullopt;
  JudgedReading judged{reading, std::move(*consistency), reading.format.translation_unit, "m", reading.oddness};
  if (reading.scale == RobotScale::kFree) {
    judged.unit = UnitFor(reading.format, judged.consistency);
    if (!examination.config.data.target_poses.empty() && !IsPlausibleScale(RestScale(judged))) {
      judged.target_unit = TargetUnitFor(RestScale(judged));
      if (judged.target_unit != "m") judged.oddness += kMistakes.unit;
    }
    // A scale that the motion does not determine is not reported.
    constexpr double kSameScale = 0.02;
    constexpr double kSigmas = 5;
    judged.has_other_scale =
        std::abs(RestScale(judged) - 1) > std::max(kSameScale, kSigmas * RelativeScaleSigma(judged.consistency));
    if (judged.has_other_scale && !IsPlausibleScale(RestScale(judged))) return std::nullopt;
    if (judged.unit != reading.format.translation_unit) judged.oddness += kMistakes.unit;
    if (judged.has_other_scale) judged.oddness += kMistakes.scale;
  }
  return judged;
}

std::string RotationText(const PoseFormat& format) {
  if (!format.robot.empty()) return "joints of " + format.robot + " in " + format.angle_unit;
  return format.rotation + (format.angle_unit.empty() ? "" : " in " + format.angle_unit);
}

// Describes both explanations of poses that are the inverse of what the config says.
std::string EitherSetUp(const RunConfig& config) {
  const Setup other = SetupOf(config.data) == Setup::kEyeToHand ? Setup::kEyeInHand : Setup::kEyeToHand;
  const auto where = [](Setup setup) {
    return setup == Setup::kEyeToHand ? "if the camera is fixed beside the robot" : "if the robot carries the camera";
  };
  return std::string(where(SetupOf(config.data))) + ", set captures.poses_are: " +
         (config.arms.front().reading.is_base_from_gripper ? "gripper_from_base" : "base_from_gripper") + "; " +
         where(other) + ", set setup: " + std::string(SetupName(other)) +
         "; the data cannot distinguish these two, but you can see which one applies";
}

// What is wrong with the config's reading of the poses, and the changes that correct it.
struct Fault {
  SymptomCode code;
  std::string what;
  std::vector<std::string> cures = {};
};

// Returns the settings that give the rotations, angles and positions of the best reading; none if the config has them.
std::vector<ConfigSetting> SettingsOf(const JudgedReading& best, const PoseFormat& format_now) {
  PoseFormat format = best.reading.format;
  format.translation_unit = best.unit;
  if (format.rotation == format_now.rotation && format.robot == format_now.robot &&
      format.angle_unit == format_now.angle_unit && format.translation_unit == format_now.translation_unit) {
    return {};
  }
  if (format.robot.empty()) return {{"captures.pose_format", PoseFormatText(format)}};
  return {{"captures.robot", format.robot}, {"captures.joint_angles", format.angle_unit}};
}

// Returns the faults of the config's rotations or angles, and of its unit of positions.
std::vector<Fault> FormatFaults(const JudgedReading& best, const PoseFormat& format_now,
                                const std::vector<std::string>& alike) {
  const PoseFormat& format = best.reading.format;
  std::vector<Fault> faults;
  if (format.rotation != format_now.rotation || format.robot != format_now.robot) {
    faults.push_back(
        {"rotation_format",
         "the rotations are " + RotationText(format) + ", not " + RotationText(format_now) +
             (alike.empty() ? "" : " (or " + Join(alike, ", or ") + ": these captures cannot distinguish them)")});
  } else if (format.angle_unit != format_now.angle_unit) {
    faults.push_back({"angle_unit", "the angles are in " + format.angle_unit + ", not in " + format_now.angle_unit});
  }
  if (best.unit != format_now.translation_unit) {
    faults.push_back({"pose_units", "the positions are in " + best.unit + ", not in " + format_now.translation_unit});
  }
  return faults;
}

Fault TargetUnitFault(const RunConfig& config, const std::string& target_unit) {
  return {"pose_units",
          "the positions of the target are in " + target_unit + ", not in m",
          {"set captures.target_poses: {file: " + config.data.detections_source +
           ", pose_format: {columns: [x, y, z, qx, qy, qz, qw], translation: " + target_unit +
           ", rotation: quaternion_xyzw}}"}};
}

Fault InverseFault(const Examination& examination, const JudgedReading& best) {
  const RunConfig& config = examination.config;
  const bool has_target_poses = !config.data.target_poses.empty();
  Fault fault{"pose_direction", has_target_poses
                                    ? "the poses of the robot, or those of the target, are the inverse of what the "
                                      "config says"
                                    : "the poses are the inverse of what the config says"};
  // In a rig, the other cameras and targets help to tell.
  if (!examination.rig.captures.empty()) return fault;
  // With poses alone, both readings fit: what one calls the camera's pose is the target's in the other.
  if (has_target_poses) {
    fault.cures.push_back("if those of the target are, set captures.target_poses: {file: " +
                          config.data.detections_source + ", poses_are: target_from_camera}, which gives " +
                          HandEyeText(SetupOf(config.data), best.consistency.hand_eye.target_mount_from_target));
  }
  fault.cures.push_back((has_target_poses ? "if those of the robot are: " : "") + EitherSetUp(config));
  return fault;
}

Fault InverseRotationFault() {
  return {"rotation_inverse",
          "the rotations (not the positions) are the inverse of what they should be: transposed matrices or "
          "conjugate quaternions",
          {"transpose the matrices (or change the signs of the quaternions' x, y, z) in the poses file"}};
}

// Explains the spacing of an asymmetric circle grid if the target is half or twice as large as its config says, or by
// the root of 2: makers and programs mean different distances by it.
std::string SpacingConventions(const std::string& target_used, double ratio) {
  const YAML::Node target = YAML::Load(target_used);
  if (!target.IsMap() || !target["asymmetric"] || target["asymmetric"].Scalar() != "true") return "";
  const double root = std::sqrt(2.0);
  constexpr double kAlike = 0.06;
  for (const double convention : {0.5, 1 / root, root, 2.0}) {
    if (std::abs(ratio / convention - 1) > kAlike) continue;
    return "; the spacing of an asymmetric grid is the distance between neighbouring rows, half of that between the "
           "dots "
           "of one row, and not that between nearest dots, which is the root of 2 larger";
  }
  return "";
}

// Returns the fault of a target whose lengths in the config are `scale` times those by the robot. The sigma is
// relative.
Fault ScaleFault(const RunConfig& config, double scale, double relative_sigma) {
  return {"target_scale",
          "the target is " + Significant(1 / scale, 4) + " times as large as the config says (+- " +
              Significant(relative_sigma / scale, 1) + ", one sigma)",
          {"measure the target and multiply its lengths in the config by about " + Significant(1 / scale, 4) +
           " (or, if it is right, the focal length is wrong by this factor)" +
           SpacingConventions(config.targets_used.front(), 1 / scale)}};
}

// Returns all faults of the config's reading, with their cures; `settings` are SettingsOf the best one.
std::vector<Fault> FaultsOfNumbers(const Examination& examination, const JudgedReading& best,
                                   const std::vector<std::string>& alike, const std::vector<ConfigSetting>& settings) {
  const RunConfig& config = examination.config;
  std::vector<Fault> faults = FormatFaults(best, config.arms.front().reading.format, alike);
  if (best.target_unit != "m") faults.push_back(TargetUnitFault(config, best.target_unit));
  // One change cures all faults of the format.
  if (!settings.empty()) faults.back().cures.push_back("set " + SettingsText(settings));
  if (best.reading.direction == Direction::kInverse) faults.push_back(InverseFault(examination, best));
  if (best.reading.direction == Direction::kInverseRotation) faults.push_back(InverseRotationFault());
  const double rest = RestScale(best);
  if (best.has_other_scale && std::abs(rest - 1) > kLimits.scale) {
    faults.push_back(ScaleFault(config, rest, RelativeScaleSigma(best.consistency)));
  }
  return faults;
}

// Describes the best reading as one of other numbers. Returns nothing if it differs from the config's only by an
// insignificant scale. `evidence` compares the two.
std::optional<Symptom> DescribeNumbers(const Examination& examination, const JudgedReading& best,
                                       const std::vector<std::string>& alike, const std::string& evidence) {
  const RunConfig& config = examination.config;
  const std::vector<ConfigSetting> settings = SettingsOf(best, config.arms.front().reading.format);
  const std::vector<Fault> faults = FaultsOfNumbers(examination, best, alike, settings);
  if (faults.empty()) return std::nullopt;
  std::vector<std::string> what;
  std::vector<std::string> cures;
  for (const Fault& fault : faults) {
    what.push_back(fault.what);
    cures.insert(cures.end(), fault.cures.begin(), fault.cures.end());
  }
  if (config.imported && config.arms.front().file.empty()) {
    cures.emplace_back(
        "the poses of a data set have a fixed format: convert it to heba's files first (heba import), "
        "and change it there");
  }
  Symptom symptom{Severity::kWrong, faults.front().code, Join(what, "; "), Join(cures, "; ")};
  // Settings that are only a part of the cure would look like all of it.
  if (cures.size() <= 1) symptom.settings = settings;
  symptom.evidence = evidence;
  if (best.reading.direction == Direction::kInverse) {
    if (examination.rig.captures.empty()) {
      symptom.evidence +=
          "; base_from_camera, if the camera is fixed, or gripper_from_camera, if the robot carries it, is " +
          PoseText(best.consistency.hand_eye.camera_mount_from_camera);
    } else {
      symptom.reading = kInversePoses;
    }
  }
  return symptom;
}

// Describes the best reading. Returns nothing if it differs from the config's only by an insignificant scale. `alike`
// are the rotations that these captures cannot distinguish from it.
std::optional<Symptom> Describe(const Examination& examination, const JudgedReading& best, const PoseConsistency& now,
                                const std::vector<std::string>& alike) {
  const Reading& reading = best.reading;
  const std::string difference = ", robot and images differ by " + MisfitText(best.consistency) +
                                 ", with the config's by " + MisfitText(now) + " (7 of 10 captures by less)";
  const std::string evidence = "with this reading" + difference;
  if (!reading.arm.empty()) {
    Symptom symptom{Severity::kWrong, "other_arm",
                    "the poses of arm " + reading.arm + " fit the images, those of the config's arm do not", ""};
    symptom.evidence = "with the poses of arm " + reading.arm + difference;
    symptom.reading = reading.arm;
    return symptom;
  }
  if (!reading.pairing.empty()) {
    Symptom symptom{Severity::kWrong, "pairing", "images and poses are paired wrongly: " + reading.pairing,
                    "correct the rows of the poses file, and name the image of each in a column image"};
    symptom.evidence = evidence;
    symptom.reading = reading.pairing;
    return symptom;
  }
  return DescribeNumbers(examination, best, alike, evidence);
}

// Returns the views with the poses by another reading.
std::vector<ExaminedView> ViewsByReading(const JudgedReading& best, const Examination& examination) {
  std::vector<ExaminedView> views;
  for (size_t i = 0; i < examination.views.size(); ++i) {
    if (!best.reading.mounts[i]) continue;
    ExaminedView view = examination.views[i];
    for (Rigid3d& seen : view.camera_from_target) seen.translation *= MetresOf(best.target_unit);
    view.view.camera_mount_from_target_mount = *best.reading.mounts[i];
    view.view.camera_mount_from_target_mount.translation *=
        best.has_other_scale ? best.consistency.robot_scale * MetresOf(best.target_unit)
                             : MetresOf(best.unit) / MetresOf(best.reading.format.translation_unit);
    view.view.role = CaptureRole::kNone;
    views.push_back(std::move(view));
  }
  return views;
}

// Checks captures that are too few for a robust fit by what no hand-eye pose changes: between two captures, the gripper
// and the target turn by the same angle, and move by the same amount along the axis of that rotation.
std::vector<Symptom> CheckFewPoses(const std::vector<PoseCandidates>& captures) {
  constexpr double kMostApartDeg = 10;
  std::vector<double> apart_deg;
  double robot_deg = 0;
  double seen_deg = 0;
  for (size_t i = 0; i < captures.size(); ++i) {
    for (size_t k = i + 1; k < captures.size(); ++k) {
      const double robot =
          RadToDeg(AngleRad(captures[i].camera_mount_from_target_mount, captures[k].camera_mount_from_target_mount));
      double least = std::numeric_limits<double>::infinity();
      double nearest = 0;
      for (const Rigid3d& a : captures[i].camera_from_target) {
        for (const Rigid3d& b : captures[k].camera_from_target) {
          const double seen = RadToDeg(AngleRad(a, b));
          if (std::abs(seen - robot) >= least) continue;
          least = std::abs(seen - robot);
          nearest = seen;
        }
      }
      if (apart_deg.empty() || least > *std::max_element(apart_deg.begin(), apart_deg.end())) {
        robot_deg = robot;
        seen_deg = nearest;
      }
      apart_deg.push_back(least);
    }
  }
  if (apart_deg.empty() || Median(apart_deg) < kMostApartDeg) return {};
  return {{Severity::kWrong, "poses_unexplained",
           "between two captures the robot turns by " + Significant(robot_deg, 3) + " deg, but the target by " +
               Significant(seen_deg, 3) + " deg as the camera sees it; both are the same for every hand-eye pose",
           "check that all poses belong to these images, and the meaning of their rotations"}};
}

// Returns the fit of the poses as the config reads them.
PoseFit FitAsRead(const Examination& examination, const PoseConsistency& now) {
  constexpr double kSamePlaceShare = 0.03;
  const double distance_m = WorkingDistanceM(examination.views);
  PoseFit fit{examination.config.arms.front().reading.format, now.typical_misfit_m, MisfitText(now),
              now.typical_misfit_m <= kPoorShare * distance_m};
  const Rigid3d& mount = now.hand_eye.camera_mount_from_camera;
  fit.is_of_camera = std::max(mount.translation.norm() / distance_m, RotationAngle(mount.rotation)) < kSamePlaceShare;
  return fit;
}

// Returns whether a reading is of the config's captures: neither other rows nor another arm.
bool IsOfNumbers(const Reading& reading) { return reading.pairing.empty() && reading.arm.empty(); }

// Returns whether a reading differs from the config's by the unit of the positions at most.
bool HasSameRotations(const Reading& reading, const PoseFormat& format_now) {
  return reading.direction == Direction::kAsRead && IsOfNumbers(reading) &&
         reading.format.rotation == format_now.rotation && reading.format.robot == format_now.robot &&
         reading.format.angle_unit == format_now.angle_unit;
}

// Returns all readings that determine a hand-eye pose, with their misfits. If the motion only determines a scale,
// `is_scale_only`, readings of other rotations are left out.
std::vector<JudgedReading> JudgeReadings(const Examination& examination, bool is_scale_only) {
  std::vector<JudgedReading> judged;
  for (const std::vector<Reading>& readings :
       {ReadingsOfNumbers(examination), Pairings(examination), OtherArms(examination)}) {
    for (const Reading& reading : readings) {
      if (is_scale_only && !HasSameRotations(reading, examination.config.arms.front().reading.format)) continue;
      if (std::optional<JudgedReading> one = Judge(examination, reading)) judged.push_back(std::move(*one));
    }
  }
  return judged;
}

// The reading that explains the images best, and the rotations of those that explain them as well.
struct BestReading {
  JudgedReading best;
  std::vector<std::string> alike;  // RotationText.
};

// Returns the most likely of the readings that explain the images decidedly better than the config's does; nothing if
// there is none.
std::optional<BestReading> FindBetterReading(const std::vector<JudgedReading>& judged, double misfit_now_m,
                                             double distance_m) {
  const auto misfit_m = [](const JudgedReading& one) { return one.consistency.typical_misfit_m; };
  double least_m = std::numeric_limits<double>::infinity();
  for (const JudgedReading& one : judged) least_m = std::min(least_m, misfit_m(one));
  if (!(kLimits.better * least_m < misfit_now_m && misfit_now_m > kLimits.good_share * distance_m)) {
    return std::nullopt;
  }
  if (least_m > kLimits.poor_share * distance_m) return std::nullopt;
  const double alike_m = std::max(kLimits.alike * least_m, 0.5 * kLimits.good_share * distance_m);
  // The typical misfit passes over three captures in ten. A reading that does not explain these is no better for being
  // simpler.
  const auto num_fitting = [&](const JudgedReading& one) {
    const std::vector<double>& misfits_m = one.consistency.misfit_m;
    return std::count_if(misfits_m.begin(), misfits_m.end(),
                         [&](double misfit) { return misfit <= kLimits.poor_share * distance_m; });
  };
  std::ptrdiff_t most_fitting = 0;
  for (const JudgedReading& one : judged) {
    if (misfit_m(one) <= alike_m) most_fitting = std::max(most_fitting, num_fitting(one));
  }
  const JudgedReading* best = nullptr;
  for (const JudgedReading& one : judged) {
    if (misfit_m(one) > alike_m || num_fitting(one) + kLeastPart <= most_fitting) continue;
    if (best == nullptr || std::pair(one.oddness, misfit_m(one)) < std::pair(best->oddness, misfit_m(*best))) {
      best = &one;
    }
  }
  BestReading result{*best, {}};
  for (const JudgedReading& one : judged) {
    const bool is_other = RotationText(one.reading.format) != RotationText(best->reading.format);
    if (misfit_m(one) <= alike_m && one.oddness == best->oddness && is_other && IsOfNumbers(one.reading)) {
      result.alike.push_back(RotationText(one.reading.format));
    }
  }
  return result;
}

// Returns the fit of the poses by another reading of the same numbers.
PoseFit FitByReading(const JudgedReading& judged, double distance_m) {
  const double misfit_m = judged.consistency.typical_misfit_m;
  PoseFit fit{judged.reading.format, misfit_m, MisfitText(judged.consistency), misfit_m <= kPoorShare * distance_m};
  fit.format.translation_unit = judged.unit;
  return fit;
}

// Returns whether a fit with a free scale of the positions shows a target of another size.
bool ShowsOtherSize(const PoseConsistency& scaled, const PoseConsistency& now, double distance_m) {
  // The scale is only reported if the poses fit otherwise: unrelated poses may result in any scale.
  const bool fits_scaled = IsPlausibleScale(scaled.robot_scale) && scaled.typical_misfit_m < kPoorShare * distance_m;
  return fits_scaled &&
         std::abs(scaled.robot_scale - 1) > std::max(kLimits.scale, kLimits.scale_sigmas * scaled.robot_scale_stddev) &&
         scaled.typical_translation_m < kLimits.scale_gain * now.typical_translation_m;
}

Symptom OtherSize(const RunConfig& config, const PoseConsistency& scaled, const PoseConsistency& now) {
  const Fault fault = ScaleFault(config, scaled.robot_scale, RelativeScaleSigma(scaled));
  Symptom symptom{Severity::kWrong, fault.code, fault.what, fault.cures.front()};
  symptom.evidence =
      "with this scale, robot and images differ by " + MisfitText(scaled) + ", without it by " + MisfitText(now);
  return symptom;
}

// Describes poses that no reading explains, by the motion that the images show and that of the poses.
Symptom Unexplained(const PoseConsistency& now, const MotionAnalysis& seen_motion, const MotionAnalysis& robot_motion) {
  const std::optional<Failure> why = WhyNotObservable(robot_motion);
  const double turns_deg = RadToDeg(robot_motion.rotation_rms_rad[0]);
  const double seen_turns_deg = RadToDeg(seen_motion.rotation_rms_rad[0]);
  if (why && seen_turns_deg > kLimits.unrecorded_ratio * turns_deg) {
    Symptom symptom{
        Severity::kWrong, "rotation_not_recorded",
        "the images show rotations of " + Significant(seen_turns_deg, 2) + " deg rms, but the robot's poses have " +
            (turns_deg < 0.01 ? std::string("one and the same rotation") : Significant(turns_deg, 2) + " deg"),
        "record the rotations of the poses with their positions: the poses file has none, or columns of "
        "another quantity"};
    symptom.evidence = "robot and images differ by " + MisfitText(now);
    return symptom;
  }
  Symptom symptom{Severity::kWrong, "poses_unexplained",
                  "robot and images differ by " + MisfitText(now) +
                      ", and no other reading of the poses file explains it" +
                      (!why ? "" : "; the images show rotations that the poses do not"),
                  "check that all poses belong to these images and to one frame on the arm, and that neither the "
                  "camera nor the target moved on its mount"};
  symptom.evidence = (why ? FailureText(*why) + "; " : "") + "7 of 10 captures differ by less";
  return symptom;
}

}  // namespace

Checked Check_poses(const Examination& examination) {
  const std::vector<PoseCandidates> captures = CandidatesOf(examination.views);
  const std::optional<PoseConsistency> now = FindPoseConsistency(captures, RobotScale::kOne);
  if (!now) return {CheckFewPoses(captures)};
  std::vector<Rigid3d> seen;
  std::vector<Rigid3d> robot;
  for (const PoseCandidates& capture : captures) {
    seen.push_back(capture.camera_from_target.front());
    robot.push_back(capture.camera_mount_from_target_mount);
  }
  const MotionAnalysis seen_motion = AnalyseMotion(seen);
  const MotionAnalysis robot_motion = AnalyseMotion(robot);
  // If the images themselves show no rotation, or rotations about one axis only, any reading of the rotations may fit
  // as well as another by chance.
  if (RadToDeg(seen_motion.rotation_rms_rad[0]) < kLimits.no_rotation_deg) return {};
  const bool is_scale_only = WhyNotObservable(seen_motion).has_value();
  // If the robot rotated about one axis only, the images do not determine an estimated camera: its focal length, and
  // thus every scale and small rotation that the images show, is arbitrary.
  const bool has_clear_turns = RadToDeg(seen_motion.rotation_rms_rad[1]) > kLimits.clear_rotation_deg;
  if (!examination.config.data.has_camera.front() && !has_clear_turns && WhyNotObservable(robot_motion)) return {};
  Checked checked;
  checked.pose_fit = FitAsRead(examination, *now);

  const double distance_m = WorkingDistanceM(examination.views);
  const std::optional<BestReading> better =
      FindBetterReading(JudgeReadings(examination, is_scale_only), now->typical_misfit_m, distance_m);
  if (better) {
    if (const std::optional<Symptom> symptom = Describe(examination, better->best, *now, better->alike)) {
      const Reading& reading = better->best.reading;
      if (reading.direction == Direction::kAsRead && IsOfNumbers(reading)) {
        checked.pose_fit = FitByReading(better->best, distance_m);
      }
      checked.views = ViewsByReading(better->best, examination);
      checked.symptoms = {*symptom};
      return checked;
    }
  }

  const std::optional<PoseConsistency> scaled = FindPoseConsistency(captures, RobotScale::kFree);
  checked.pose_fit->tells_scale = scaled && kLimits.scale_sigmas * scaled->robot_scale_stddev < kLimits.scale;
  if (scaled && ShowsOtherSize(*scaled, *now, distance_m)) {
    checked.views = examination.views;
    for (ExaminedView& view : *checked.views) {
      view.view.camera_mount_from_target_mount.translation *= scaled->robot_scale;
    }
    checked.symptoms = {OtherSize(examination.config, *scaled, *now)};
  } else if (now->typical_misfit_m > kPoorShare * distance_m) {
    checked.symptoms = {Unexplained(*now, seen_motion, robot_motion)};
  }
  return checked;
}

}  // namespace heba
