#include "heba/io/arm_file.h"

#include <array>
#include <string>
#include <vector>

#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/config/yaml_reader.h"
#include "heba/io/export_format.h"
#include "heba/io/ur_calibration_file.h"

namespace heba {
namespace {

constexpr std::array<const char*, 6> kLinks = {"shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3"};

}  // namespace

Arm ReadArmFile(const std::filesystem::path& path, const Arm& nominal) {
  constexpr size_t kMaxBytes = size_t{1} << 20;
  const std::string text = ReadTextFile(path, kMaxBytes);
  if (path.extension() == ".conf" || IsUrCalibration(text)) return ParseUrCalibration(text, path, nominal.name);
  MapReader root(ReadYamlFile(path));
  MapReader links(root.Get("kinematics"));
  std::vector<ArmAxis> axes;
  Rigid3d base_from_link;
  for (const char* name : kLinks) {
    MapReader link(links.Get(name));
    std::vector<double> numbers;
    for (const std::string& column : RollPitchYawFormat().columns) numbers.push_back(link.Number(column));
    const Outcome<Rigid3d> last_from_link = PoseFromNumbers(RollPitchYawFormat(), numbers);
    if (!last_from_link) link.value().Fail(last_from_link.reason());
    link.Finish();
    base_from_link = base_from_link * *last_from_link;
    axes.push_back({base_from_link.rotation * Eigen::Vector3d::UnitZ(), base_from_link.translation, true});
  }
  if (nominal.num_joints() != static_cast<int>(kLinks.size())) {
    throw InputError(path.string() + ": describes six joints, but the arm " + nominal.name + " has " +
                     std::to_string(nominal.num_joints()));
  }
  return WithLoadAndLimitsOf(ArmFromAxes(nominal.name, axes, base_from_link), nominal);
}

Outcome<std::string> ArmFileText(const Arm& yielding_arm) {
  const Arm arm = RigidPart(yielding_arm);
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
    const std::vector<double> numbers = NumbersFromPose(RollPitchYawFormat(), Inverse(base_from_last) * base_from_link);
    text += std::string("  ") + kLinks[i] + ":\n";
    for (size_t k = 0; k < numbers.size(); ++k) {
      text += "    " + RollPitchYawFormat().columns[k] + ": " + RoundTrip(numbers[k] + 0.0) + "\n";
    }
    base_from_last = base_from_link;
  }
  return text;
}

}  // namespace heba
