// The launch file that MoveIt's hand-eye calibration saves. It starts the same publisher as the format ros1, with the
// arguments on separate lines.
#include "heba/base/text.h"
#include "heba/io/export_format.h"

namespace heba {

Outcome<std::string> ExportFormat_moveit(const ExportRequest& request) {
  const std::string numbers = JoinNumbers(TranslationAndQuaternion(request.parent_from_child), "   ");
  const std::string mounting = request.setup == Setup::kEyeToHand ? "EYE-TO-HAND" : "EYE-IN-HAND";
  std::vector<std::string> remarks = ExportRemarks(request);
  remarks.push_back(mounting);
  return "<launch>\n<!--\n" + CommentLines(remarks, "  ") +
         "-->\n  <node pkg=\"tf2_ros\" type=\"static_transform_publisher\" name=\"camera_link_broadcaster\"\n"
         "        args=\"" +
         numbers + "   " + EscapedForMarkup(request.parent_frame) + "   " + EscapedForMarkup(request.child_frame) +
         "\"/>\n</launch>\n";
}

}  // namespace heba
