// Creates a target from the keys of its YAML mapping, as benchmarks write them.
#pragma once

#include <memory>
#include <string>

#include "heba/config/yaml_reader.h"
#include "heba/target.h"

namespace heba {

inline std::unique_ptr<Target> TargetOf(const std::string& keys) {
  MapReader reader(ParseYaml("{" + keys + "}", "bench"));
  return CreateTarget(reader);
}

}  // namespace heba
