// URDF of the arm: a chain of joints from `base` to `flange`, with the axis of each joint as its z axis.
#include "heba/base/text.h"
#include "heba/io/export_format.h"
#include "heba/robot/arm.h"

namespace heba {
namespace {

std::string JointText(const std::string& name, const std::string& type, const std::string& parent,
                      const std::string& child, const Rigid3d& parent_from_child, const std::string& motion) {
  return "  <joint name=\"" + name + "\" type=\"" + type + "\">\n    <parent link=\"" + parent +
         "\"/>\n    <child link=\"" + child + "\"/>\n    " + UrdfOrigin(parent_from_child) + "\n" + motion +
         "  </joint>\n";
}

}  // namespace

Outcome<std::string> ExportFormat_robot_urdf(const ExportRequest& request) {
  const Arm arm = GeometryOf(request);
  std::string text = "<?xml version=\"1.0\"?>\n<!--\n" + CommentLines(GeometryRemarks(request), "  ") +
                     "-->\n<robot name=\"" + EscapedForMarkup(arm.name) + "\">\n  <link name=\"base\"/>\n";
  for (int j = 0; j < arm.num_joints(); ++j) text += "  <link name=\"link_" + std::to_string(j + 1) + "\"/>\n";
  text += "  <link name=\"flange\"/>\n";
  // Each joint's frame lies on its axis, before the joint moves.
  Rigid3d parent_from_joint = arm.base_from_first;
  for (int j = 0; j < arm.num_joints(); ++j) {
    const ArmJoint& joint = arm.joints[static_cast<size_t>(j)];
    const std::string number = std::to_string(j + 1);
    const bool turns = joint.is_turning;
    text += JointText("joint_" + number, turns ? "continuous" : "prismatic",
                      j == 0 ? "base" : "link_" + std::to_string(j), "link_" + number, parent_from_joint,
                      std::string("    <axis xyz=\"0 0 1\"/>\n") +
                          (turns ? "" : "    <limit lower=\"-10\" upper=\"10\" effort=\"0\" velocity=\"0\"/>\n"));
    // The pose of the next frame in this one with the joint at zero.
    Arm link;
    link.joints = {joint};
    parent_from_joint = BaseFromTip(link, Eigen::VectorXd::Zero(1));
  }
  text += JointText("flange_joint", "fixed", "link_" + std::to_string(arm.num_joints()), "flange",
                    parent_from_joint * arm.last_from_tip, "");
  return text + "</robot>\n";
}

}  // namespace heba
