// Captures the message of an InputError.
#pragma once

#include <string>

#include "heba/base/error.h"

namespace heba {

// Returns the message of the InputError that `action` throws, or "no error" if it throws none.
template <class Action>
std::string InputErrorOf(const Action& action) {
  try {
    action();
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

}  // namespace heba
