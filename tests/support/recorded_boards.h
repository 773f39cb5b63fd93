// Runs a detector over a folder of images that one camera took of one target.
#pragma once

#include <filesystem>
#include <set>
#include <string>

#include "heba/target.h"

namespace heba {

struct RecordedBoards {
  size_t num_points = 0;
  std::set<std::string> not_found;   // File names of images without any point.
  std::set<std::string> incomplete;  // File names of images with some, but not all points.
  // RMS of cv::calibrateCamera over all images, which reveals wrong and inaccurate corners.
  double rms_px = 0;
};

// Detects in every `step`-th image by name, and in the images named in `always`.
RecordedBoards DetectRecorded(const Target& target, const std::filesystem::path& folder, size_t step = 1,
                              const std::set<std::string>& always = {});

}  // namespace heba
