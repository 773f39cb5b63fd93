// Prepares a data set's captures for calibration: what is known of its images, targets and arms, and the views of one
// camera, one target and one arm with their options.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "heba/data/scale_sigmas.h"
#include "heba/data/smooth_errors.h"
#include "heba/run_types.h"
#include "tools/run/second_detection.h"

namespace heba {

// Returns whether a data set has one camera, one target and one arm that moves one against the other.
bool IsSinglePair(const Dataset& dataset);
// Returns the setup of such a data set.
Setup SetupOf(const Dataset& dataset);

// Returns whether the size of the images is known without any: whether each given detection states it, or its camera.
bool IsImageSizeKnown(const Dataset& dataset);

// Returns what is known about the scales of a data set's targets and arms. `solved` has the errors of arms that were
// estimated, which makes their lengths those of arms that were calibrated.
ScaleSigmas ScaleSigmasOf(const Dataset& dataset, const Problem& solved);
// Returns the largest sigma of the scale of an arm's translations, if no errors of the arm are estimated.
double RobotScaleSigmaOf(const Dataset& dataset);

// Returns how messages and results call the image of a camera in a capture: the capture if it has no image.
std::string ImageOf(const Dataset& dataset, size_t capture, size_t camera);

// Moves captures to those that are left out, with these reasons.
Dataset WithoutCaptures(Dataset dataset, const std::map<size_t, std::string>& reason_of);

// The errors of the arm at each capture of a data set. An empty list stands for those of an exact arm.
struct EffectsOfCaptures {
  std::vector<std::shared_ptr<const PoseEffect>> effects = {};  // View::effect.
  std::vector<Matrix6X> gripper_by_joints = {};                 // View::gripper_by_joints.
};

// Returns the effects of smooth errors at the captures of the only arm.
std::vector<std::shared_ptr<const PoseEffect>> EffectsAt(const Dataset& dataset, const SmoothErrors& errors);

// Returns the view of one capture, an index into Dataset::captures, of the only camera with the observations in its
// image.
View ViewOf(const Dataset& dataset, size_t capture, Observations observations, const EffectsOfCaptures& effects = {});
// Returns the views of the captures in which the only target was seen.
std::vector<View> ViewsOf(const Dataset& dataset, const std::vector<TargetDetection>& detections,
                          const EffectsOfCaptures& effects = {});

// Returns PredictedImages of all detections by a solution; `rms_px` is that of the points.
PredictedImages PredictCaptures(const Dataset& dataset, const std::vector<TargetDetection>& detections,
                                const EffectsOfCaptures& effects, const PairSolution& solution, double rms_px);

// Returns the options of the calibration of the only camera, whose size is that of its images.
PairCalibrationOptions OptionsOf(const Dataset& dataset, const RunOptions& run);

}  // namespace heba
