// The page of a plan: the poses in 3-D, the images that are expected, and the figures.
#pragma once

#include <string>

#include "heba/capture_plan.h"
#include "tools/config/plan_config.h"

namespace heba {

std::string PlanPage(const PlanConfig& config, const CapturePlan& plan);

}  // namespace heba
