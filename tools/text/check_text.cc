#include "tools/text/check_text.h"

#include <cmath>
#include <vector>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "tools/text/failure_text.h"

namespace heba {
namespace {

// From this probability and ratio on, the points do not fit the target.
constexpr double kMisfitP = 1e-6;
constexpr double kMisfitRatio = 2;

// Returns whether no single change explains the images.
bool IsUnexplained(const SessionCheck& check) {
  return check.unexplained_p_value < kMisfitP && check.unexplained_ratio > kMisfitRatio;
}

std::string MillimetresText(double length_m) { return ShownAmount(1000 * length_m, 2) + " mm"; }
std::string DegreesText(double angle_rad) { return ShownAmount(RadToDeg(angle_rad), 2) + " deg"; }

// Returns the length of a part of a change, with its sigma along its own direction.
std::string LengthText(const SessionChange& change, Eigen::Index first, std::string (*shown)(double)) {
  const Eigen::Vector3d part = change.change.segment<3>(first);
  const Eigen::Matrix3d covariance = change.covariance.block<3, 3>(first, first);
  const double length = part.norm();
  const Eigen::Vector3d direction =
      length > 0 ? Eigen::Vector3d(part / length) : Eigen::Vector3d(Eigen::Vector3d::UnitX());
  return shown(length) + " (one sigma " + shown(std::sqrt(direction.dot(covariance * direction))) + ")";
}

std::string DirectionText(const Eigen::Vector3d& direction) {
  const Eigen::Vector3d unit = direction.normalized();
  return "[" + Fixed(unit.x(), 2) + ", " + Fixed(unit.y(), 2) + ", " + Fixed(unit.z(), 2) + "]";
}

std::string SizeText(const SessionChange& change) {
  if (change.part == ChangedPart::kLens) return "has changed";
  if (change.part == ChangedPart::kExchangedCamera) {
    return "is another one, or its lens was changed and it was moved";
  }
  if (change.part == ChangedPart::kExchangedTarget) {
    const double sign = change.change.sum() < 0 ? -1 : 1;
    const auto percent = [&](Eigen::Index i) {
      return Fixed(100 * sign * change.change[i], 1) + " % (one sigma " +
             ShownAmount(100 * std::sqrt(change.covariance(i, i)), 2) + " %)";
    };
    return std::string("is another one: its points are ") + (sign < 0 ? "nearer together" : "farther apart") + " by " +
           percent(0) + " along x and " + percent(1) + " along y";
  }
  return "has moved by " + LengthText(change, 0, &MillimetresText) + " along " +
         DirectionText(change.change.head<3>()) + " and " + LengthText(change, 3, &DegreesText) + " in its own frame";
}

}  // namespace

std::string_view DecisionOf(const SessionCheck& check) {
  return check.has_changed || IsMisfit(check) ? "moved" : "holds";
}

std::string_view SideOf(const Problem& rig, const SessionChange& change) {
  if (!IsMoved(change.part)) return "";
  if (change.part == ChangedPart::kBase) return "world";
  const Mount& mount =
      change.part == ChangedPart::kCamera ? rig.cameras[change.index].mount : rig.targets[change.index].mount;
  return mount.part == Mount::Part::kGripper ? "hand" : "world";
}

std::string PartText(const Problem& rig, const SessionChange& change) {
  if (change.part == ChangedPart::kTarget || change.part == ChangedPart::kExchangedTarget) {
    const std::string& name = rig.targets[change.index].name;
    return name.empty() ? "the target" : "target " + name;
  }
  if (change.part == ChangedPart::kBase) return "the base of arm " + rig.robots[change.index];
  const std::string& name = rig.cameras[change.index].name;
  const std::string camera = name.empty() ? "the camera" : "camera " + name;
  return change.part == ChangedPart::kLens ? "the lens of " + camera : camera;
}

bool IsToldFrom(const SessionChange& likely, const SessionChange& other) {
  constexpr double kLogRatio = 2;
  return 0.5 * (other.rank - likely.rank) > kLogRatio;
}

std::string ChangeText(const Problem& rig, const SessionCheck& check) {
  if (check.contradicting) {
    return rig.captures[*check.contradicting].name +
           " contradicts the other images, which agree with the calibration: its pose or the image is wrong, or "
           "something was moved for it alone";
  }
  if (IsUnexplained(check) && !IsMisfit(check)) {
    return "no change of one part explains the images, which differ " + Significant(check.unexplained_ratio, 2) +
           " times as much as the calibration allows: poses that belong to other images, poses in other units, or "
           "several parts that have moved";
  }
  if (IsMisfit(check) && IsMoved(check.changes.front().part)) {
    return "the points lie " + Significant(check.scatter_ratio, 2) +
           " times as far from where the target would be seen as in the calibration: the lens was refocused, the "
           "camera or the target is another one, or the target is bent";
  }
  const SessionChange& likely = check.changes.front();
  std::vector<std::string> others;
  for (size_t i = 1; i < check.changes.size(); ++i) {
    if (!IsToldFrom(likely, check.changes[i])) others.push_back(PartText(rig, check.changes[i]));
  }
  std::string text = PartText(rig, likely) + " " + SizeText(likely);
  const std::string_view side = SideOf(rig, likely);
  if (!side.empty()) text += ", on the " + std::string(side) + " side";
  if (!others.empty()) text += "; the images do not tell this from a change of " + Join(others, " or ");
  return text;
}

std::string UndecidedText(const Failure& failure) {
  if (failure.code != "hidden_point") return FailureText(failure);
  return "the robot's poses put the target out of the camera's view: they belong to other images, or are in other "
         "units than those of the calibration";
}

std::string CheckText(const Problem& rig, const SessionCheck& check) {
  const std::string images = std::to_string(check.num_images) + (check.num_images == 1 ? " image" : " images");
  std::string text = std::string(DecisionOf(check)) + ": ";
  if (DecisionOf(check) == "holds") {
    text += images + (check.num_images == 1 ? " agrees" : " agree") +
            " with the calibration (probability by chance: " + ShownPValue(check.p_value) + ")\n";
  } else {
    text += ChangeText(rig, check) +
            " (probability by chance: " + ShownPValue(IsMisfit(check) ? check.scatter_p_value : check.p_value) + ", " +
            images + ")\n";
  }
  for (const SessionChange& change : check.changes) {
    if (!change.seen_m || !change.seen_rad) continue;
    text += "smallest change that is seen in 95 %: " + PartText(rig, change) + " " + MillimetresText(*change.seen_m) +
            " or " + DegreesText(*change.seen_rad) + "\n";
  }
  return text;
}

}  // namespace heba
