// A camera: a camera model with its parameters.
//
//   const heba::Camera camera{"brown5", 1280, 960, {1000, 1000, 640, 480, -0.1, 0.02, 0, 0, 0}};
//   const std::optional<Eigen::Vector2d> pixel = heba::ProjectPoint(camera, {0.1, 0.2, 1.0});
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

// Returns the distortion coefficients: the parameters after the principal point.
std::vector<double> DistortionOf(const Camera& camera);
// Returns OpenCV's lens that projects as the camera does; nothing if there is none.
std::optional<OpenCvLens> OpenCvLensOf(const Camera& camera);

// Returns the focal length with which a pinhole camera images the neighbourhood of the optical axis along u (axis 0) or
// v (axis 1) as this camera does, px: fx or fy, unless the model's distortion changes the scale there, as that of the
// unified models does.
double AxialFocalLength(const Camera& camera, int axis);
// Returns the derivatives of AxialFocalLength by the camera's parameters.
Eigen::VectorXd AxialFocalLengthByParams(const Camera& camera, int axis);

// Returns the pixel of a point; nothing if it has no image.
std::optional<Eigen::Vector2d> ProjectPoint(const Camera& camera, const Eigen::Vector3d& point_in_camera);
// Returns the unit ray of a pixel; nothing if there is none.
std::optional<Eigen::Vector3d> UnprojectPixel(const Camera& camera, const Eigen::Vector2d& pixel);

// Converts the camera to a model that projects every point to the same pixel, by way of OpenCV's lenses
// (CameraModel::ToOpenCv and FromOpenCv): rational8 contains brown5, and brown5 contains the rational8 whose last three
// coefficients are 0. Returns nothing if the camera cannot be represented exactly in `model`, or if there is no such
// model.
std::optional<Camera> ConvertCamera(const Camera& camera, const std::string& model);

}  // namespace heba
