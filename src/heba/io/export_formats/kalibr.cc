// Kalibr's camchain of one camera. Its polynomial lens (radtan) has four coefficients, without k3.
#include "heba/base/text.h"
#include "heba/io/export.h"

namespace heba {

Outcome<std::string> ExportFormat_kalibr(const ExportRequest& request) {
  const Camera& camera = request.camera;
  std::vector<double> distortion = OpenCvDistortion(camera);
  std::string model = "radtan";
  if (IsFisheye(camera)) {
    model = "equidistant";
  } else {
    for (size_t i = 4; i < distortion.size(); ++i) {
      if (distortion[i] != 0) {
        return Failure{"Kalibr's lens has k1, k2, p1 and p2 only, and this camera's " +
                       camera.Model().param_names()[4 + i] + " is " + Significant(distortion[i], 3) +
                       ", not 0; export as camera_info or opencv"};
      }
    }
    distortion.resize(4);
  }
  std::vector<std::string> remarks = ExportRemarks(request);
  remarks.push_back("camera in parent, x y z qx qy qz qw (a camchain cannot hold it): " +
                    JoinNumbers(TranslationAndQuaternion(request.parent_from_child), " "));
  const std::vector<double>& p = camera.params;
  return CommentLines(remarks, "# ") + "cam0:\n  camera_model: pinhole\n  intrinsics: [" +
         JoinNumbers({p[0], p[1], p[2], p[3]}, ", ") + "]\n  distortion_model: " + model + "\n  distortion_coeffs: [" +
         JoinNumbers(distortion, ", ") + "]\n  resolution: [" + std::to_string(camera.width_px) + ", " +
         std::to_string(camera.height_px) + "]\n  rostopic: /camera/image_raw\n  cam_overlaps: []\n";
}

}  // namespace heba
