// mrcal's .cameramodel. Its extrinsics are rt_cam_ref, the rotation vector and translation that map points from the
// reference frame, here the parent, to the camera frame.
#include "heba/base/text.h"
#include "heba/io/export.h"

namespace heba {

Outcome<std::string> ExportFormat_mrcal(const ExportRequest& request) {
  const Camera& camera = request.camera;
  if (IsFisheye(camera))
    return Failure{"mrcal has no equivalent of the camera model " + camera.model + "; export as opencv"};
  const size_t num_distortion = camera.params.size() - 4;
  const std::string lens =
      num_distortion == 0 ? "LENSMODEL_PINHOLE" : "LENSMODEL_OPENCV" + std::to_string(num_distortion);
  const Rigid3d camera_from_parent = Inverse(request.parent_from_child);
  const Eigen::Vector3d r = LogRotation(camera_from_parent.rotation);
  const Eigen::Vector3d& t = camera_from_parent.translation;
  return CommentLines(ExportRemarks(request), "# ") + "{\n    'lensmodel':  '" + lens + "',\n    'extrinsics': [ " +
         JoinNumbers({r.x(), r.y(), r.z(), t.x(), t.y(), t.z()}, ", ") + ", ],\n    'intrinsics': [ " +
         JoinNumbers(camera.params, ", ") + ", ],\n    'imagersize': [ " + std::to_string(camera.width_px) + ", " +
         std::to_string(camera.height_px) + ",],\n}\n";
}

}  // namespace heba
