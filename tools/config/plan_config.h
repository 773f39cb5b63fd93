// Reads what `heba plan` works from: a cell, known by a tape measure, or the folder of a finished run.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "heba/capture_plan.h"
#include "heba/robot/arm.h"
#include "heba/run_types.h"
#include "heba/target.h"
#include "tools/config/run_config_types.h"

namespace heba {

struct PlanConfig {
  std::string name;
  PlanCell cell;
  int num_revisits = 3;
  std::shared_ptr<const Target> target;
  std::optional<RobotArm> robot;
  PoseReading pose_reading;
  bool joints_are_deg = false;
  std::vector<PlacedRequirement> requirements;
  // The names of the finished run's captures, whose poses are PlanCell::former_poses; empty for a cell.
  std::vector<std::string> former_names = {};
  // The plan goes there if no other path is named: beside the cell, or beside the run's folder.
  std::filesystem::path output;
};

// Reads a cell's file or the folder of a run of one camera, one target and one arm; `settings` (--set) take precedence
// over a file. Throws InputError on any error.
PlanConfig ReadPlanConfig(const std::filesystem::path& path, const std::vector<std::string>& settings);

}  // namespace heba
