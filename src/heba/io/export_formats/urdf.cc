// URDF with a joint origin: xyz in m, rpy in rad about fixed axes, R = Rz(yaw) Ry(pitch) Rx(roll).
#include "heba/base/text.h"
#include "heba/io/export_format.h"

namespace heba {
Outcome<std::string> ExportFormat_urdf(const ExportRequest& request) {
  const std::string parent = EscapedForMarkup(request.parent_frame);
  const std::string camera = EscapedForMarkup(request.child_frame);
  std::vector<std::string> remarks = ExportRemarks(request);
  if (request.child == ExportFrame::kOptical) {
    remarks.push_back("of a body frame with the same origin: " +
                      UrdfOrigin(request.parent_from_child * OpticalFromBody()).substr(1));
  }
  // Two hyphens would end the XML comment; numbers contain at most one in a row.
  return "<?xml version=\"1.0\"?>\n<!--\n" + CommentLines(remarks, "  ") + "-->\n<robot name=\"" +
         EscapedForMarkup(request.name) + "\">\n  <link name=\"" + parent + "\"/>\n  <link name=\"" + camera +
         "\"/>\n  <joint name=\"" + parent + "_to_" + camera + "\" type=\"fixed\">\n    <parent link=\"" + parent +
         "\"/>\n    <child link=\"" + camera + "\"/>\n    " + UrdfOrigin(request.parent_from_child) +
         "\n  </joint>\n</robot>\n";
}

}  // namespace heba
