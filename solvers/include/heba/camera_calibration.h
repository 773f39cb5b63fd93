// Calibrates a camera alone, from images of a target that somebody moved: no robot.
//
//   heba::CameraCalibrationOptions options;
//   options.width_px = 1280;
//   options.height_px = 960;
//   const heba::Outcome<heba::CameraCalibration> calibration = heba::CalibrateCamera(views, options);
//   if (calibration) Use(calibration->camera, calibration->covariance);
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heba/base/error.h"
#include "heba/camera/camera.h"
#include "heba/data/loss_kind.h"
#include "heba/data/pair_problem.h"
#include "heba/data/target_shape.h"

namespace heba {

struct CameraCalibrationOptions {
  std::string model;  // The model of the lens; empty: chosen.
  int width_px = 0;
  int height_px = 0;
  TargetShape shape;        // The target as designed.
  bool choose_bend = true;  // Whether the bend of the target is estimated if the images require it.
  LossKind loss = LossKind::kTruncated;
  int folds = 5;        // Number of folds of the cross-validation; 0: none.
  int num_threads = 1;  // The result does not depend on it.
};

// One model of the lens, with a pose of the target for each view.
struct LensFit {
  std::string model;
  std::optional<Camera> camera;  // Nothing if it could not be estimated; `reason` says why.
  Failure reason = {};
  double rms_px = 0;
  double log_likelihood = 0;  // It is that of all points, relative to that of the model with the largest one.
  std::optional<double> holdout_rms_px = {};
  bool is_bent = false;  // Whether the bend of the target was estimated.
};

// The outcome for one view.
struct CameraViewOutcome {
  std::string name;
  size_t capture = 0;  // View::capture.
  bool used = false;
  int num_rejected = 0;
  double rms_px = 0;
  Rigid3d camera_from_target;
};

struct CameraCalibration {
  Camera camera;
  // The covariance is that of the parameters of the camera, in their order; the noise that it is based on has
  // `covariance_dof` degrees of freedom.
  Eigen::MatrixXd covariance;
  double covariance_dof = 0;
  TargetShape shape;
  double pixel_sigma_px = 0;
  std::vector<LensFit> lenses;  // In the order of CameraModelNames.
  size_t chosen = 0;            // The place of the model that was chosen in `lenses`.
  std::vector<CameraViewOutcome> views;
};

// Calibrates from views, whose mounts are not used. Each model is refined together with a pose of the target for each
// view and, unless the images do not require it (F-test, p > 0.001), its bend: a flat target makes the lens take the
// bend. Of the polynomial models the smallest is chosen that no larger one rejects (LensComparison); another model is
// chosen if its likelihood is higher by more than BIC asks for. Returns the Failure of the largest model that was tried
// if none can be estimated. The size of a target without a robot is that of its design.
Outcome<CameraCalibration> CalibrateCamera(const std::vector<View>& views, const CameraCalibrationOptions& options);

// The uncertainty of the projection at places in the image, px: the root of the mean variance of the two pixel
// coordinates of a far point that is seen there, after the rotation of the camera that compensates most of it over the
// image (Kogan, mrcal: "projection uncertainty"). `columns` x `rows` places, row by row; infinite where a pixel has no
// ray.
std::vector<double> ProjectionSigmasPx(const CameraCalibration& calibration, int columns, int rows);

}  // namespace heba
