#include "tools/text/location_text.h"

#include <cmath>
#include <vector>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "tools/text/result_text.h"
#include "tools/text/target_symmetry.h"

namespace heba {
namespace {

std::string SigmasMm(const Eigen::Matrix3d& covariance_m2) {
  std::vector<std::string> parts;
  for (int i = 0; i < 3; ++i) parts.push_back(Significant(1000 * std::sqrt(covariance_m2(i, i)), 2));
  return Join(parts, ", ");
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

// Returns a line on the correction of the pose that the robot states.
std::string CameraMountText(const LocationRequest& request) {
  if (request.robot == nullptr || request.result->setup == Setup::kEyeToHand) return "";
  const std::string& arm = request.robot->nominal.name;
  if (request.camera_mount.effect == nullptr) {
    return "  the robot's pose was not corrected by the estimated errors of the arm " + arm +
           ", whose uncertainty is missing in the sigmas: " + request.why_not_corrected +
           "; --joints, the positions of the joints at that pose, would tell them\n";
  }
  const Solution& solution = *FindRefined(*request.result)->solution;
  return "  the robot's pose was corrected by the estimated errors of the arm " + arm + ", by " +
         DifferenceText(request.camera_mount.base_from_mount, Correct(solution, request.camera_mount).base_from_mount) +
         "\n";
}

std::string InEachConfiguration(const Reach& reach) {
  if (!reach.has_each) return "";
  if (!reach.reason_of_each.empty()) return "  no pose to command: " + reach.reason_of_each + "\n";
  std::string text = "  poses to command in each configuration, with one sigma of the gripper against the target:\n";
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

// Returns lines on the pose to command so that the gripper truly reaches the target.
std::string ReachText(const Reach& reach) {
  std::string text;
  if (reach.command && !reach.command->reason.empty()) {
    text = "  no pose to command: " + reach.command->reason + "\n";
  } else if (reach.command) {
    const ReachCommand& command = *reach.command;
    text =
        "  pose to command so that the gripper truly reaches it, " +
        DifferenceText(command.base_from_gripper, reach.wanted) + " from it: base_from_gripper " +
        PoseText(command.base_from_gripper) +
        "\n  one sigma of the gripper against the target, along the base's x, y, z: " + SigmasText(command.covariance) +
        "\n";
    if (command.is_extrapolated) {
      text += "  the pose to command is not in the configuration of the captures (" + reach.captured_configuration +
              "), so that the arm's errors are extrapolated\n";
    }
  }
  return text + InEachConfiguration(reach);
}

std::string ReachTextOf(const LocationRequest& request, const ImageLocation& location) {
  if (request.robot == nullptr) return "";
  if (location.reach) return ReachText(*location.reach);
  return "  no pose to command: " + std::string(kNoCommandReason) + "\n";
}

std::string PosturesText(const std::optional<ReachingPostures>& postures) {
  if (!postures) return "";
  if (!postures->reason.empty()) return "  " + postures->arm + ": " + postures->reason + "\n";
  std::string text = "  " + postures->arm + ": " + std::to_string(postures->postures.size()) +
                     (postures->is_urdf ? " postures found that align the tip's frame with the target's; " +
                                              Join(postures->joint_names, ", ") + " in deg or m:\n"
                                        : " postures align the flange's frame with the target's; joints in deg:\n");
  for (const ReachingPostures::Posture& posture : postures->postures) {
    text += "   ";
    for (size_t i = 0; i < posture.joints.size(); ++i) {
      const double joint = posture.joints[i];
      text += PadLeft(postures->are_turning[i] ? Fixed(RadToDeg(joint), 3) : Fixed(joint, 5), 10);
    }
    text += (posture.singularity.empty() ? "" : "  (" + posture.singularity + ")") + "\n";
  }
  return text;
}

std::string PixelText(const PixelPosition& position) {
  const Eigen::Vector3d mm = 1000 * position.point.in_world;
  return "  pixel " + Significant(position.pixel.x(), 6) + ", " + Significant(position.pixel.y(), 6) + ": [" +
         Fixed(mm.x(), 3) + ", " + Fixed(mm.y(), 3) + ", " + Fixed(mm.z(), 3) + "] mm in the base; one sigma " +
         SigmasText(position.point.covariance) + "\n" + PosturesText(position.postures);
}

std::string SigmaLine(const LocatedTarget& located) {
  return "  one sigma of its centre, along the base's x, y, z: " + SigmasText(located.covariance) + "\n";
}

// Lists all poses that fit an image of a target with symmetries.
std::string PossibleText(const std::vector<PossiblePose>& possible) {
  std::string text;
  for (size_t i = 0; i < possible.size(); ++i) {
    text += "  possible pose " + std::to_string(i + 1) + " of " + std::to_string(possible.size()) +
            ": base_from_target " + PoseText(possible[i].located.world_from_target) + "\n" +
            PosturesText(possible[i].postures);
  }
  return text + SigmaLine(possible.front().located);
}

}  // namespace

std::string NearnessText(const NearPoses& near) {
  std::vector<std::string> distances;
  std::vector<std::string> angles;
  for (const double distance_m : near.distances_m) distances.push_back(Significant(1000 * distance_m, 3));
  for (const double angle_rad : near.angles_rad) angles.push_back(Significant(RadToDeg(angle_rad), 3));
  return std::to_string(near.distances_m.size()) + " possible poses, from which it is " + Join(distances, ", ") +
         " mm and " + Join(angles, ", ") + " deg away";
}

std::string NearFault(const NearPoses& near) {
  return "--near does not decide between the " + NearnessText(near) + "; it must be within " +
         Significant(1000 * kRoughPositionShare * near.least_distance_m, 2) + " mm of one of them, or within " +
         Significant(RadToDeg(kMaxRoughRotationRad), 2) + " deg and nearer to it than to the others by " +
         Significant(RadToDeg(kMinRotationGapRad), 2) + " deg";
}

std::string LocationText(const LocationRequest& request, const ImageLocation& location) {
  if (!location.fault.empty()) return "";
  if (!location.pixels.empty()) {
    std::string text = (location.image.empty() ? "pixels" : location.image) + ":\n" + CameraMountText(request);
    for (const PixelPosition& position : location.pixels) text += PixelText(position);
    return text;
  }
  const std::string fit = location.image + ": " + std::to_string(location.num_points) + " of " +
                          std::to_string(location.num_target_points) + " points, rms " +
                          Significant(location.possible.front().located.rms_px, 2) + " px";
  if (!location.chosen) {
    return fit + "; " + SymmetryText(*request.target) + "\n" + PossibleText(location.possible) +
           CameraMountText(request);
  }
  const PossiblePose& chosen = location.possible[*location.chosen];
  const double largest_sigma_mm = 1000 * std::sqrt(chosen.located.covariance.TotalM2().diagonal().maxCoeff());
  return fit + "\n  base_from_target " + PoseText(chosen.located.world_from_target, largest_sigma_mm) + "\n" +
         SigmaLine(chosen.located) + CameraMountText(request) +
         (location.possible.size() > 1 ? "  chosen by --near among the " + NearnessText(*location.near) + "\n" : "") +
         ReachTextOf(request, location) + PosturesText(chosen.postures);
}

std::string LocationFault(const ImageLocation& location) {
  if (!location.fault.empty() || location.IsLocated() || !location.near) return location.fault;
  return NearFault(*location.near);
}

}  // namespace heba
