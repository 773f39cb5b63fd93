// geometry_msgs/PoseWithCovarianceStamped in YAML, the format that `ros2 topic pub` and `rostopic pub` accept. The
// covariance is that of x, y, z (m) and of the rotations about the fixed axes X, Y, Z of the parent (rad), row by row.
#include "heba/base/text.h"
#include "heba/io/export_format.h"

namespace heba {

Outcome<std::string> ExportFormat_pose_with_covariance(const ExportRequest& request) {
  if (!request.covariance) {
    return Failure{"the estimate of " + request.method + " has no covariance; use the refined one"};
  }
  // The tangent is rotated from the child's axes into the parent's: R exp(w) = exp(R w) R.
  Eigen::Matrix<double, 6, 6> parent_by_child = Eigen::Matrix<double, 6, 6>::Zero();
  parent_by_child.topLeftCorner<3, 3>() = request.parent_from_child.RotationMatrix();
  parent_by_child.bottomRightCorner<3, 3>() = request.parent_from_child.RotationMatrix();
  const Eigen::Matrix<double, 6, 6> covariance = parent_by_child * *request.covariance * parent_by_child.transpose();
  std::string rows;
  for (Eigen::Index i = 0; i < 6; ++i) {
    std::vector<double> row;
    for (Eigen::Index j = 0; j < 6; ++j) row.push_back(0.5 * (covariance(i, j) + covariance(j, i)));
    rows += "    " + JoinNumbers(row, ", ") + (i < 5 ? ",\n" : "]\n");
  }
  const std::vector<double> n = TranslationAndQuaternion(request.parent_from_child);
  const auto entry = [&](const std::string& name, size_t i) { return name + ": " + DecimalText(n[i]); };
  return CommentLines(ExportRemarks(request), "# ") +
         "# publish it with: ros2 topic pub --once /camera_pose geometry_msgs/msg/PoseWithCovarianceStamped \"$(cat "
         "FILE)\"\nheader:\n  frame_id: " +
         QuotedForYaml(request.parent_frame) + "\npose:\n  pose:\n    position: {" + entry("x", 0) + ", " +
         entry("y", 1) + ", " + entry("z", 2) + "}\n    orientation: {" + entry("x", 3) + ", " + entry("y", 4) + ", " +
         entry("z", 5) + ", " + entry("w", 6) + "}\n  covariance: [\n" + rows;
}

}  // namespace heba
