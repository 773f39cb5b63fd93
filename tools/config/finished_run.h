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

// Returns the folder of a run that is named by its folder or by the result.json in it.
std::filesystem::path RunFolderOf(const std::filesystem::path& run);

// Throws InputError if the folder has no refined estimate from images or corners.
FinishedRun ReadFinishedRun(const std::filesystem::path& path);

// Throws InputError, which begins with `image`, if an image does not have the size of those of the run.
void CheckImageSize(const FinishedRun& run, const CaptureDetection& seen, const std::string& image);

}  // namespace heba
