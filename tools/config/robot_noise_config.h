// Reads the noise of a robot's poses, as the configs of runs, studies and scenes state it.
#pragma once

#include "heba/config/yaml_reader.h"
#include "heba/data/pair_solution.h"
#include "heba/run_types.h"

namespace heba {

// Reads `translation` and `rotation`, one sigma along and about each axis, and finishes the mapping. `fallback` is the
// value of a key that is left out; without it both keys are required. Throws InputError for values that no robot has:
// negative, more than 100 mm or 10 deg, or not zero but less than a millionth of a millimetre or of a degree.
RobotNoise ReadRobotNoise(MapReader& reader, std::optional<double> fallback = std::nullopt);

// Returns the options with the key `robot_noise` of `refine`: "auto", "none" (or "exact"), "white" (auto without smooth
// errors), "smooth", both sigmas, or {joints: auto}, which the only arm of `data` must have.
RunOptions WithRobotErrors(RunOptions options, MapReader& refine, const Dataset& data);

}  // namespace heba
