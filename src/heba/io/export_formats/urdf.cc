// URDF with a joint origin: xyz in m, rpy in rad about fixed axes, R = Rz(yaw) Ry(pitch) Rx(roll).
#include "heba/base/text.h"
#include "heba/io/export_format.h"

namespace heba {

namespace {

// Returns a robot element with the links `roots`, and with a link and a joint for each pose.
std::string UrdfText(const std::vector<ExportRequest>& poses, const std::string& attributes,
                     const std::vector<std::string>& roots, std::vector<std::string> remarks) {
  std::vector<std::string> links = roots;
  std::string joints;
  for (const ExportRequest& request : poses) {
    const std::string parent = EscapedForMarkup(request.parent_frame);
    const std::string child = EscapedForMarkup(request.child_frame);
    for (const std::string& remark : ExportRemarks(request)) remarks.push_back(remark);
    if (request.child == ExportFrame::kOptical) {
      remarks.push_back("of a body frame with the same origin: " +
                        UrdfOrigin(request.parent_from_child * OpticalFromBody()).substr(1));
    }
    links.push_back(request.child_frame);
    joints += "  <joint name=\"" + parent + "_to_" + child + "\" type=\"fixed\">\n    <parent link=\"" + parent +
              "\"/>\n    <child link=\"" + child + "\"/>\n    " + UrdfOrigin(request.parent_from_child) +
              "\n  </joint>\n";
  }
  std::string text;
  for (const std::string& link : links) text += "  <link name=\"" + EscapedForMarkup(link) + "\"/>\n";
  // Two hyphens would end the XML comment; numbers contain at most one in a row.
  return "<?xml version=\"1.0\"?>\n<!--\n" + CommentLines(remarks, "  ") + "-->\n<robot " + attributes + ">\n" + text +
         joints + "</robot>\n";
}

}  // namespace

Outcome<std::string> ExportPoses_urdf(const std::vector<ExportRequest>& poses) {
  const std::vector<std::string> roots = RootFrames(poses);
  const std::string twice = FrameWithTwoPoses(poses);
  if (!twice.empty()) return Failure{"a link of a URDF has one parent, and " + twice + " would have two"};
  if (roots.size() != 1) {
    return Failure{"a URDF has one root link, and these poses are given in " + Join(roots, " and ") +
                   "; each has a file of its own"};
  }
  return UrdfText(poses, "name=\"" + EscapedForMarkup(poses.front().name) + "\"", roots, {});
}

Outcome<std::string> ExportPoses_urdf_fragment(const std::vector<ExportRequest>& poses) {
  const std::vector<std::string> roots = RootFrames(poses);
  const std::string twice = FrameWithTwoPoses(poses);
  if (!twice.empty()) return Failure{"a link of a URDF has one parent, and " + twice + " would have two"};
  std::vector<std::string> names;
  for (const std::string& root : roots) names.push_back(PlainText(root));
  return UrdfText(poses, "xmlns:xacro=\"http://www.ros.org/wiki/xacro\"", {},
                  {"to be included (xacro:include) after the arms, whose URDF must define " + Join(names, ", ")});
}

Outcome<std::string> ExportFormat_urdf(const ExportRequest& request) { return ExportPoses_urdf({request}); }

}  // namespace heba
