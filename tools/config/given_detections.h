// Detections that were made before, and that replace images.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "heba/detection.h"
#include "heba/rig_run_types.h"

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
// InputError if there are none, or if one is malformed.
std::vector<GivenDetections> ReadGivenDetections(const std::filesystem::path& folder);

// Returns the names of the images of a camera, as paths without a folder, in the order of the files.
std::vector<std::filesystem::path> ImagesOf(const std::string& camera, const std::vector<GivenDetections>& given);

// Returns the detections in the images of the captures of `data`, whose names, cameras and targets are set. Throws
// InputError if a file is of another target, or as CheckGivenDetection does.
std::vector<RigDetection> DetectionsOfCaptures(const RigDataset& data, const std::vector<GivenDetections>& given);

}  // namespace heba
