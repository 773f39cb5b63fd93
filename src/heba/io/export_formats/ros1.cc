// ROS 1: tf2_ros static_transform_publisher x y z qx qy qz qw parent child.
#include "heba/base/text.h"
#include "heba/io/export_format.h"

namespace heba {

Outcome<std::string> ExportFormat_ros1(const ExportRequest& request) {
  const std::string numbers = JoinNumbers(TranslationAndQuaternion(request.parent_from_child), " ");
  const std::string frames = EscapedForMarkup(request.parent_frame) + " " + EscapedForMarkup(request.child_frame);
  std::vector<std::string> remarks = ExportRemarks(request);
  remarks.push_back("by hand: rosrun tf2_ros static_transform_publisher " + numbers + " " +
                    PlainText(request.parent_frame) + " " + PlainText(request.child_frame));
  return "<launch>\n<!--\n" + CommentLines(remarks, "  ") +
         "-->\n  <node pkg=\"tf2_ros\" type=\"static_transform_publisher\" name=\"camera_pose_publisher\" args=\"" +
         numbers + " " + frames + "\"/>\n</launch>\n";
}

}  // namespace heba
