// The key `evaluate.require`.
#pragma once

#include <string>
#include <vector>

#include "heba/config/yaml_reader.h"
#include "heba/pair_run.h"

namespace heba {

// Reads the requirements of accuracy; none if the key is absent. `cameras` has the names of a rig's cameras, one of
// which a requirement may name (`camera`); it is empty for a single camera.
std::vector<PlacedRequirement> ReadRequirements(MapReader& evaluate, const std::vector<std::string>& cameras = {});

}  // namespace heba
