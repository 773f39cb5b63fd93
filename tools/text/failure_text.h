// The words of failures for people: one place for the reports, result.json, the terminal and the doctor. For users of
// the program they name keys of its configs.
#pragma once

#include <string>
#include <string_view>

#include "heba/base/error.h"

namespace heba {

// Whether words name the keys of a config, which a user of arrays in Python does not have.
enum class ConfigKeys { kNamed, kOmitted };

// Returns the text of a failure or, if it has none, the words of its code, which quote its causes. Those of an unknown
// code are Failure::ToString.
std::string FailureText(const Failure& failure, ConfigKeys keys = ConfigKeys::kNamed);

// Returns the words for an unknown with this name (UnknownLayout::Name): "the hand-eye translation along the camera's
// x".
std::string UnknownText(std::string_view name);

}  // namespace heba
