// The functions of the checks of checks.def.
#pragma once

#include "tools/doctor/examination.h"

namespace heba {

#define HEBA_CHECK(name, needs_images, what) Checked Check_##name(const Examination& examination);
#include "tools/doctor/checks.def"
#undef HEBA_CHECK

}  // namespace heba
