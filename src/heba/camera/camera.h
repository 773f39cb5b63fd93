// One camera: a model with its parameters.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heba/camera/camera_model.h"

namespace heba {

struct Camera {
  std::string model;  // A name of camera/models.def.
  int width_px = 0;
  int height_px = 0;
  std::vector<double> params;  // As the model's param_names().

  const CameraModel& Model() const;  // CHECKs that the model exists.
};

// Every fault of the camera, one a line: unknown model, number of parameters, size, values that are not finite, focal
// lengths that are not positive. Empty if there is none.
std::string CheckCamera(const Camera& camera);

// The pixel of a point; nothing if it has no image.
std::optional<Eigen::Vector2d> ProjectPoint(const Camera& camera, const Eigen::Vector3d& point_in_camera);
// The unit ray of a pixel; nothing if there is none.
std::optional<Eigen::Vector3d> UnprojectPixel(const Camera& camera, const Eigen::Vector2d& pixel);

// The same camera in a model that contains its own (pinhole in brown5 in rational8: the coefficients added are zero);
// nothing if `model` does not contain it.
std::optional<Camera> ConvertCamera(const Camera& camera, const std::string& model);

}  // namespace heba
