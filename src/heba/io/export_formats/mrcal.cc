// mrcal's .cameramodel. Its extrinsics are rt_cam_ref, the rotation vector and translation that map points from the
// reference frame, here the parent, to the camera frame.
#include "heba/base/text.h"
#include "heba/io/export_format.h"

namespace heba {

Outcome<std::string> ExportFormat_mrcal(const ExportRequest& request) {
  const Camera& camera = request.camera;
  const std::optional<OpenCvLens> lens = OpenCvLensOf(camera);
  if (!lens || lens->kind != LensKind::kPerspective) {
    return Failure{"mrcal has no equivalent of the camera model " + camera.model + "; export as " +
                   (lens ? "opencv" : "kalibr")};
  }
  const size_t num_distortion = lens->coefficients.size();
  const std::string lens_model =
      num_distortion == 0 ? "LENSMODEL_PINHOLE" : "LENSMODEL_OPENCV" + std::to_string(num_distortion);
  std::vector<double> intrinsics(camera.params.begin(), camera.params.begin() + 4);
  intrinsics.insert(intrinsics.end(), lens->coefficients.begin(), lens->coefficients.end());
  const Rigid3d camera_from_parent = Inverse(request.parent_from_child);
  const Eigen::Vector3d r = LogRotation(camera_from_parent.rotation);
  const Eigen::Vector3d& t = camera_from_parent.translation;
  return CommentLines(ExportRemarks(request), "# ") + "{\n    'lensmodel':  '" + lens_model +
         "',\n    'extrinsics': [ " + JoinNumbers({r.x(), r.y(), r.z(), t.x(), t.y(), t.z()}, ", ") +
         ", ],\n    'intrinsics': [ " + JoinNumbers(intrinsics, ", ") + ", ],\n    'imagersize': [ " +
         std::to_string(camera.width_px) + ", " + std::to_string(camera.height_px) + ",],\n}\n";
}

}  // namespace heba
