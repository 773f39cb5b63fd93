// The folder of a finished run, read to locate targets with its result.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "heba/detection.h"
#include "heba/evaluation/evaluation.h"
#include "heba/target.h"
#include "tools/config/run_config.h"

namespace heba {

struct FinishedRun {
  RunResult result;
  std::shared_ptr<const Target> target;
  PoseReading pose_reading;
  bool joints_are_deg = false;

  const Solution& solution() const { return *FindRefined(result)->solution; }
  // Returns the arm, or null if its errors were not estimated.
  const RobotSummary* FindArm() const;
};

// Throws InputError if the folder has no refined estimate from images or corners.
FinishedRun ReadFinishedRun(const std::filesystem::path& folder);

// Throws InputError, which begins with `image`, if an image does not have the size of those of the run.
void CheckImageSize(const FinishedRun& run, const CaptureDetection& seen, const std::string& image);

}  // namespace heba
