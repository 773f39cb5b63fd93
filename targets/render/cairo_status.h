// The status of Cairo's surfaces and contexts.
#pragma once

#include <new>

#include <cairo.h>

#include "heba/base/error.h"

namespace heba {

// Throws std::bad_alloc if Cairo has run out of memory. Everything else is a bug: memory streams cannot fail, and sizes
// are checked before.
inline void RequireCairo(cairo_status_t status) {
  if (status == CAIRO_STATUS_NO_MEMORY) throw std::bad_alloc();
  CHECK_EQ(status, CAIRO_STATUS_SUCCESS) << cairo_status_to_string(status);
}

}  // namespace heba
