// The key `refine.target_shape` of a run config.
#pragma once

#include "heba/config/yaml_reader.h"
#include "tools/config/run_config_types.h"

namespace heba {

// Reads which parts of the targets' shapes are estimated, for all targets of the data set, which must be read before.
// Throws InputError if the points of a target cannot be.
void ReadTargetShape(MapReader& refine, RunConfig* config);

}  // namespace heba
