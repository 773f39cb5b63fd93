// The folder of a finished run with a rig, read to locate targets with its result.
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "heba/evaluation/rig_evaluation.h"
#include "heba/target.h"
#include "tools/config/run_config.h"

namespace heba {

struct FinishedRig {
  RigResult result;
  std::vector<std::shared_ptr<const Target>> targets;
  std::vector<PoseReading> pose_readings;  // One per arm.
  std::vector<bool> joints_are_deg;        // Likewise: whether its recorded joints are in degrees.
};

// Reads the folder of a run, or the one of its result.json. Throws InputError if it cannot be read.
FinishedRig ReadFinishedRig(const std::filesystem::path& path);

}  // namespace heba
