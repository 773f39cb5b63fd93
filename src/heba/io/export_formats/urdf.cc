// URDF with a joint origin: xyz in m, rpy in rad about fixed axes, R = Rz(yaw) Ry(pitch) Rx(roll).
#include <algorithm>

#include "heba/base/text.h"
#include "heba/io/export_format.h"

namespace heba {

Outcome<std::string> ExportCameras_urdf(const std::vector<ExportRequest>& cameras) {
  std::vector<std::string> remarks;
  std::vector<std::string> links;
  std::string joints;
  const auto add_link = [&](const std::string& link) {
    if (std::find(links.begin(), links.end(), link) == links.end()) links.push_back(link);
  };
  for (const ExportRequest& request : cameras) {
    const std::string parent = EscapedForMarkup(request.parent_frame);
    const std::string camera = EscapedForMarkup(request.child_frame);
    for (const std::string& remark : ExportRemarks(request)) remarks.push_back(remark);
    if (request.child == ExportFrame::kOptical) {
      remarks.push_back("of a body frame with the same origin: " +
                        UrdfOrigin(request.parent_from_child * OpticalFromBody()).substr(1));
    }
    add_link(parent);
    add_link(camera);
    joints += "  <joint name=\"" + parent + "_to_" + camera + "\" type=\"fixed\">\n    <parent link=\"" + parent +
              "\"/>\n    <child link=\"" + camera + "\"/>\n    " + UrdfOrigin(request.parent_from_child) +
              "\n  </joint>\n";
  }
  std::string text;
  for (const std::string& link : links) text += "  <link name=\"" + link + "\"/>\n";
  // Two hyphens would end the XML comment; numbers contain at most one in a row.
  return "<?xml version=\"1.0\"?>\n<!--\n" + CommentLines(remarks, "  ") + "-->\n<robot name=\"" +
         EscapedForMarkup(cameras.front().name) + "\">\n" + text + joints + "</robot>\n";
}

Outcome<std::string> ExportFormat_urdf(const ExportRequest& request) { return ExportCameras_urdf({request}); }

}  // namespace heba
