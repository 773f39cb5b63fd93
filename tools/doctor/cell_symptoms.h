// Symptoms of a rig that several pairs of its cameras and targets share.
#pragma once

#include <vector>

#include "tools/config/run_config.h"
#include "tools/doctor/pairs.h"

namespace heba {

// Returns the symptoms of all pairs: each once, with the parts of the rig that have it, and with the cure that the
// other pairs show.
std::vector<Symptom> SymptomsOfPairs(const RunConfig& config, const std::vector<DiagnosedPair>& diagnosed);

}  // namespace heba
