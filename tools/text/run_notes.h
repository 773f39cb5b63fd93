// What a run of several cameras and targets notes: which images show what, and which were not used.
#pragma once

#include <string>
#include <vector>

#include "heba/run_types.h"

namespace heba {

// Returns a line for each camera and target: how many images of the camera determine a pose of the target.
std::vector<std::string> DetectionNotes(const Dataset& data, const std::vector<TargetDetection>& detections);

// Returns a line for each image that was not used, or of which a target was not used: with its capture, its camera and
// the reason. Images of one camera with one reason have one line, with the first and the last of them.
std::vector<std::string> LeftOutNotes(const std::vector<ImageResult>& images);

}  // namespace heba
