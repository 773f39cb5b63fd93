// The words and tables of a plan.
#pragma once

#include <string>
#include <vector>

#include "heba/capture_plan.h"
#include "heba/run_types.h"

namespace heba {

// Returns the names of the planned images, in the order of the captures: 001.png, 002.png, ..., or those that follow
// the highest number in the names of an earlier session.
std::vector<std::string> PlannedImages(const CapturePlan& plan, const std::vector<std::string>& former_names);
// Returns what a capture repeats, as "as 001.png", or its purpose, and the configuration of the arm if the capture
// before it has another one; empty if there is nothing to say.
std::string PlannedNote(const CapturePlan& plan, size_t index, const std::vector<std::string>& images,
                        const std::vector<std::string>& former_names);

// Returns the table of the captures, with what is expected after each, and what follows from it.
std::string PlanTable(const std::vector<PlacedRequirement>& requirements, const CapturePlan& plan,
                      const std::vector<std::string>& former_names);

// Returns what is expected of a plan in words, without a full stop; `after` is the number of captures.
std::string ExpectedText(const CapturePlan& plan, size_t after);
// Returns what the planned captures hardly tell about the camera's pose, likewise; empty if there is nothing.
std::string UntoldText(const CapturePlan& plan);
// Returns from which capture on a required accuracy is reached, in words; empty if nothing is required.
std::string EnoughText(const std::vector<PlacedRequirement>& requirements, const CapturePlan& plan);

}  // namespace heba
