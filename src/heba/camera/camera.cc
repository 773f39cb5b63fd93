#include "heba/camera/camera.h"

#include <algorithm>
#include <cmath>

#include "heba/base/error.h"
#include "heba/base/text.h"

namespace heba {

const CameraModel& Camera::Model() const {
  const CameraModel* found = FindCameraModel(model);
  CHECK(found != nullptr) << "camera model " << model;
  return *found;
}

std::string CheckCamera(const Camera& camera) {
  const CameraModel* model = FindCameraModel(camera.model);
  if (model == nullptr) {
    return "camera model " + UnknownCameraModel(camera.model);
  }
  std::vector<std::string> faults;
  if (static_cast<int>(camera.params.size()) != NumParams(*model)) {
    faults.push_back(camera.model + " has " + std::to_string(NumParams(*model)) + " parameters (" +
                     Join(model->param_names(), " ") + "), not " + std::to_string(camera.params.size()));
  }
  if (camera.width_px <= 0 || camera.height_px <= 0) faults.emplace_back("the image size must be positive");
  for (const double value : camera.params) {
    if (!std::isfinite(value)) faults.emplace_back("a parameter is not finite");
  }
  if (camera.params.size() >= 2 && !(camera.params[0] > 0 && camera.params[1] > 0)) {
    faults.emplace_back("fx and fy must be positive");
  }
  return Join(faults, "\n");
}

namespace {
// A ray so close to the optical axis that a distortion of second order is below round-off.
constexpr double kAxialAngle = 1e-8;
}  // namespace

double AxialFocalLength(const Camera& camera, int axis) {
  return AxialFocalLengthByParams(camera, axis)[axis] * camera.params[static_cast<size_t>(axis)];
}

Eigen::VectorXd AxialFocalLengthByParams(const Camera& camera, int axis) {
  Eigen::Vector3d ray = Eigen::Vector3d::UnitZ();
  ray[axis] = kAxialAngle;
  Points2 pixel;
  ProjectionJacobian jacobian;
  CHECK(camera.Model().Project(camera.params.data(), ray, &pixel, &jacobian)) << camera.model;
  const ProjectionJacobian::Rows& rows = axis == 0 ? jacobian.u : jacobian.v;
  Eigen::VectorXd by_params = rows.bottomRows(NumParams(camera.Model())) / kAxialAngle;
  // The principal point displaces the image without scaling it.
  by_params.segment<2>(2).setZero();
  return by_params;
}

std::optional<Eigen::Vector2d> ProjectPoint(const Camera& camera, const Eigen::Vector3d& point_in_camera) {
  Points2 pixels;
  if (!camera.Model().Project(camera.params.data(), point_in_camera, &pixels, nullptr)) return std::nullopt;
  return Eigen::Vector2d(pixels(0, 0), pixels(1, 0));
}

std::optional<Eigen::Vector3d> UnprojectPixel(const Camera& camera, const Eigen::Vector2d& pixel) {
  return camera.Model().Unproject(camera.params.data(), pixel);
}

std::vector<double> DistortionOf(const Camera& camera) { return {camera.params.begin() + 4, camera.params.end()}; }

std::optional<OpenCvLens> OpenCvLensOf(const Camera& camera) { return camera.Model().ToOpenCv(DistortionOf(camera)); }

std::optional<Camera> ConvertCamera(const Camera& camera, const std::string& model) {
  if (camera.model == model) return camera;
  const CameraModel* to = FindCameraModel(model);
  const std::optional<OpenCvLens> lens = OpenCvLensOf(camera);
  if (to == nullptr || !lens) return std::nullopt;
  const std::optional<std::vector<double>> distortion = to->FromOpenCv(*lens);
  if (!distortion) return std::nullopt;
  Camera converted = camera;
  converted.model = model;
  converted.params.resize(4);
  converted.params.insert(converted.params.end(), distortion->begin(), distortion->end());
  return converted;
}

}  // namespace heba
