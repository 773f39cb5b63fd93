// The entries of a result about each image and each capture.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "heba/run_types.h"
#include "tools/run/calibrated_images.h"
#include "tools/run/second_detection.h"

namespace heba {

// Returns where a calibration predicts the targets in the images of the detections, with the RMS of each camera.
PredictedImages PredictionsOf(const Calibration& calibration, const std::vector<TargetDetection>& detections);

// Returns the errors of each camera over the images that are used, with the poses of the arms as given. `used` has the
// points that the solution uses.
std::vector<SquaredErrors> ErrorsOfCameras(const Problem& used, const Solution& solution);

// Returns the entries of the images of all captures, used or not. `used` has the points that the solution uses, and
// `loss` is that of the adjustment.
std::vector<ImageResult> ImageResults(const ImageRun& run, const CalibratedImages& calibrated, const Problem& used,
                                      LossKind loss);

// Returns the poses of the arms in all captures, with the corrections of those of which an image is used, unless the
// arms have no noise: the noise together with the errors that captures share.
std::vector<CapturePoses> CaptureResults(const Dataset& dataset, const Problem& used, const Solution& solution);

// The distances of held-out targets of one camera, each with its capture: an index into Dataset::captures.
using DistancesOfCaptures = std::vector<std::pair<size_t, double>>;
// Returns the images with their held-out distances; there is a list for each camera.
std::vector<ImageResult> WithHeldOutDistances(std::vector<ImageResult> images, const Dataset& dataset,
                                              const std::vector<DistancesOfCaptures>& of_cameras);

// Returns the entries of what was left out before the images were searched: one for each image, or one without an
// image.
std::vector<ImageResult> LeftOutResults(const Dataset& dataset);

// Returns the entries of images in the order of the captures of a data set, with their roles. Those of no capture come
// last.
std::vector<ImageResult> InOrderOfCaptures(std::vector<ImageResult> images, const Dataset& dataset);

}  // namespace heba
