#include "heba/io/ur_calibration_file.h"

#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <vector>

#include "heba/base/text.h"
#include "heba/robot/arm_table.h"
#include "heba/robot/ur_kinematics.h"

namespace heba {
namespace {

constexpr size_t kNumJoints = 6;

// A parameter of a joint, the key of its deviations, and the largest one that is accepted.
struct Deviations {
  const char* key;
  ArmParam param;
  double largest;
};
constexpr double kLargestM = 1e6;
constexpr double kLargestRad = 10;
constexpr std::array<Deviations, 4> kDeviations = {{{"delta_theta", ArmParam::kTheta, kLargestRad},
                                                    {"delta_a", ArmParam::kA, kLargestM},
                                                    {"delta_d", ArmParam::kD, kLargestM},
                                                    {"delta_alpha", ArmParam::kAlpha, kLargestRad}}};
constexpr const char* kStatusKey = "calibration_status";

struct Entry {
  std::string value;
  int line = 0;
};

[[noreturn]] void FailAt(const std::filesystem::path& file, int line, const std::string& fault) {
  throw InputError(file.string() + ":" + std::to_string(line) + ": " + fault);
}

// Returns the entries of the section [mounting].
std::map<std::string, Entry> EntriesOf(const std::string& text, const std::filesystem::path& file) {
  std::map<std::string, Entry> entries;
  std::string section;
  int number = 0;
  for (const std::string& raw : Split(text, '\n')) {
    ++number;
    const std::string line = Trim(std::string_view(raw).substr(0, raw.find('#')));
    if (line.empty()) continue;
    if (line.front() == '[') {
      if (line.back() != ']') FailAt(file, number, Quoted(line) + " is not a section such as [mounting]");
      section = Trim(std::string_view(line).substr(1, line.size() - 2));
      continue;
    }
    if (section != "mounting") continue;
    const size_t equals = line.find('=');
    if (equals == std::string::npos) FailAt(file, number, Quoted(line) + " is not of the form key = value");
    const std::string key = Trim(std::string_view(line).substr(0, equals));
    const auto [earlier, is_new] = entries.emplace(key, Entry{Trim(std::string_view(line).substr(equals + 1)), number});
    if (!is_new) FailAt(file, number, Quoted(key) + " already occurs in line " + std::to_string(earlier->second.line));
  }
  return entries;
}

// Returns the six numbers of a list in brackets.
std::array<double, kNumJoints> SixNumbers(const Entry& entry, const Deviations& deviations,
                                          const std::filesystem::path& file) {
  const std::string key = std::string(deviations.key) + ": ";
  const std::string& value = entry.value;
  if (value.size() < 2 || value.front() != '[' || value.back() != ']') {
    FailAt(file, entry.line, key + Quoted(value) + " is not a list of six numbers in brackets");
  }
  const std::vector<std::string> parts = Split(std::string_view(value).substr(1, value.size() - 2), ',');
  if (parts.size() != kNumJoints) {
    FailAt(file, entry.line, key + "six numbers are needed, one per joint, not " + std::to_string(parts.size()));
  }
  std::array<double, kNumJoints> numbers = {};
  for (size_t j = 0; j < kNumJoints; ++j) {
    const std::string part = Trim(parts[j]);
    if (!ParseDouble(part, &numbers[j])) FailAt(file, entry.line, key + Quoted(part) + " is not a number");
    if (!(std::abs(numbers[j]) <= deviations.largest)) {
      FailAt(file, entry.line,
             key + Quoted(part) + " is not possible; the largest deviation is " + Significant(deviations.largest, 3));
    }
  }
  return numbers;
}

// Returns the pose of the frame of Denavit and Hartenberg that follows a joint at zero in the one before it.
Rigid3d NextFrame(const ArmJoint& joint) {
  Arm link;
  link.joints = {joint};
  return BaseFromTip(link, Eigen::VectorXd::Zero(1));
}

// Returns the parameters, without beta, of a joint whose axis is z if the next axis passes through `point` along `z`.
// The d of parallel axes is `parallel_d_m`. Of the two directions of the common normal, that with theta within 90 deg
// of zero is chosen, as for the maker's parameters.
ArmJoint JointBefore(const Eigen::Vector3d& z, const Eigen::Vector3d& point, double parallel_d_m) {
  // Two errors are about 1e-8 m there: that of axes taken for parallel ones, and the rounding error of a large d.
  constexpr double kParallel = 1e-8;
  const double sine = z.head<2>().norm();
  Eigen::Vector3d x(1, 0, 0);
  if (sine > kParallel) {
    x = Eigen::Vector3d(-z.y() / sine, z.x() / sine, 0);
  } else if (point.head<2>().norm() > kParallel) {
    x = Eigen::Vector3d(point.x(), point.y(), 0).normalized();
  }
  if (x.x() < 0) x = -x;
  const Eigen::Vector3d y = Eigen::Vector3d::UnitZ().cross(x);
  ArmJoint joint;
  joint.theta_rad = std::atan2(x.y(), x.x());
  joint.a_m = point.dot(x);
  joint.alpha_rad = std::atan2(-z.dot(y), z.z());
  joint.d_m = sine > kParallel ? (point - z * (point.dot(y) / z.dot(y))).z() : parallel_d_m;
  return joint;
}

// Returns the parameters of the arm without the angles beta and without constant poses before and after them.
Outcome<std::vector<ArmJoint>> DenavitHartenbergOf(const Arm& arm) {
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(arm.num_joints());
  const std::vector<ArmAxis> axes = AxesOf(arm, zero);
  const Rigid3d base_from_tip = BaseFromTip(arm, zero);
  constexpr double kSame = 1e-9;
  const Eigen::Vector3d& first_z = axes.front().direction;
  if ((first_z - Eigen::Vector3d::UnitZ()).norm() > kSame || axes.front().point.head<2>().norm() > kSame) {
    return Failure{"the axis of the first joint of the arm " + arm.name + " is not the z axis of its base"};
  }
  std::vector<ArmJoint> joints;
  Rigid3d base_from_joint;
  for (size_t i = 0; i + 1 < axes.size(); ++i) {
    const Rigid3d joint_from_base = Inverse(base_from_joint);
    joints.push_back(JointBefore(joint_from_base.rotation * axes[i + 1].direction, joint_from_base * axes[i + 1].point,
                                 arm.joints[i].d_m));
    base_from_joint = base_from_joint * NextFrame(joints.back());
  }
  const Rigid3d last_from_tip = Inverse(base_from_joint) * base_from_tip;
  const Eigen::Vector3d x = last_from_tip.rotation * Eigen::Vector3d::UnitX();
  if ((last_from_tip.rotation * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitZ()).norm() > kSame ||
      last_from_tip.translation.head<2>().norm() > kSame) {
    return Failure{"the flange of the arm " + arm.name + " is not on the axis of its last joint"};
  }
  joints.push_back({std::atan2(x.y(), x.x()), last_from_tip.translation.z()});
  return joints;
}

}  // namespace

bool IsUrCalibration(std::string_view text) {
  for (const std::string& line : Split(text, '\n')) {
    if (Trim(std::string_view(line).substr(0, line.find('#'))) == "[mounting]") return true;
  }
  return false;
}

Arm ParseUrCalibration(const std::string& text, const std::filesystem::path& file, const std::string& arm_name) {
  if (FindUrRobot(arm_name) == nullptr) {
    throw InputError(file.string() + ": is the calibration of an arm of Universal Robots, but the arm is called " +
                     Quoted(arm_name) + "; one of: " + Join(UrRobotNames(), ", ") +
                     DidYouMean(arm_name, UrRobotNames()));
  }
  const std::map<std::string, Entry> entries = EntriesOf(text, file);
  Arm arm = *FindArm(arm_name);
  for (const Deviations& deviations : kDeviations) {
    const auto entry = entries.find(deviations.key);
    if (entry == entries.end()) {
      throw InputError(file.string() + ": the section [mounting] has no key '" + deviations.key + "'");
    }
    const std::array<double, kNumJoints> numbers = SixNumbers(entry->second, deviations, file);
    for (size_t j = 0; j < kNumJoints; ++j) arm.joints[j][deviations.param] += numbers[j];
  }
  if (const auto status = entries.find(kStatusKey); status != entries.end() && status->second.value == "0") {
    FailAt(file, status->second.line,
           std::string(kStatusKey) + ": 0 says that the arm has not been calibrated; leave out the file");
  }
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(arm.num_joints());
  return WithLoadAndLimitsOf(ArmFromAxes(arm.name, AxesOf(arm, zero), BaseFromTip(arm, zero)), *FindArm(arm_name));
}

Outcome<std::string> UrCalibrationText(const Arm& yielding_arm) {
  const Arm arm = RigidPart(yielding_arm);
  if (FindUrRobot(arm.name) == nullptr || arm.joints.size() != kNumJoints) {
    return Failure{"the file holds the calibration of an arm of Universal Robots, which the arm " + arm.name +
                   " is not (" + Join(UrRobotNames(), ", ") + ")"};
  }
  const Outcome<std::vector<ArmJoint>> joints = DenavitHartenbergOf(arm);
  if (!joints) return Failure{joints.reason()};
  std::string text = "[mounting]\n";
  for (const Deviations& deviations : kDeviations) {
    std::vector<std::string> numbers;
    for (size_t j = 0; j < kNumJoints; ++j) {
      const double deviation = (*joints)[j][deviations.param] - FindArm(arm.name)->joints[j][deviations.param];
      numbers.push_back(RoundTrip(deviation + 0.0));
    }
    text += std::string(deviations.key) + " = [ " + Join(numbers, ", ") + "]\n";
  }
  text +=
      "joint_checksum = [ 0x0, 0x0, 0x0, 0x0, 0x0, 0x0] # to be replaced by the line of the controller's own file\n";
  return text + kStatusKey + " = 2 # 0 == notInitialized / 1 == notLinearised / 2 == Linearised\n";
}

}  // namespace heba
