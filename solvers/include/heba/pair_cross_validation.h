// Cross-validation of a pair: the errors of every method on captures that it was not estimated from.
//
//   for (const heba::HoldOut& error : heba::CrossValidate(calibration, options, 5, num_threads, [] {})) {
//     if (error.rms_px) Show(error.method, *error.rms_px);
//   }
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "heba/pair_calibration.h"

namespace heba {

struct HoldOut {
  std::string method;
  std::optional<double> rms_px;  // Not set if the method failed on a fold, or if a held-out point had no image.
  Failure reason;                // The reason if `rms_px` is not set.
  // The distance between the predicted pose of the target and the pose that its own image shows: RMS over captures.
  std::optional<double> target_m;
  std::optional<double> target_rad;
  // The same distance for each held-out capture, with the capture's index (View::capture).
  std::vector<std::pair<size_t, double>> target_m_of_capture;
  // For a refinement of reprojection errors: the squared held-out residuals, whitened by all sources of error (pixel
  // noise, the robot noise if it is modelled, the covariance of the estimate), per degree of freedom. About 1 if the
  // model is right. If robot noise is modelled, this figure and not `rms_px` tells which model predicts better.
  std::optional<double> chi2_per_dof;
  // The RMS of the held-out residuals of any method, in sigmas of the noise that the refinement of the same fold
  // estimated (pixel and robot noise, without the covariance of the estimate). About 1 for an exact estimate.
  std::optional<double> sigmas;
};

// K-fold cross-validation over the robot's poses. The captures of pose i are held out in fold i modulo `num_folds` and
// predicted from the robot pose alone, by every method and the refinement, all on the same folds. Captures of home and
// of the translations of a two-step motion (View::role) are never held out, and are not counted in i. Held-out views
// are not used for anything else: if no camera is given, each fold estimates its own and takes only the initial guess
// from `full`. `full` is the calibration of all captures with the same options; its views (in the reading order chosen
// there) and its error model are used in all folds. If the refinement fails on less than half of the folds, these are
// left out for all methods. `progress` is called after each fold, by one thread at a time.
std::vector<HoldOut> CrossValidate(const PairCalibration& full, const PairCalibrationOptions& options, int num_folds,
                                   int num_threads, const std::function<void()>& progress);

// Likewise for a calibration from poses of the target (CalibratePoses): errors of the target's pose, without pixels.
// The folds use the model of the robot's errors that was chosen from all captures.
std::vector<HoldOut> CrossValidatePoses(const PairCalibration& full, const PoseCalibrationOptions& options,
                                        int num_folds);

}  // namespace heba
