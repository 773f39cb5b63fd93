#include "tools/cli/pose_flag.h"

#include <vector>

#include "heba/base/error.h"
#include "heba/base/text.h"

namespace heba {

Rigid3d PoseOfFlag(const std::string& name, const std::string& text, const PoseFormat& format) {
  const std::vector<std::string> fields = Split(text, ',');
  const std::vector<std::string>& columns = format.columns;
  std::vector<double> numbers;
  for (const std::string& field : fields) {
    double number = 0;
    if (!ParseDouble(Trim(field), &number)) {
      throw InputError("--" + name + ": " + Quoted(Trim(field)) + " is not a number");
    }
    numbers.push_back(number);
  }
  if (numbers.size() != columns.size()) {
    throw InputError("--" + name + ": " + std::to_string(numbers.size()) + " numbers; " +
                     std::to_string(columns.size()) + " are needed: " + Join(columns, ","));
  }
  const Outcome<Rigid3d> pose = PoseFromNumbers(format, numbers);
  if (!pose) throw InputError("--" + name + ": " + pose.reason());
  return *pose;
}

const PoseFormat& FormatOfNear(const PoseFormat& format) {
  return format.robot.empty() ? format : *FindPoseFormat("ros");
}

}  // namespace heba
