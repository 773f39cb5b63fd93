// Records the inputs of a run by their contents, to tell whether its results are still current.
#pragma once

#include <string>

#include "tools/config/run_config.h"

namespace heba {

// Returns the text of a run's inputs.json: digests of the program, of the config as used and of every file that it
// reads. The digest of a file that cannot be read is empty.
std::string RunInputsText(const RunConfig& config);

}  // namespace heba
