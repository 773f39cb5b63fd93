// The noise of a robot's poses, as configs of runs, studies and scenes state it.
#pragma once

#include "heba/config/yaml_reader.h"
#include "heba/data/solution.h"

namespace heba {

// Reads `translation` and `rotation`, one sigma along and about each axis, and finishes the mapping. `fallback` is what
// a key that is left out stands for; without it both are needed. InputError for what no robot has: negative values,
// more than 100 mm or 10 deg, or less than a millionth of a millimetre or of a degree that is not zero.
RobotNoise ReadRobotNoise(MapReader& reader, std::optional<double> fallback = std::nullopt);

}  // namespace heba
