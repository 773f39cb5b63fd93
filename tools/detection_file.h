// detections.json.
#pragma once

#include <string>
#include <vector>

#include "heba/data/dataset.h"
#include "targets/detection.h"

namespace heba {

// {"schema": "heba/detections/1", "captures": [{"image", "image_size", "ids": [...], "pixels": [[u, v], ...],
// "reason"}]}; pixel (0, 0) is the centre of the first pixel.
std::string DetectionsToJson(const std::vector<Capture>& captures, const std::vector<CaptureDetection>& detections);

}  // namespace heba
