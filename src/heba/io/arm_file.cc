#include "heba/io/arm_file.h"

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "heba/base/text.h"
#include "heba/config/yaml_reader.h"

namespace heba {
namespace {

constexpr std::array<const char*, 6> kLinks = {"shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3"};

Eigen::Quaterniond FromRpy(double roll, double pitch, double yaw) {
  return Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX());
}

// Returns roll, pitch and yaw.
Eigen::Vector3d ToRpy(const Eigen::Matrix3d& r) {
  const double pitch = std::atan2(-r(2, 0), std::hypot(r(0, 0), r(1, 0)));
  constexpr double kLocked = 1e-9;
  if (std::hypot(r(0, 0), r(1, 0)) < kLocked) return {std::atan2(-r(1, 2), r(1, 1)), pitch, 0};
  return {std::atan2(r(2, 1), r(2, 2)), pitch, std::atan2(r(1, 0), r(0, 0))};
}

}  // namespace

Arm ReadArmFile(const std::filesystem::path& path, const Arm& nominal) {
  MapReader root(ReadYamlFile(path));
  MapReader links(root.Get("kinematics"));
  std::vector<ArmAxis> axes;
  Rigid3d base_from_link;
  for (const char* name : kLinks) {
    MapReader link(links.Get(name));
    const Eigen::Vector3d position(link.Number("x"), link.Number("y"), link.Number("z"));
    const double roll = link.Number("roll");
    const double pitch = link.Number("pitch");
    const double yaw = link.Number("yaw");
    link.Finish();
    base_from_link = base_from_link * Rigid3d(FromRpy(roll, pitch, yaw), position);
    axes.push_back({base_from_link.rotation * Eigen::Vector3d::UnitZ(), base_from_link.translation, true});
  }
  if (nominal.num_joints() != static_cast<int>(kLinks.size())) {
    throw InputError(path.string() + ": describes six joints, but the arm " + nominal.name + " has " +
                     std::to_string(nominal.num_joints()));
  }
  return ArmFromAxes(nominal.name, axes, base_from_link);
}

Outcome<std::string> ArmFileText(const Arm& arm) {
  if (arm.num_joints() != static_cast<int>(kLinks.size())) {
    return Failure{"the file holds six joints, but the arm " + arm.name + " has " + std::to_string(arm.num_joints())};
  }
  // Frame i has the axis of joint i as its z axis, and the last one is the tip's.
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(arm.num_joints());
  const Rigid3d base_from_tip = BaseFromTip(arm, zero);
  const std::vector<ArmAxis> axes = AxesOf(arm, zero);
  const Eigen::Vector3d tip_z = base_from_tip.rotation * Eigen::Vector3d::UnitZ();
  constexpr double kSame = 1e-9;
  if ((axes.back().direction - tip_z).norm() > kSame ||
      (base_from_tip.translation - axes.back().point).cross(tip_z).norm() > kSame) {
    return Failure{"the flange of the arm " + arm.name + " is not on the axis of its last joint"};
  }
  std::string text = "# For ur_description of ROS (kinematics_params).\nkinematics:\n";
  Rigid3d base_from_last;
  for (size_t i = 0; i < kLinks.size(); ++i) {
    Rigid3d base_from_link = base_from_tip;
    if (i + 1 < kLinks.size()) {
      // The frame on the axis of the joint with the joint at zero. A shift along the axis does not change the arm.
      Arm part = arm;
      part.joints.resize(i + 1);
      ArmJoint& last = part.joints.back();
      last = {last.theta_rad, last.d_m};
      part.last_from_tip = {};
      base_from_link = BaseFromTip(part, Eigen::VectorXd::Zero(static_cast<Eigen::Index>(i) + 1));
    }
    const Rigid3d link = Inverse(base_from_last) * base_from_link;
    const Eigen::Vector3d rpy = ToRpy(link.RotationMatrix());
    text += std::string("  ") + kLinks[i] + ":\n";
    const std::array<std::pair<const char*, double>, 6> numbers = {{{"x", link.translation.x()},
                                                                    {"y", link.translation.y()},
                                                                    {"z", link.translation.z()},
                                                                    {"roll", rpy[0]},
                                                                    {"pitch", rpy[1]},
                                                                    {"yaw", rpy[2]}}};
    for (const auto& [key, value] : numbers) text += std::string("    ") + key + ": " + RoundTrip(value + 0.0) + "\n";
    base_from_last = base_from_link;
  }
  return text;
}

}  // namespace heba
