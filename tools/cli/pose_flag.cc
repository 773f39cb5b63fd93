#include "tools/cli/pose_flag.h"

#include <algorithm>
#include <vector>

#include "heba/base/error.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/config/yaml_reader.h"
#include "tools/config/robot_section.h"

namespace heba {

namespace {

std::vector<double> NumbersOfFlag(const std::string& name, const std::string& text) {
  std::vector<double> numbers;
  for (const std::string& field : Split(text, ',')) {
    double number = 0;
    if (!ParseDouble(Trim(field), &number)) {
      throw InputError("--" + name + ": " + Quoted(Trim(field)) + " is not a number");
    }
    numbers.push_back(number);
  }
  return numbers;
}

}  // namespace

Rigid3d PoseOfFlag(const std::string& name, const std::string& text, const PoseFormat& format) {
  const std::vector<std::string>& columns = format.columns;
  const std::vector<double> numbers = NumbersOfFlag(name, text);
  if (numbers.size() != columns.size()) {
    throw InputError("--" + name + ": " + std::to_string(numbers.size()) + " numbers; " +
                     std::to_string(columns.size()) + " are needed: " + Join(columns, ","));
  }
  const Outcome<Rigid3d> pose = PoseFromNumbers(format, numbers);
  if (!pose) throw InputError("--" + name + ": " + pose.reason());
  return *pose;
}

Rigid3d PoseOrMappingOfFlag(const std::string& name, const std::string& text, const PoseFormat& format) {
  return Trim(text).starts_with('{') ? ReadPose(ParseYaml(std::string(text), "--" + name))
                                     : PoseOfFlag(name, text, format);
}

Eigen::VectorXd JointsOfFlag(const std::string& name, const std::string& text, const Arm& arm, bool are_deg) {
  const std::vector<double> numbers = NumbersOfFlag(name, text);
  const auto num_joints = static_cast<size_t>(arm.num_joints());
  if (numbers.size() != num_joints) {
    throw InputError("--" + name + ": " + std::to_string(numbers.size()) + " numbers; the arm " + arm.name + " has " +
                     std::to_string(num_joints) + " joints");
  }
  return PositionsOf(arm, numbers, are_deg);
}

const PoseFormat& FormatOfNear(const PoseFormat& format) {
  return format.robot.empty() ? format : *FindPoseFormat("ros");
}

std::pair<size_t, std::string> NamedValue(const std::string& what, const std::string& text,
                                          const std::vector<std::string>& names, const std::string& form) {
  if (names.size() == 1 && names.front().empty()) return {0, text};
  const size_t end = text.find('=');
  if (end == std::string::npos) throw InputError(what + ": " + Quoted(text) + ": " + form + " is needed");
  const std::string name = Trim(text.substr(0, end));
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) throw InputError(what + ": " + UnknownName(name, names));
  return {static_cast<size_t>(found - names.begin()), text.substr(end + 1)};
}

std::vector<std::string> ValuesByArm(const std::string& flag, const std::string& value,
                                     const std::vector<std::string>& robots, const std::string& form) {
  std::vector<std::string> values(robots.size());
  if (value.empty()) return values;
  // A path may have the sign, too.
  const bool is_of_only = robots.size() == 1 && !value.starts_with(robots.front() + "=");
  if (robots.size() == 1 && (robots.front().empty() || is_of_only)) return {value};
  for (const std::string& part : Split(value, ';')) {
    const auto [robot, text] = NamedValue(flag, part, robots, form);
    if (!values[robot].empty()) throw InputError(flag + ": the arm " + robots[robot] + " is named twice");
    if (Trim(text).empty()) throw InputError(flag + ": " + Quoted(part) + ": " + form + " is needed");
    values[robot] = text;
  }
  return values;
}

}  // namespace heba
