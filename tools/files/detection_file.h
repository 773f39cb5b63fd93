// detections.json.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "heba/data/dataset.h"
#include "targets/detection.h"

namespace heba {

// {"schema": "heba/detections/1", "captures": [{"image", "image_size", "ids": [...], "pixels": [[u, v], ...],
// "reason"}]}; pixel (0, 0) is the centre of the first pixel.
std::string DetectionsToJson(const std::vector<Capture>& captures, const std::vector<CaptureDetection>& detections);

// Reads such a file: the name and detection of each capture, without covariances. InputError on a fault.
std::vector<std::pair<std::string, CaptureDetection>> ReadDetections(const std::filesystem::path& path);

}  // namespace heba
