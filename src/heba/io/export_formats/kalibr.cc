// Kalibr's camchain.
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
                   " is " + Significant(camera.params[i], 3) +
                   ", not 0; calibrate it with the model brown4, which has none, or export as camera_info or opencv"};
  }
  return Failure{"Kalibr has no equivalent of the camera model " + camera.model + "; export as opencv"};
}

// Returns the entry of one camera, without its name.
Outcome<std::string> CameraLines(const ExportRequest& request) {
  const Outcome<Camera> held = ForKalibr(request.camera);
  if (!held) return Failure{held.reason()};
  const Camera& camera = *held;
  const KalibrNames& names = camera.Model().facts().kalibr;
  const auto projection_end = camera.params.begin() + 4 + names.num_projection;
  // Kalibr writes the coefficients of the projection before the focal lengths.
  std::vector<double> intrinsics(camera.params.begin() + 4, projection_end);
  intrinsics.insert(intrinsics.end(), camera.params.begin(), camera.params.begin() + 4);
  const std::vector<double> distortion(projection_end, camera.params.end());
  return "  camera_model: " + names.camera_model + "\n  intrinsics: [" + JoinNumbers(intrinsics, ", ") +
         "]\n  distortion_model: " + names.distortion_model + "\n  distortion_coeffs: [" +
         JoinNumbers(distortion, ", ") + "]\n  resolution: [" + std::to_string(camera.width_px) + ", " +
         std::to_string(camera.height_px) + "]\n";
}

}  // namespace

Outcome<std::string> ExportPoses_kalibr(const std::vector<ExportRequest>& cameras) {
  std::vector<std::string> remarks;
  std::string text;
  std::vector<std::string> numbers;
  for (size_t c = 0; c < cameras.size(); ++c) numbers.push_back(std::to_string(c));
  for (size_t c = 0; c < cameras.size(); ++c) {
    const ExportRequest& request = cameras[c];
    const Outcome<std::string> lines = CameraLines(request);
    if (!lines) return Failure{(cameras.size() > 1 ? request.child_frame + ": " : "") + lines.reason()};
    if (request.parent_frame != cameras.front().parent_frame) {
      return Failure{"a camchain holds cameras on one mount, and these are on " + cameras.front().parent_frame +
                     " and on " + request.parent_frame};
    }
    for (const std::string& remark : ExportRemarks(request)) remarks.push_back(remark);
    remarks.push_back("camera in parent, x y z qx qy qz qw (a camchain cannot hold it): " +
                      JoinNumbers(TranslationAndQuaternion(request.parent_from_child), " "));
    text += "cam" + numbers[c] + ":\n" + *lines;
    std::vector<std::string> others = numbers;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(c));
    const bool is_one = cameras.size() == 1;
    text += "  rostopic: /" + (is_one ? "camera" : PlainText(request.child_frame)) + "/image_raw\n  cam_overlaps: [" +
            Join(others, ", ") + "]\n";
    if (c == 0) continue;
    // The pose of the camera before in this one.
    const Eigen::Matrix4d matrix = (Inverse(request.parent_from_child) * cameras[c - 1].parent_from_child).Matrix();
    text += "  T_cn_cnm1:\n";
    for (Eigen::Index row = 0; row < 4; ++row) {
      const std::vector<double> values = {matrix(row, 0), matrix(row, 1), matrix(row, 2), matrix(row, 3)};
      text += "  - [" + JoinNumbers(values, ", ") + "]\n";
    }
  }
  return CommentLines(remarks, "# ") + text;
}

Outcome<std::string> ExportFormat_kalibr(const ExportRequest& request) { return ExportPoses_kalibr({request}); }

}  // namespace heba
