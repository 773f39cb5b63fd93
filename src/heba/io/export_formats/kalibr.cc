// Kalibr's camchain of one camera.
#include "heba/base/text.h"
#include "heba/io/export_format.h"

namespace heba {
namespace {

// Returns the camera in a model that Kalibr has: its own, or one that contains it.
Outcome<Camera> ForKalibr(const Camera& camera) {
  if (!camera.Model().facts().kalibr.camera_model.empty()) return camera;
  for (const CameraModel* model : CameraModels()) {
    if (model->facts().kalibr.camera_model.empty()) continue;
    if (std::optional<Camera> converted = ConvertCamera(camera, std::string(model->name()))) return *converted;
  }
  const std::optional<OpenCvLens> lens = OpenCvLensOf(camera);
  const bool is_polynomial = lens && lens->kind == LensKind::kPerspective;
  for (size_t i = 8; is_polynomial && i < camera.params.size(); ++i) {
    if (camera.params[i] == 0) continue;
    return Failure{"Kalibr's lens has k1, k2, p1 and p2 only, and this camera's " + camera.Model().param_names()[i] +
                   " is " + Significant(camera.params[i], 3) + ", not 0; export as camera_info or opencv"};
  }
  return Failure{"Kalibr has no equivalent of the camera model " + camera.model + "; export as opencv"};
}

}  // namespace

Outcome<std::string> ExportFormat_kalibr(const ExportRequest& request) {
  const Outcome<Camera> held = ForKalibr(request.camera);
  if (!held) return Failure{held.reason()};
  const Camera& camera = *held;
  const KalibrNames& names = camera.Model().facts().kalibr;
  const auto projection_end = camera.params.begin() + 4 + names.num_projection;
  // Kalibr writes the coefficients of the projection before the focal lengths.
  std::vector<double> intrinsics(camera.params.begin() + 4, projection_end);
  intrinsics.insert(intrinsics.end(), camera.params.begin(), camera.params.begin() + 4);
  const std::vector<double> distortion(projection_end, camera.params.end());
  std::vector<std::string> remarks = ExportRemarks(request);
  remarks.push_back("camera in parent, x y z qx qy qz qw (a camchain cannot hold it): " +
                    JoinNumbers(TranslationAndQuaternion(request.parent_from_child), " "));
  return CommentLines(remarks, "# ") + "cam0:\n  camera_model: " + names.camera_model + "\n  intrinsics: [" +
         JoinNumbers(intrinsics, ", ") + "]\n  distortion_model: " + names.distortion_model +
         "\n  distortion_coeffs: [" + JoinNumbers(distortion, ", ") + "]\n  resolution: [" +
         std::to_string(camera.width_px) + ", " + std::to_string(camera.height_px) +
         "]\n  rostopic: /camera/image_raw\n  cam_overlaps: []\n";
}

}  // namespace heba
