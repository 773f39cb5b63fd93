// Reads the section `evaluate` of a run config.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "heba/config/yaml_reader.h"
#include "heba/run_types.h"

namespace heba {

struct EvaluateSection {
  int folds = 0;
  std::optional<std::filesystem::path> truth;
  std::vector<PlacedRequirement> requirements;  // Requirements may name a camera of the rig.
};
EvaluateSection ReadEvaluate(MapReader& root, const Problem& rig);

// Reads the requirements of accuracy; none if the key is absent. `cameras` has the names of a rig's cameras, one of
// which a requirement may name (`camera`); it is empty for a single camera.
std::vector<PlacedRequirement> ReadRequirements(MapReader& evaluate, const std::vector<std::string>& cameras = {});

}  // namespace heba
