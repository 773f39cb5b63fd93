// Prepares a data set's captures for calibration: detections in its images, the views made from them, the options.
#pragma once

#include <vector>

#include "heba/run_types.h"

namespace heba {

// Ends a run that was cancelled. Run catches it.
struct Cancelled {};

// Reports the steps of one stage to an observer, which may be null.
class StageReport {
 public:
  // Throws Cancelled if the run is to end.
  StageReport(RunStage stage, int num_steps, RunObserver* observer);
  ~StageReport();
  StageReport(const StageReport&) = delete;
  StageReport& operator=(const StageReport&) = delete;
  // Throws Cancelled if the run is to end. Not thread-safe.
  void Step();

 private:
  RunStage stage_;
  RunObserver* observer_;
};

// Throws Cancelled if the run is to end.
void EndIfCancelled(RunObserver* observer);

// Returns whether the size of the images is known without any: whether each given detection states it, or the camera.
bool IsImageSizeKnown(const Dataset& dataset);

// Detects the target in all captures by `detect`, or returns the given detections. Throws InputError if images cannot
// be read or differ in size.
std::vector<CaptureDetection> DetectCaptures(const Dataset& dataset, const DetectFunction& detect, int num_threads,
                                             RunObserver* observer);

// Throws the InputError of FitCameraToImages by the header of the first image, before any is decoded.
void CheckCameraByHeader(const Dataset& dataset);

// Sets the size of the data set's camera, if there is one, to that of the images if it is not stated. Throws
// InputError if the sizes differ.
void FitCameraToImages(const CaptureDetection& first, Dataset* dataset);

// Returns the view of one capture, an index into Dataset::captures, with the observations in its image.
View ViewOf(const Dataset& dataset, size_t capture, Observations observations);

// Returns camera_from_target of one capture as a solution predicts it from the robot's pose.
Rigid3d PredictedPose(const Dataset& dataset, const Solution& solution, size_t capture);

// Returns the views of the captures in which the target was seen.
std::vector<View> ViewsOf(const Dataset& dataset, const std::vector<CaptureDetection>& detections);

CalibrationOptions OptionsOf(const Dataset& dataset, const RunOptions& options, int width_px, int height_px);

}  // namespace heba
