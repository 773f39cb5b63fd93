// ROS 2: a Python launch file that starts tf2_ros static_transform_publisher with named arguments.
#include <array>

#include "heba/base/text.h"
#include "heba/io/export_format.h"

namespace heba {

Outcome<std::string> ExportPoses_ros2(const std::vector<ExportRequest>& poses) {
  const std::string twice = FrameWithTwoPoses(poses);
  if (!twice.empty()) return Failure{"a frame of ROS has one parent, and " + twice + " would have two"};
  constexpr std::array kNames = {"--x", "--y", "--z", "--qx", "--qy", "--qz", "--qw"};
  std::vector<std::string> remarks;
  std::vector<std::string> nodes;
  for (size_t c = 0; c < poses.size(); ++c) {
    const ExportRequest& request = poses[c];
    const std::vector<double> numbers = TranslationAndQuaternion(request.parent_from_child);
    std::vector<std::string> words;
    std::string list;
    for (size_t i = 0; i < kNames.size(); ++i) {
      words.push_back(std::string(kNames[i]) + " " + DecimalText(numbers[i]));
      list += "            '" + std::string(kNames[i]) + "', '" + DecimalText(numbers[i]) + "',\n";
    }
    for (const std::string& remark : ExportRemarks(request)) remarks.push_back(remark);
    remarks.push_back("by hand: ros2 run tf2_ros static_transform_publisher " + Join(words, " ") + " --frame-id " +
                      PlainText(request.parent_frame) + " --child-frame-id " + PlainText(request.child_frame));
    // The nodes of one launch file need different names.
    const std::string number = poses.size() > 1 ? "_" + std::to_string(c) : "";
    // Text quoted for YAML is also valid in Python.
    nodes.push_back(
        "Node(\n"
        "        package='tf2_ros', executable='static_transform_publisher', name='camera_pose_publisher" +
        number + "',\n        arguments=[\n" + list + "            '--frame-id', " +
        QuotedForYaml(request.parent_frame) + ",\n            '--child-frame-id', " +
        QuotedForYaml(request.child_frame) + ",\n        ])");
  }
  return CommentLines(remarks, "# ") +
         "from launch import LaunchDescription\nfrom launch_ros.actions import Node\n\n\n"
         "def generate_launch_description():\n"
         "    return LaunchDescription([" +
         Join(nodes, ", ") + "])\n";
}

Outcome<std::string> ExportFormat_ros2(const ExportRequest& request) { return ExportPoses_ros2({request}); }

}  // namespace heba
