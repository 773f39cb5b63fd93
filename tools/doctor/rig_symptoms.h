// Symptoms of a rig that several pairs of its cameras and targets share.
#pragma once

#include <vector>

#include "tools/config/rig_config.h"
#include "tools/doctor/rig_pairs.h"

namespace heba {

// Returns the symptoms of all pairs: each once, with the parts of the rig that have it, and with the cure that the
// other pairs show.
std::vector<Symptom> SymptomsOfPairs(const RigConfig& config, const std::vector<DiagnosedPair>& diagnosed);

}  // namespace heba
