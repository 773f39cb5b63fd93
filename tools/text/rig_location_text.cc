#include "tools/text/rig_location_text.h"

#include <cmath>
#include <vector>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "tools/text/location_text.h"
#include "tools/text/result_text.h"
#include "tools/text/target_symmetry.h"

namespace heba {
namespace {

std::string SigmasText(const Eigen::Matrix3d& covariance, double unit) {
  std::vector<std::string> sigmas;
  for (Eigen::Index i = 0; i < 3; ++i) sigmas.push_back(ShownAmount(unit * std::sqrt(covariance(i, i)), 2));
  return Join(sigmas, ", ");
}

std::string PoseText(const LocatedTarget& located) {
  const Eigen::Matrix<double, 6, 6> total = located.pose_covariance.Total();
  return heba::PoseText(located.world_from_target, 1000 * std::sqrt(total.topLeftCorner<3, 3>().diagonal().maxCoeff()),
                        std::sqrt(total.bottomRightCorner<3, 3>().diagonal().maxCoeff()));
}

std::vector<std::string> CameraNames(const RigProblem& rig, const RigTargetLocation& location) {
  std::vector<std::string> names;
  for (const size_t camera : location.cameras) names.push_back(rig.cameras[camera].name);
  return names;
}

std::string FigureLines(const LocatedTarget& located) {
  const Eigen::Matrix<double, 6, 6> total = located.pose_covariance.Total();
  return "  one sigma " + SigmasText(total.topLeftCorner<3, 3>(), 1000) + " mm; " +
         SigmasText(total.bottomRightCorner<3, 3>(), RadToDeg(1.0)) + " deg (target's x, y, z)\n  calibration " +
         SigmasText(located.pose_covariance.by_calibration.topLeftCorner<3, 3>(), 1000) + ", images " +
         SigmasText(located.pose_covariance.by_image.topLeftCorner<3, 3>(), 1000) + ", arm " +
         SigmasText(located.pose_covariance.by_robot.topLeftCorner<3, 3>(), 1000) + " mm; the points fit with " +
         Significant(located.rms_px, 2) + " px (RMS)\n";
}

std::string ContradictionText(const RigProblem& rig, const RigTargetLocation& location) {
  const RigContradiction& contradiction = *location.contradiction;
  std::string difference;
  if (contradiction.difference) {
    difference = Significant(1000 * contradiction.difference->translation.norm(), 3) + " mm and " +
                 Significant(RadToDeg(AngleRad(Rigid3d(), *contradiction.difference)), 3) + " deg";
  }
  const std::string cause =
      "; the images or the poses of the arms are not those of one moment, or a camera has moved since the calibration";
  if (contradiction.camera) {
    return "camera " + rig.cameras[*contradiction.camera].name + " contradicts the others" +
           (difference.empty() ? "" : ", which see the target " + difference + " from where it does") + cause;
  }
  return "the cameras " + Join(CameraNames(rig, location), ", ") + " contradict each other" +
         (difference.empty() ? "" : ": they see the target " + difference + " apart") + cause;
}

}  // namespace

std::string RigLocationText(const RigProblem& rig, const RigTargetLocation& location) {
  if (location.possible.empty()) return "";
  std::string text =
      "target " + rig.targets[location.target].name + " in world, by " + Join(CameraNames(rig, location), ", ");
  if (location.cameras.size() > 1) {
    text += "; chance of their differences " + Significant(location.possible.front().p_value, 2);
  }
  text += "\n";
  if (location.chosen) {
    const LocatedTarget& chosen = location.possible[*location.chosen];
    text += "  " + PoseText(chosen) + "\n" + FigureLines(chosen);
    if (location.near) text += "  chosen by --near among the " + NearnessText(*location.near) + "\n";
    return text;
  }
  const size_t num_poses = location.possible.size();
  for (size_t i = 0; i < num_poses; ++i) {
    text += "  possible pose " + std::to_string(i + 1) + " of " + std::to_string(num_poses) + ": " +
            PoseText(location.possible[i]) + "\n";
  }
  return text + FigureLines(location.possible.front());
}

std::string RigLocationFault(const RigProblem& rig, const RigTargetLocation& location) {
  if (location.chosen) return "";
  const std::string target = "target " + rig.targets[location.target].name + ": ";
  if (location.contradiction) return target + ContradictionText(rig, location);
  if (!location.undetermined.empty()) return target + location.undetermined;
  if (location.near) return target + NearFault(*location.near);
  const size_t num_poses = location.possible.size();
  return target + SymmetryText(num_poses) + ", so " + std::to_string(num_poses) + " poses fit the images equally well";
}

std::string RigPointText(const LocatedPoint& point) {
  constexpr double kMm = 1000;
  const double sigma_mm = kMm * std::sqrt(point.covariance.TotalM2().diagonal().maxCoeff());
  const auto shown = [&](double metres) { return Fixed(kMm * metres, DecimalsFor(sigma_mm, 6)); };
  const Eigen::Vector3d& at = point.in_world;
  return "point in world: [" + shown(at.x()) + ", " + shown(at.y()) + ", " + shown(at.z()) + "] mm, one sigma " +
         SigmasText(point.covariance.TotalM2(), kMm) + " mm along the world's x, y, z\n  calibration " +
         SigmasText(point.covariance.by_calibration_m2, kMm) + ", images " +
         SigmasText(point.covariance.by_image_m2, kMm) + ", arm " + SigmasText(point.covariance.by_robot_m2, kMm) +
         " mm";
}

std::string ArmPosesText(const RigResult& result, const std::vector<RigArmPose>& arms) {
  std::string text;
  for (size_t r = 0; r < arms.size(); ++r) {
    if (!arms[r].carries_camera || FindEstimatedArm(result, r) == nullptr) continue;
    const std::string pose = "the pose of the arm " + result.rig.robots[r] + " was ";
    const StatedPose& stated = arms[r].stated;
    if (stated.effect == nullptr) {
      text += pose + "not corrected by its estimated errors, whose uncertainty is missing in the sigmas: " +
              arms[r].why_not_corrected + "; --joints, the positions of the joints at that pose, would tell them\n";
      continue;
    }
    const Rigid3d corrected = Correct(result.rig, result.solution, r, stated).base_from_mount;
    text += pose + "corrected by its estimated errors, by " +
            Significant(1000 * DistanceM(stated.base_from_mount, corrected), 3) + " mm and " +
            Significant(RadToDeg(AngleRad(stated.base_from_mount, corrected)), 3) + " deg\n";
  }
  return text;
}

}  // namespace heba
