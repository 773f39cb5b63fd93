// How good every method is on captures that it has not seen.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "solvers/calibration/calibration.h"

namespace heba {

struct HoldOut {
  std::string method;
  std::optional<double> rms_px;  // Nothing if the method failed on a fold, or if a held-out point had no image.
  std::string reason;            // Then why.
  // How far the target was from where it was predicted, by its picture's own pose: root mean squares over captures.
  std::optional<double> target_m;
  std::optional<double> target_rad;
  // The same of each capture that was held out, by its view's name.
  std::vector<std::pair<std::string, double>> target_m_of_view;
  // Of a refinement of reprojection errors: the held-out pixels' squares in the metric of all that may move them (pixel
  // noise, the robot's if it is modelled, the estimate's own uncertainty), per degree of freedom. About 1 if the model
  // is right; with the robot's noise in it, this and not rms_px says which model predicts better.
  std::optional<double> chi2_per_dof;
  // The held-out residuals of any method in sigmas of the noise that the refinement of the same fold found (pixels and
  // robot, not the estimates' own uncertainty), root mean square. About 1 for an estimate that is exact.
  std::optional<double> sigmas;
};

// K-fold cross-validation over the robot's poses: the captures of pose i are held out in fold i modulo `num_folds`
// (home and the translations of a two-step motion, View::role, never are: poses are counted without them) and predicted
// from the robot's pose alone, by every method and the refinement, all on the same folds. Nothing of a held-out view is
// used, the camera included when none is given, but where the search for it begins. The views are `full`'s (in their
// decided order), the calibration of all of them with the same options; the model of the errors that it chose is every
// fold's. `progress` is called after each fold, from one thread at a time.
std::vector<HoldOut> CrossValidate(const Calibration& full, const CalibrationOptions& options, int num_folds,
                                   int num_threads, const std::function<void()>& progress);

}  // namespace heba
