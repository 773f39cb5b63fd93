// Reads the section `evaluate` of a run config.
#pragma once

#include <string>
#include <vector>

#include "heba/config/yaml_reader.h"
#include "tools/config/run_config_types.h"

namespace heba {

// Reads the section: the folds, the truth and the requirements, which may name a camera of the data set.
void ReadEvaluate(MapReader& root, RunConfig* config);

// Reads the requirements of accuracy; none if the key is absent. `cameras` has the names of a rig's cameras, one of
// which a requirement may name (`camera`); it is empty for a single camera.
std::vector<PlacedRequirement> ReadRequirements(MapReader& evaluate, const std::vector<std::string>& cameras = {});

}  // namespace heba
