// The file in which the controller of an arm of Universal Robots keeps its factory calibration (calibration.conf).
#include "heba/io/export_format.h"
#include "heba/io/ur_calibration_file.h"

namespace heba {

Outcome<std::string> ExportFormat_ur_calibration(const ExportRequest& request) {
  const Outcome<std::string> text = UrCalibrationText(GeometryOf(request));
  if (!text) return text;
  std::vector<std::string> remarks = GeometryRemarks(request);
  remarks.emplace_back("Keep the controller's own file. Its line joint_checksum belongs here, by which the controller");
  remarks.emplace_back("recognises its joints.");
  return CommentLines(remarks, "# ") + *text;
}

}  // namespace heba
