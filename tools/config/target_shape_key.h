// The key `refine.target_shape` of a run config.
#pragma once

#include "heba/config/yaml_reader.h"
#include "tools/config/run_config_types.h"

namespace heba {

// Returns the config with the parts of the targets' shapes that are estimated, for all targets of its data set. Throws
// InputError if the points of a target cannot be.
RunConfig WithTargetShape(RunConfig config, MapReader& refine);

}  // namespace heba
