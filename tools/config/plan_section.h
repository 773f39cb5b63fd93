// Reads the section `plan` of a config: what is known about a cell before a session, and where its robot may go.
#pragma once

#include <limits>
#include <optional>

#include "heba/capture_plan.h"
#include "heba/config/yaml_reader.h"

namespace heba {

// A lens and a sensor, as their data sheets state them.
struct PlanLens {
  Camera camera;
  double nearest_m = 0;
  double farthest_m = std::numeric_limits<double>::infinity();
};

// The section `plan`.
struct PlanSection {
  std::optional<HandEye> hand_eye;
  PlanCell cell;  // The section states a part of it.
  std::optional<PlanLens> lens;
  bool has_noise = false;  // Whether it states the noise of the robot.
  int num_revisits = 3;    // PlanOptions::num_revisits.
};

// Reads the section, if there is one.
PlanSection ReadPlan(MapReader& root);

}  // namespace heba
