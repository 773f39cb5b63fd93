// The folder of a finished run, read to locate targets with its result.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "heba/evaluation/run_result.h"
#include "heba/target.h"
#include "tools/config/run_config_types.h"

namespace heba {

struct FinishedRun {
  // The symmetries of its targets, and the extents of their shapes, are set.
  RunResult result;
  std::vector<std::shared_ptr<const Target>> targets;  // Their points are where the run found them.
  std::vector<PoseReading> pose_readings;              // One per arm.
  std::vector<bool> joints_are_deg;                    // Likewise: whether its recorded joints are in degrees.
  RobotNoise wobble;                                   // ReadWobble.
};

// Throws InputError if the run cannot be read, or if that of a single camera has no refined estimate from images or
// corners.
FinishedRun ReadFinishedRun(const std::filesystem::path& path);

// Returns the detection of a target in an image of a camera. Throws InputError, which begins with the image, if it
// cannot be read or does not have the size of those of the calibration.
Detection DetectFor(const Camera& camera, const Target& target, const std::filesystem::path& image);
// Throws InputError, which begins with `image`, unless it has the size of those of the calibration.
void CheckImageSize(const Camera& camera, const ImageSize& size, const std::string& image);

}  // namespace heba
