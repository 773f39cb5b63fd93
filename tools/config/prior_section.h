// The key `prior` of a run config: an earlier run whose result counts as an observation.
#pragma once

#include <optional>

#include "heba/config/yaml_reader.h"
#include "heba/run_types.h"

namespace heba {

// Reads `prior`: the folder of a run, or {run: FOLDER, drift: {translation, rotation}, target: in-place | moved}.
// Returns nothing if the key is absent. Throws InputError if the run cannot be read.
std::optional<EarlierRun> ReadPrior(MapReader& root);

}  // namespace heba
