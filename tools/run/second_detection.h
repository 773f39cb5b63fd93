// Searches images again for the points that a first calibration predicts, but that were not detected.
#pragma once

#include <optional>
#include <vector>

#include "heba/evaluation/finding.h"
#include "heba/run_types.h"

namespace heba {

// Where a calibration predicts the targets in the images of a data set.
struct PredictedImages {
  std::vector<Camera> cameras;
  std::vector<TargetShape> shapes;  // One per target.
  // One per detection; nothing for images that contradict the calibration.
  std::vector<std::optional<Rigid3d>> camera_from_target;
  // RMS of the points of each camera under the calibration, px: the noise of the arms is part of it.
  std::vector<double> rms_px;
};
// Predicts the images of `detections` from the poses that the arms report, with the errors that captures share.
// `problem` has all captures of the data set; of an image that was detected, but that is not used, it has no points.
// `rms_px` has one figure for each camera.
PredictedImages PredictImages(const Problem& problem, const Solution& solution,
                              const std::vector<TargetDetection>& detections, std::vector<double> rms_px);

// Searches again for missing points at their predicted positions. Returns the detections in all images, or nothing if
// none changed. Targets with symmetries, whose points have no ids that could be completed, and given detections are not
// searched for again.
std::optional<std::vector<TargetDetection>> DetectAgain(const Dataset& dataset,
                                                        const std::vector<TargetDetection>& detections,
                                                        const PredictedImages& predicted, int num_threads,
                                                        RunObserver* observer);

// Returns a finding `missing_ids` for each target of which a tenth of the points was never detected, although images
// must show them: another target, or a wrong config of it. It names the target if that has a name.
std::vector<Finding> FindMissingIds(const Dataset& dataset, const std::vector<TargetDetection>& detections,
                                    const PredictedImages& predicted);

// Returns a finding `seen_from_behind` for each target whose points, by their ids, most images show from behind the
// sheet: the ids are mirrored, by another detector or in print, and the pose of the target is that of a sheet turned
// over.
std::vector<Finding> FindSeenFromBehind(const Dataset& dataset, const std::vector<TargetDetection>& detections,
                                        const PredictedImages& predicted);

}  // namespace heba
