// easy_handeye2's .calib: the pose of the tracking camera in the effector (eye_in_hand) or in the base (eye_on_base).
#include "heba/base/text.h"
#include "heba/io/export_format.h"

namespace heba {

Outcome<std::string> ExportFormat_easy_handeye2(const ExportRequest& request) {
  const bool is_fixed = request.setup == Setup::kEyeToHand;
  const std::vector<double> n = TranslationAndQuaternion(request.parent_from_child);
  const auto entries = [&](size_t first, const std::vector<std::string>& names) {
    std::string text;
    for (size_t i = 0; i < names.size(); ++i) text += "    " + names[i] + ": " + DecimalText(n[first + i]) + "\n";
    return text;
  };
  return CommentLines(ExportRemarks(request), "# ") + "parameters:\n  name: " + QuotedForYaml(request.name) +
         "\n  calibration_type: " + (is_fixed ? "eye_on_base" : "eye_in_hand") +
         "\n  tracking_base_frame: " + QuotedForYaml(request.child_frame) +
         "\n  tracking_marker_frame: target\n  robot_base_frame: " +
         (is_fixed ? QuotedForYaml(request.parent_frame) : "base_link") +
         "\n  robot_effector_frame: " + (is_fixed ? "tool0" : QuotedForYaml(request.parent_frame)) +
         "\n  freehand_robot_movement: true\n  move_group_namespace: /\n  move_group: manipulator\ntransform:\n"
         "  translation:\n" +
         entries(0, {"x", "y", "z"}) + "  rotation:\n" + entries(3, {"x", "y", "z", "w"});
}

}  // namespace heba
