// The words and tables of a plan.
#pragma once

#include <string>
#include <vector>

#include "heba/capture_plan.h"
#include "heba/run_types.h"

namespace heba {

// Returns the table of the captures, with what is expected after each, and what follows from it.
std::string PlanTable(const std::vector<PlacedRequirement>& requirements, const CapturePlan& plan);

// Returns the name of a planned image, in the order of the captures: "001.png".
std::string PlannedImage(size_t index);

// Returns what is expected of a plan in words, without a full stop; `after` is the number of captures.
std::string ExpectedText(const CapturePlan& plan, size_t after);
// Returns from which capture on a required accuracy is reached, in words; empty if nothing is required.
std::string EnoughText(const std::vector<PlacedRequirement>& requirements, const CapturePlan& plan);

}  // namespace heba
