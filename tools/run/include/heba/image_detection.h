// Detects the targets in the images of all cameras of a data set, and checks the size of the images.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "heba/detection.h"
#include "heba/run_types.h"
#include "heba/target.h"

namespace heba {

// Detects the targets in the images of all cameras, or returns the given detections. `detect`: RunOptions::detect.
// Throws InputError if an image cannot be read, if the images of one camera differ in size, or if two cameras have the
// same images.
std::vector<TargetDetection> DetectDataset(const Dataset& dataset, const std::vector<DetectFunction>& detect,
                                           int num_threads, RunObserver* observer);

// Throws the InputError of WithImageSizes by the header of each camera's first image, before any is decoded.
void CheckCamerasByHeader(const Dataset& dataset);

// Returns the rig of the data set with the sizes of the images for those of its cameras. Throws InputError if a given
// camera is for images of another size.
Problem WithImageSizes(const Dataset& dataset, const std::vector<TargetDetection>& detections);

// Detects a target in an image (DetectCapture) and computes the digest of the image, by which Run recognises captures
// with one image.
CaptureDetection DetectWithDigest(const Target& target, const std::filesystem::path& image,
                                  const std::optional<ImageSize>& expected);

}  // namespace heba
