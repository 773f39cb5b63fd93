// Runs the whole calibration of any number of cameras, targets and arms, from detected points to a refined result:
// cameras (if they are not given), a calibration of every pair of a camera and a target, their joint start, outliers,
// adjustment.
//
//   const heba::Outcome<heba::Calibration> calibration = heba::Calibrate(problem, heba::CalibrationOptions());
//   if (calibration && calibration->refined) Use(calibration->refined->poses, calibration->refined->covariance);
#pragma once

#include <vector>

#include "heba/base/error.h"
#include "heba/calibration_types.h"
#include "heba/data/problem.h"
#include "heba/evaluation/finding.h"

namespace heba {

// Calibrates all cameras, targets and arms of a problem together. A pair that one arm moves is calibrated by itself
// first (CalibratePair); the results are joined over a spanning tree of the best determined ones, together with pairs
// that nothing moves. Images that contradict the others, and captures of which the pose of an arm does, are listed in
// `unused` and not used, unless the loss is `none`.
//
// Returns a Failure, in words, if a camera cannot be estimated, if all images of a camera belong to other captures, or
// if a camera, target or arm is not joined to the others by any image. The Failure of the adjustment is in
// Calibration::refined.
Outcome<Calibration> Calibrate(const Problem& problem, const CalibrationOptions& options);

// A FitQuality tells a calibration, whose adjustment succeeded, from another one of the same images.
struct FitQuality {
  int num_images = 0;                   // Images in use.
  std::vector<double> pixel_sigmas_px;  // One per camera.
};
FitQuality QualityOf(const Calibration& calibration);
FitQuality QualityOf(const PairCalibration& calibration);

// Returns whether a calibration is no worse than another one of the same images: it uses at least as many, and the
// residuals of no camera are more than 5 % larger.
bool IsAtLeastAsGood(const FitQuality& calibration, const FitQuality& other);

// Returns a finding `held_intrinsics`, and the change of the estimate, for each camera whose intrinsics were held and
// contradict the images and the poses of the arms, by a joint F-test of their changes in an adjustment that frees them,
// with all images of the camera: wrong intrinsics make images outliers. Cameras that no arm moves against a target, and
// those whose intrinsics cannot be freed, have none. `problem` is the one that was calibrated.
Advice DiagnoseHeldIntrinsics(const Problem& problem, const Calibration& calibration, const AdjustmentOptions& options);

// Returns the findings about a calibration whose adjustment succeeded: cameras that were moved during the captures, and
// arms whose poses have smooth errors. `problem` is the one that was calibrated.
std::vector<Finding> DiagnoseCalibration(const Problem& problem, const Calibration& calibration);

// Returns a finding `weak_direction` for each camera of a calibration whose adjustment succeeded. It has a part
// `weak_direction_of` for each direction of the camera's pose or intrinsics, and of the targets' poses if there is one
// camera, whose sigma exceeds what a robot cell usually needs; if there is none, the finding is good and has the
// direction that comes next. The part `suggested_captures` has the two captures that reduce the sigma of the first
// direction most, unless none reduce it much. The candidates are motions of every target in every camera that an arm
// moves, starting from a few of the captures; they count with everything that all cameras would see there.
std::vector<Finding> DiagnoseWeakDirectionsOf(const Calibration& calibration);

}  // namespace heba
