// ROS camera_info, in the format of camera_calibration and camera_info_manager.
#include "heba/base/text.h"
#include "heba/io/export_format.h"

namespace heba {
namespace {

std::string Matrix(const std::string& name, size_t rows, const std::vector<double>& values) {
  return name + ":\n  rows: " + std::to_string(rows) + "\n  cols: " + std::to_string(values.size() / rows) +
         "\n  data: [" + JoinNumbers(values, ", ") + "]\n";
}

}  // namespace

Outcome<std::string> ExportFormat_camera_info(const ExportRequest& request) {
  const Camera& camera = request.camera;
  const Outcome<OpenCvLens> lens = NeedOpenCvLens(camera, "ROS");
  if (!lens) return Failure{lens.reason()};
  const bool is_fisheye = lens->kind == LensKind::kFisheye;
  std::vector<double> distortion = lens->coefficients;
  // The model plumb_bob has five coefficients.
  if (!is_fisheye && distortion.size() < 5) distortion.resize(5, 0);
  const std::string model = is_fisheye ? "equidistant" : (distortion.size() > 5 ? "rational_polynomial" : "plumb_bob");
  const std::vector<double>& p = camera.params;
  return CommentLines(ExportRemarks(request), "# ") + "image_width: " + std::to_string(camera.width_px) +
         "\nimage_height: " + std::to_string(camera.height_px) + "\ncamera_name: " + QuotedForYaml(request.name) +
         "\n" + Matrix("camera_matrix", 3, {p[0], 0, p[2], 0, p[1], p[3], 0, 0, 1}) + "distortion_model: " + model +
         "\n" + Matrix("distortion_coefficients", 1, distortion) +
         Matrix("rectification_matrix", 3, {1, 0, 0, 0, 1, 0, 0, 0, 1}) +
         Matrix("projection_matrix", 3, {p[0], 0, p[2], 0, 0, p[1], p[3], 0, 0, 0, 1, 0});
}

}  // namespace heba
