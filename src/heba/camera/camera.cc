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
    return "camera model '" + camera.model + "' is unknown; one of: " + Join(CameraModelNames(), ", ");
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

std::optional<Eigen::Vector2d> ProjectPoint(const Camera& camera, const Eigen::Vector3d& point_in_camera) {
  Points2 pixels;
  if (!camera.Model().Project(camera.params.data(), point_in_camera, &pixels, nullptr)) return std::nullopt;
  return Eigen::Vector2d(pixels(0, 0), pixels(1, 0));
}

std::optional<Eigen::Vector3d> UnprojectPixel(const Camera& camera, const Eigen::Vector2d& pixel) {
  return camera.Model().Unproject(camera.params.data(), pixel);
}

std::optional<Camera> ConvertCamera(const Camera& camera, const std::string& model) {
  const CameraModel* to = FindCameraModel(model);
  if (to == nullptr) return std::nullopt;
  const std::vector<std::string>& from_names = camera.Model().param_names();
  const std::vector<std::string>& to_names = to->param_names();
  // The parameters of a polynomial model are the first ones of the next larger model, in the same order. Fisheye
  // coefficients have the same names but a different meaning.
  if (camera.model != model && (camera.model == "kannala_brandt4" || model == "kannala_brandt4")) return std::nullopt;
  if (from_names.size() > to_names.size()) {
    for (size_t i = to_names.size(); i < from_names.size(); ++i) {
      if (camera.params[i] != 0.0) return std::nullopt;
    }
  }
  Camera converted = camera;
  converted.model = model;
  converted.params.resize(to_names.size(), 0.0);
  return converted;
}

}  // namespace heba
