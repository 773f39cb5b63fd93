// OpenCV's FileStorage. `hand_eye` is the 4 x 4 matrix of parent_from_child, which maps points from the camera frame to
// the parent frame, lengths in m: R_cam2gripper and t_cam2gripper of cv::calibrateHandEye in one matrix.
#include "heba/io/export_format.h"
#include "heba/io/pose_formats.h"

namespace heba {
namespace {

std::string Matrix(const std::string& name, size_t rows, const std::vector<double>& values) {
  return name + ": !!opencv-matrix\n   rows: " + std::to_string(rows) +
         "\n   cols: " + std::to_string(values.size() / rows) + "\n   dt: d\n   data: [ " + JoinNumbers(values, ", ") +
         " ]\n";
}

}  // namespace

Outcome<std::string> ExportFormat_opencv(const ExportRequest& request) {
  const Camera& camera = request.camera;
  const Outcome<OpenCvLens> lens = NeedOpenCvLens(camera, "OpenCV");
  if (!lens) return Failure{lens.reason()};
  std::vector<double> distortion = lens->coefficients;
  if (distortion.empty()) distortion.assign(5, 0);
  const std::vector<double> pose = NumbersFromPose(*FindPoseFormat("matrix"), request.parent_from_child);
  const std::vector<double>& p = camera.params;
  return "%YAML:1.0\n---\n" + CommentLines(ExportRemarks(request), "# ") +
         "image_width: " + std::to_string(camera.width_px) + "\nimage_height: " + std::to_string(camera.height_px) +
         "\n" + (lens->kind == LensKind::kFisheye ? "fisheye_model: 1\n" : "") +
         Matrix("camera_matrix", 3, {p[0], 0, p[2], 0, p[1], p[3], 0, 0, 1}) +
         Matrix("distortion_coefficients", distortion.size(), distortion) + Matrix("hand_eye", 4, pose);
}

}  // namespace heba
