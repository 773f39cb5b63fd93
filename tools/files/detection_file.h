// Reads and writes detections.json.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "heba/detection.h"
#include "heba/run_types.h"

namespace heba {

// The detections in images, with the names of these.
using NamedDetections = std::vector<std::pair<std::string, CaptureDetection>>;

// Writes detections as JSON: {"schema": "heba/detections/1", "captures": [{"image", "image_size", "ids": [...],
// "pixels": [[u, v], ...], "reason"}]}. Pixel (0, 0) is the centre of the first pixel.
std::string DetectionsToJson(const NamedDetections& detections);

// Writes the detections of a data set into a folder: the file detections.json if its camera has no name; otherwise the
// folder `detections`, which must not exist, with a file CAMERA.TARGET.json for each pair, with the images of that
// camera. Throws OutputError if a file cannot be written.
void WriteDetections(const Dataset& data, const std::vector<TargetDetection>& detections,
                     const std::filesystem::path& folder);

// Reads a file of detections: the name and detection of each capture, without covariances. `schema` and `reason` may be
// missing. Throws InputError if the file is malformed or has another schema.
NamedDetections ReadDetections(const std::filesystem::path& path);

}  // namespace heba
