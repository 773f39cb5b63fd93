#include "tools/text/location_text.h"

#include <algorithm>
#include <cmath>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/target_location.h"
#include "tools/text/failure_text.h"
#include "tools/text/result_text.h"
#include "tools/text/target_symmetry.h"

namespace heba {
namespace {

std::string Listed(const Eigen::Vector3d& numbers) {
  return ShownAmount(numbers.x(), 2) + ", " + ShownAmount(numbers.y(), 2) + ", " + ShownAmount(numbers.z(), 2);
}

std::string SigmasMm(const Eigen::Matrix3d& covariance_m2) {
  return Listed(1000 * covariance_m2.diagonal().cwiseSqrt());
}

// Formats a covariance as "sx, sy, sz mm (calibration ...; image ...; robot ...)".
std::string SigmasText(const PositionCovariance& covariance) {
  return SigmasMm(covariance.TotalM2()) + " mm (calibration " + SigmasMm(covariance.by_calibration_m2) + "; image " +
         SigmasMm(covariance.by_image_m2) +
         (covariance.by_robot_m2.isZero() ? "" : "; robot " + SigmasMm(covariance.by_robot_m2)) + ")";
}

std::string DifferenceText(const Rigid3d& a, const Rigid3d& b) {
  return Significant(1000 * DistanceM(a, b), 3) + " mm and " + Significant(RadToDeg(AngleRad(a, b)), 3) + " deg";
}

// Returns " along the base's x, y, z".
std::string AlongWorld(const Problem& rig) { return " along the " + WorldName(rig) + "'s x, y, z"; }

// Returns " of the arm NAME"; empty if it has no name.
std::string OfArm(const Problem& rig, size_t robot) {
  return rig.robots[robot].empty() ? "" : " of the arm " + rig.robots[robot];
}

std::vector<std::string> NamesOf(const Problem& rig, const std::vector<size_t>& cameras) {
  std::vector<std::string> names;
  for (const size_t camera : cameras) names.push_back(rig.cameras[camera].name);
  return names;
}

// Returns a line for each arm with estimated errors that carries one of the cameras: how they corrected its pose, or
// why they did not.
std::string ArmPosesText(const LocationRequest& request) {
  const RunResult& result = *request.result;
  std::string text;
  for (size_t r = 0; r < request.arms.size(); ++r) {
    const RobotSummary* const arm = FindEstimatedArm(result, r);
    if (!request.arms[r].carries_camera || arm == nullptr) continue;
    const bool is_named = !result.rig.robots[r].empty();
    const std::string pose = "  the " + (is_named ? "pose" + OfArm(result.rig, r) : "robot's pose") + " was ";
    const std::string errors =
        is_named ? "its estimated errors" : "the estimated errors of the arm " + arm->nominal.name;
    const StatedPose& stated = request.arms[r].stated;
    if (stated.effect == nullptr) {
      text += pose + "not corrected by " + errors +
              ", whose uncertainty is missing in the sigmas: " + request.arms[r].why_not_corrected +
              "; --joints, the positions of the joints at that pose, would tell them\n";
      continue;
    }
    const Rigid3d corrected = Correct(result.rig, result.solution, r, stated).base_from_mount;
    text += pose + "corrected by " + errors + ", by " + DifferenceText(stated.base_from_mount, corrected) + "\n";
  }
  return text;
}

std::string InEachConfiguration(const std::string& of_arm, const TargetReach& reach) {
  if (!reach.reason.empty()) return "  no pose" + of_arm + " to command: " + reach.reason + "\n";
  if (!reach.has_each) return "";
  std::string text =
      "  poses" + of_arm + " to command in each configuration, with one sigma of the gripper against the target:\n";
  for (const ReachCommand& command : reach.in_each) {
    text += "    " + (command.configuration.empty() ? "" : command.configuration + ": ");
    if (!command.reason.empty()) {
      text += command.reason + "\n";
      continue;
    }
    text +=
        PoseText(command.base_from_gripper) + "; " + SigmasMm(command.covariance.TotalM2()) + " mm" +
        (command.is_extrapolated ? "; no capture is in this configuration, so that the arm's errors are extrapolated"
                                 : "") +
        "\n";
  }
  return text;
}

// Returns lines on the pose to command so that the gripper of an arm truly reaches the target.
std::string ReachText(const Problem& rig, const TargetReach& reach) {
  const std::string of_arm = OfArm(rig, reach.robot);
  std::string text;
  if (reach.command && !reach.command->reason.empty()) {
    text = "  no pose" + of_arm + " to command: " + reach.command->reason + "\n";
  } else if (reach.command) {
    const ReachCommand& command = *reach.command;
    text = "  pose" + of_arm + " to command so that the gripper truly reaches it, " +
           DifferenceText(command.base_from_gripper, reach.wanted) + " from it: base_from_gripper " +
           PoseText(command.base_from_gripper) + "\n  one sigma of the gripper against the target," + AlongWorld(rig) +
           ": " + SigmasText(command.covariance) + "\n";
    if (command.is_extrapolated) {
      text += "  the pose to command is not in the configuration of the captures (" + reach.captured_configuration +
              "), so that the arm's errors are extrapolated\n";
    }
  }
  return text + InEachConfiguration(of_arm, reach);
}

// `has_grasp`: whether the postures bring a tool to a grasp, instead of the flange to the target.
std::string PosturesText(const Problem& rig, const std::vector<ReachingPostures>& all, bool has_grasp = false) {
  const std::string what = has_grasp ? "the gripper's, with the tool at the grasp" : "the target's";
  std::string text;
  for (const ReachingPostures& postures : all) {
    const std::string& robot = rig.robots[postures.robot];
    text += "  " + (robot.empty() ? "" : "arm " + robot + ", ") + postures.arm.name + ": ";
    if (!postures.reason.empty()) {
      text += postures.reason + "\n";
      continue;
    }
    const std::vector<ArmJoint>& joints = postures.arm.arm.joints;
    const bool all_turn = std::all_of(joints.begin(), joints.end(), [](const ArmJoint& one) { return one.is_turning; });
    const size_t num_postures = postures.postures.size();
    text += std::to_string(num_postures) +
            (joints.size() > 6   ? " posture, of infinitely many, aligns"
             : num_postures == 1 ? " posture was found that aligns"
                                 : " postures were found that align") +
            (postures.arm.name.ends_with(".urdf") ? " the tip's frame with " : " the flange's frame with ") + what +
            "; " + Join(postures.arm.joint_names, ", ") + (all_turn ? " in deg:\n" : " in deg or m:\n");
    for (const ReachingPostures::Posture& posture : postures.postures) {
      text += "   ";
      for (size_t i = 0; i < joints.size(); ++i) {
        const double joint = posture.joints[static_cast<Eigen::Index>(i)];
        text += PadLeft(joints[i].is_turning ? Fixed(RadToDeg(joint), 3) : Fixed(joint, 5), 10);
      }
      text += (posture.singularity.empty() ? "" : "  (" + posture.singularity + ")") + "\n";
    }
  }
  return text;
}

// Returns ": [x, y, z] mm in the base; one sigma ...".
std::string PointText(const Problem& rig, const LocatedPoint& point) {
  const Eigen::Vector3d mm = 1000 * point.in_world;
  return ": [" + Fixed(mm.x(), 3) + ", " + Fixed(mm.y(), 3) + ", " + Fixed(mm.z(), 3) + "] mm in the " +
         WorldName(rig) + "; one sigma " + SigmasText(point.covariance);
}

std::string PixelsText(const LocationRequest& request, const ImageLocation& location) {
  const Problem& rig = request.result->rig;
  std::string text = (location.image.empty() ? "pixels" : location.image) + ":\n" + ArmPosesText(request);
  for (const PixelPosition& position : location.pixels) {
    const std::string& camera = rig.cameras[position.pixel.camera].name;
    const Eigen::Vector2d& pixel = position.pixel.pixel;
    text += "  pixel " + Significant(pixel.x(), 6) + ", " + Significant(pixel.y(), 6) +
            (camera.empty() ? "" : " of camera " + camera) + PointText(rig, position.point) + "\n" +
            PosturesText(rig, position.postures);
  }
  if (!location.point) return text;
  return text + "  point" + PointText(rig, *location.point) + "; the pixels are " +
         Significant(location.point->rms_px, 2) + " px from it (RMS)\n";
}

// Returns "2 possible poses, from which it is 144, 3.2 mm and 178, 3.1 deg away".
std::string NearnessText(const NearPoses& near) {
  std::vector<std::string> distances;
  std::vector<std::string> angles;
  for (const double distance_m : near.distances_m) distances.push_back(Significant(1000 * distance_m, 3));
  for (const double angle_rad : near.angles_rad) angles.push_back(Significant(RadToDeg(angle_rad), 3));
  return std::to_string(near.distances_m.size()) + " possible poses, from which it is " + Join(distances, ", ") +
         " mm and " + Join(angles, ", ") + " deg away";
}

// Returns why a rough pose does not decide between the poses that fit.
std::string NearFault(const NearPoses& near) {
  return "--near does not decide between the " + NearnessText(near) + "; it must be within " +
         Significant(1000 * kRoughPositionShare * near.least_distance_m, 2) + " mm of one of them, or within " +
         Significant(RadToDeg(kMaxRoughRotationRad), 2) + " deg and nearer to it than to the others by " +
         Significant(RadToDeg(kMinRotationGapRad), 2) + " deg";
}

// Returns lines on the sigmas of a target's centre and of its rotation.
std::string SigmaLines(const RunResult& result, const LocatedTarget& located) {
  return "  one sigma of its centre," + AlongWorld(result.rig) + ": " + SigmasText(located.covariance) +
         "\n  one sigma of its rotation about the same axes: " +
         Listed(RadToDeg(1) * SigmasOf(result.solution, located).total.rotation_rad) + " deg\n";
}

// Returns lines on the gripper with the tool at the grasp.
std::string GraspText(const LocationRequest& request, const LocatedTarget& located) {
  const Problem& rig = request.result->rig;
  const Eigen::Vector3d sigmas_mm =
      1000 * CovarianceOfPoint(located, request.target_from_grasp.translation).diagonal().cwiseSqrt();
  return "  " + WorldName(rig) + "_from_gripper with the tool at the grasp: " +
         PoseText(located.world_from_target * request.TargetFromGripper(), sigmas_mm.maxCoeff()) +
         "\n  one sigma of the grasp," + AlongWorld(rig) + ": " + Listed(sigmas_mm) + " mm\n";
}

// Describes the pose of a target, or all possible poses if none is chosen. `image`: the name of that of a single
// camera.
std::string TargetText(const LocationRequest& request, const std::string& image, const TargetLocation& location) {
  if (location.possible.empty()) return "";
  const RunResult& result = *request.result;
  const std::string& name = result.rig.targets[location.target].name;
  const std::string from_target = "  " + WorldName(result.rig) + "_from_target ";
  const LocatedTarget& first = location.possible.front().located;
  const size_t num_target_points = location.cameras.size() * request.targets[location.target]->points().size();
  std::string text =
      (name.empty() ? image : "target " + name + " in world, by " + Join(NamesOf(result.rig, location.cameras), ", ")) +
      ": " + std::to_string(location.num_points) + " of " + std::to_string(num_target_points) + " points, rms " +
      Significant(first.rms_px, 2) + " px";
  if (location.cameras.size() > 1) text += "; chance of their differences " + Significant(first.p_value, 2);
  if (location.chosen) {
    const PossiblePose& chosen = location.possible[*location.chosen];
    const double largest_sigma_mm = 1000 * std::sqrt(chosen.located.covariance.TotalM2().diagonal().maxCoeff());
    text += "\n" + from_target + PoseText(chosen.located.world_from_target, largest_sigma_mm) + "\n" +
            SigmaLines(result, chosen.located);
    if (location.possible.size() > 1) text += "  chosen by --near among the " + NearnessText(*location.near) + "\n";
    if (request.has_grasp) text += GraspText(request, chosen.located);
    for (const TargetReach& reach : location.reaches) text += ReachText(result.rig, reach);
    return text + PosturesText(result.rig, chosen.postures, request.has_grasp);
  }
  const size_t num_poses = location.possible.size();
  text += "; " + SymmetryText(num_poses) + "\n";
  for (size_t i = 0; i < num_poses; ++i) {
    const PossiblePose& pose = location.possible[i];
    text += "  possible pose " + std::to_string(i + 1) + " of " + std::to_string(num_poses) + ":" +
            from_target.substr(1) + PoseText(pose.located.world_from_target) + "\n" +
            PosturesText(result.rig, pose.postures);
  }
  return text + SigmaLines(result, first);
}

std::string ContradictionText(const Problem& rig, const TargetLocation& location) {
  const LocationContradiction& contradiction = *location.contradiction;
  const std::string difference = contradiction.difference ? DifferenceText(Rigid3d(), *contradiction.difference) : "";
  const std::string cause =
      "; the images or the poses of the arms are not those of one moment, or a camera has moved since the calibration";
  if (contradiction.camera) {
    return "camera " + rig.cameras[*contradiction.camera].name + " contradicts the others" +
           (difference.empty() ? "" : ", which see the target " + difference + " from where it does") + cause;
  }
  return "the cameras " + Join(NamesOf(rig, location.cameras), ", ") + " contradict each other" +
         (difference.empty() ? "" : ": they see the target " + difference + " apart") + cause;
}

// Returns why none of the poses that fit is chosen.
std::string UndecidedText(const LocationRequest& request, const TargetLocation& location) {
  if (location.near) return NearFault(*location.near);
  const Problem& rig = request.result->rig;
  const std::string num_poses = std::to_string(location.possible.size());
  return SymmetryText(location.possible.size()) + ", so " + num_poses + " poses fit " +
         (IsSingleCamera(rig) ? "an image" : "the images") + " equally well; " + request.near_form + ", a rough " +
         WorldName(rig) + "_from_target, decides between them";
}

}  // namespace

std::string WorldName(const Problem& rig) { return IsSingleCamera(rig) ? "base" : "world"; }

std::string LocationText(const LocationRequest& request, const ImageLocation& location) {
  if (!location.fault.empty()) return "";
  if (!request.pixels.empty()) return PixelsText(request, location);
  std::string text;
  std::string of_undetermined;
  for (const TargetLocation& target : location.targets) {
    text += TargetText(request, location.image, target);
    if (!target.undetermined.empty()) of_undetermined += TargetFault(request, target) + "\n";
  }
  if (!text.empty()) text += ArmPosesText(request);
  return location.IsLocated() ? text + of_undetermined : text;
}

std::string TargetFault(const LocationRequest& request, const TargetLocation& location) {
  if (location.chosen) return "";
  const Problem& rig = request.result->rig;
  const std::string& name = rig.targets[location.target].name;
  return (name.empty() ? "" : "target " + name + ": ") + (location.contradiction ? ContradictionText(rig, location)
                                                          : location.possible.empty()
                                                              ? FailureText(location.undetermined)
                                                              : UndecidedText(request, location));
}

std::vector<std::string> LocationFaults(const LocationRequest& request, const ImageLocation& location) {
  if (!location.fault.empty()) return {FailureText(location.fault)};
  std::vector<std::string> faults;
  if (!request.pixels.empty()) return faults;
  for (const TargetLocation& target : location.targets) {
    const bool is_beside_others = !target.undetermined.empty() && location.IsLocated();
    if (!target.chosen && !is_beside_others) faults.push_back(TargetFault(request, target));
  }
  return faults;
}

}  // namespace heba
