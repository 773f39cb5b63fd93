// A target's config as a person or a phone reads it: in millimetres and without digits that are only rounding.
#pragma once

#include <string>

#include <yaml-cpp/yaml.h>

#include "heba/target.h"

namespace heba {

// Returns the config `used` (MapReader::used() after CreateTarget) as one line of YAML that reads back as the target,
// such as "{type: chessboard, rows: 6, columns: 9, square: 18 mm}". Lengths are rounded to a millionth of a millimetre.
std::string TargetConfigLine(const YAML::Node& used);

// Returns a title such as "coded_board 11 x 9, 20 mm": the type, columns, rows and the main length.
std::string TargetTitle(const Target& target, const YAML::Node& used);

}  // namespace heba
