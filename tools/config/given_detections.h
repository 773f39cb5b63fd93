// Detections that were made before, and that replace images.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "heba/detection.h"
#include "heba/run_types.h"

namespace heba {

// Throws InputError, which begins with `where`, unless every point is one of the target, is listed once, and lies in a
// possible image.
void CheckGivenDetection(const Target& target, const Detection& detection, const std::string& where);

// The detections of one target in the images of one camera, with the names of the images.
struct GivenDetections {
  std::string camera;
  std::string target;
  std::filesystem::path file;
  std::vector<std::pair<std::string, CaptureDetection>> images;
};
// Reads the files CAMERA.TARGET.json of a folder, as runs and `heba detect` write them for several cameras. Throws
// InputError if there are none, if one is malformed, or if an image has no name or is listed twice in one.
std::vector<GivenDetections> ReadGivenDetections(const std::filesystem::path& folder);

// Returns the names of the images of a camera, as paths without a folder: in the order of the files or, if these list
// different images, sorted by name.
std::vector<std::filesystem::path> ImagesOf(const std::string& camera, const std::vector<GivenDetections>& given);

// Returns a detection of each target in each image of the captures of `data`, whose names, cameras and targets are set;
// it has no points if no file has any. Throws InputError if a file is of another target, or as CheckGivenDetection
// does.
std::vector<TargetDetection> DetectionsOfCaptures(const Dataset& data, const std::vector<GivenDetections>& given);

}  // namespace heba
