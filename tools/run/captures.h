// Prepares a data set's captures for calibration: detections in its images, the views made from them, the options.
#pragma once

#include <vector>

#include "heba/rig_run_types.h"
#include "heba/run_types.h"
#include "tools/run/second_detection.h"

namespace heba {

// Returns whether the size of the images is known without any: whether each given detection states it, or the camera.
bool IsImageSizeKnown(const Dataset& dataset);

// Detects the target in all captures by `detect`, or returns the given detections. Throws InputError if images cannot
// be read or differ in size.
std::vector<CaptureDetection> DetectCaptures(const Dataset& dataset, const DetectFunction& detect, int num_threads,
                                             RunObserver* observer);

// Sets the size of the data set's camera, if there is one, to that of the images if it is not stated. Throws
// InputError if the sizes differ.
void FitCameraToImages(const std::vector<CaptureDetection>& detections, Dataset* dataset);

// Returns the data set as that of a rig whose parts have no names (heba/data/hand_eye.h).
RigDataset AsRigDataset(const Dataset& dataset);
// Returns what is known about the scales of a data set's targets and arms. `solved` has the errors of arms that were
// estimated, which makes their lengths those of arms that were calibrated.
ScaleSigmas ScaleSigmasOf(const RigDataset& dataset, const RigProblem& solved);
// Returns the detections as those of such a data set, and back.
std::vector<RigDetection> InRig(const std::vector<CaptureDetection>& detections);
std::vector<CaptureDetection> OutOfRig(std::vector<RigDetection> detections);

// Removes the elements with these indices, which must be in increasing order; an empty list stays as it is.
template <typename T>
void RemoveAt(const std::vector<size_t>& indices, std::vector<T>* list) {
  if (list->empty()) return;
  for (auto index = indices.rbegin(); index != indices.rend(); ++index) {
    list->erase(list->begin() + static_cast<std::ptrdiff_t>(*index));
  }
}

// Returns the view of one capture, an index into Dataset::captures, with the observations in its image.
View ViewOf(const Dataset& dataset, size_t capture, Observations observations);

// Returns camera_from_target of one capture as a solution predicts it from the robot's pose.
Rigid3d PredictedPose(const Dataset& dataset, const Solution& solution, size_t capture);
// Returns PredictedImages of all captures; `rms_px` is that of the points.
PredictedImages PredictCaptures(const Dataset& dataset, const Solution& solution, double rms_px);

// Returns the views of the captures in which the target was seen.
std::vector<View> ViewsOf(const Dataset& dataset, const std::vector<CaptureDetection>& detections);

CalibrationOptions OptionsOf(const Dataset& dataset, const RunOptions& options, int width_px, int height_px);

}  // namespace heba
