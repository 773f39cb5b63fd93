// Prepares a data set's captures for calibration: detections in its images, the views made from them, the options.
#pragma once

#include <vector>

#include "heba/pair_run_types.h"
#include "heba/run_types.h"
#include "tools/run/second_detection.h"

namespace heba {

// Returns whether the size of the images is known without any: whether each given detection states it, or the camera.
bool IsImageSizeKnown(const PairDataset& dataset);

// Detects the target in all captures by `detect`, or returns the given detections. Throws InputError if images cannot
// be read or differ in size.
std::vector<CaptureDetection> DetectCaptures(const PairDataset& dataset, const DetectFunction& detect, int num_threads,
                                             RunObserver* observer);

// Sets the size of the data set's camera, if there is one, to that of the images if it is not stated. Throws
// InputError if the sizes differ.
void FitCameraToImages(const std::vector<CaptureDetection>& detections, PairDataset* dataset);

// Returns the data set in the general form, whose parts have no names (heba/data/hand_eye.h).
Dataset AsDataset(const PairDataset& dataset);
// Returns what is known about the scales of a data set's targets and arms. `solved` has the errors of arms that were
// estimated, which makes their lengths those of arms that were calibrated.
ScaleSigmas ScaleSigmasOf(const Dataset& dataset, const Problem& solved);
// Returns the detections as those of such a data set, and back.
std::vector<TargetDetection> AsTargetDetections(const std::vector<CaptureDetection>& detections);
std::vector<CaptureDetection> AsCaptureDetections(std::vector<TargetDetection> detections);

// Returns the entry of a capture that is not used, without a reason.
ImageResult EntryOfUnused(const Capture& capture);

// Removes the elements with these indices, which must be in increasing order; an empty list stays as it is.
template <typename T>
void RemoveAt(const std::vector<size_t>& indices, std::vector<T>* list) {
  if (list->empty()) return;
  for (auto index = indices.rbegin(); index != indices.rend(); ++index) {
    list->erase(list->begin() + static_cast<std::ptrdiff_t>(*index));
  }
}

// Returns the view of one capture, an index into PairDataset::captures, with the observations in its image.
View ViewOf(const PairDataset& dataset, size_t capture, Observations observations);

// Returns camera_from_target of one capture as a solution predicts it from the robot's pose.
Rigid3d PredictedPose(const PairDataset& dataset, const PairSolution& solution, size_t capture);
// Returns PredictedImages of all captures; `rms_px` is that of the points.
PredictedImages PredictCaptures(const PairDataset& dataset, const PairSolution& solution, double rms_px);

// Returns the views of the captures in which the target was seen.
std::vector<View> ViewsOf(const PairDataset& dataset, const std::vector<CaptureDetection>& detections);

PairCalibrationOptions OptionsOf(const PairDataset& dataset, const PairRunOptions& options, int width_px,
                                 int height_px);

}  // namespace heba
