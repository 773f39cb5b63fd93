// Runs a whole calibration of a rig: from a data set (the images of its cameras and the poses of its arms) to a result
// with its errors, uncertainties and findings. This is all that `heba run` does with a rig between its config and its
// files.
#pragma once

#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/rig_run_types.h"

namespace heba {

// Detects the targets in the images of all cameras, or returns the given detections. `detect`: RigRunOptions::detect.
// Throws InputError if an image cannot be read, if the images of one camera differ in size, or if two cameras have the
// same images.
std::vector<RigDetection> DetectRig(const RigDataset& dataset, const std::vector<DetectFunction>& detect,
                                    int num_threads, RunObserver* observer);

// Throws the InputError of FitCamerasToImages by the header of each camera's first image, before any is decoded.
void CheckCamerasByHeader(const RigDataset& dataset);

// Sets the sizes of the cameras of `rig`, which are those of the data set, to those of their images. Throws InputError
// if a given camera is for images of another size.
void FitCamerasToImages(const RigDataset& dataset, const std::vector<RigDetection>& detections, RigProblem* rig);

// Detects, calibrates and assesses the result on held-out captures. `observer` may be null; it is told about the stages
// only. Returns a Failure if the result cannot be trusted, or if the run was cancelled. Throws InputError if the data
// set is incomplete or an image cannot be read.
Outcome<RigRunOutput> RunRig(const RigDataset& dataset, const RigRunOptions& options, RunObserver* observer = nullptr);

// Returns why two targets of a rig cannot be told apart in one image (Target::Codes), in words; empty if they can.
std::string WhyNotToldApart(const RigDataset& dataset);

}  // namespace heba
