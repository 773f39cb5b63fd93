// The file in which ROS keeps the calibrated kinematics of an arm of Universal Robots (kinematics_params of
// ur_description).
#include "heba/io/arm_file.h"
#include "heba/io/export_format.h"

namespace heba {

Outcome<std::string> ExportFormat_ur_kinematics(const ExportRequest& request) {
  const Outcome<std::string> text = ArmFileText(GeometryOf(request));
  if (!text) return text;
  return CommentLines(GeometryRemarks(request), "# ") + *text;
}

}  // namespace heba
