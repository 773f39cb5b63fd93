// Cross-validation: the errors of a calibration on captures that it was not estimated from.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "heba/calibration.h"

namespace heba {

// The errors on held-out images of one camera.
struct CameraHoldOut {
  Failure reason;  // The reason if a figure is not set.
  // No figure is set if one of the folds needs the images of this camera to be determined.
  std::optional<double> rms_px;  // Not set if a point had no image.
  // The distance and the angle between the predicted pose of the target and the pose that its own image shows: RMS over
  // the held-out images.
  std::optional<double> target_m;
  std::optional<double> target_rad;
  // The distance of each held-out target, with its capture: an index into Problem::captures.
  std::vector<std::pair<size_t, double>> target_m_of_capture;
};

struct HoldOuts {
  std::vector<CameraHoldOut> of_cameras;  // One per camera.
  // The squared held-out residuals of all images, whitened by all modelled noise (pixels, arms, the covariance of the
  // estimate), per degree of freedom: about 1 if the model is right.
  std::optional<double> chi2_per_dof;
};

// K-fold cross-validation over the captures: a fold holds out captures with all their images, and those at one pose of
// all arms together. The folds use the images, the shapes and the start of `full`, whose adjustment must have
// succeeded; a held-out image is predicted from the poses that the arms report. `progress` is called after each fold,
// by one thread at a time. If a fold is not determined, the images of as few cameras as possible are not held out in
// it; these cameras have no figures, the others do.
HoldOuts CrossValidate(const Calibration& full, const CalibrationOptions& options, int num_folds,
                       const std::function<void()>& progress);

}  // namespace heba
