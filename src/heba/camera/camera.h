// A camera: a camera model with its parameters.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heba/camera/camera_model.h"

namespace heba {

struct Camera {
  std::string model;  // Name of a model of camera/models.def.
  int width_px = 0;
  int height_px = 0;
  std::vector<double> params;  // Parameters in the order of the model's param_names().

  const CameraModel& Model() const;  // CHECKs that the model exists.
};

// Returns every fault of the camera, one per line: an unknown model, a wrong number of parameters, an image size or a
// focal length that is not positive, values that are not finite. The text is empty if the camera is valid.
std::string CheckCamera(const Camera& camera);

// Returns the pixel of a point; nothing if it has no image.
std::optional<Eigen::Vector2d> ProjectPoint(const Camera& camera, const Eigen::Vector3d& point_in_camera);
// Returns the unit ray of a pixel; nothing if there is none.
std::optional<Eigen::Vector3d> UnprojectPixel(const Camera& camera, const Eigen::Vector2d& pixel);

// Converts the camera to a model that contains its own (brown5 contains pinhole, rational8 contains brown5): the added
// coefficients are zero. The converse conversion is possible if the dropped coefficients are zero. Returns nothing if
// the camera cannot be represented exactly in `model`.
std::optional<Camera> ConvertCamera(const Camera& camera, const std::string& model);

}  // namespace heba
