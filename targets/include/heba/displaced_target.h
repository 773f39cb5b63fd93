// A target whose points do not lie exactly where its design has them.
#pragma once

#include <memory>

#include "heba/data/point_offsets.h"
#include "heba/target.h"

namespace heba {

// Returns the same target with points that are displaced by these offsets. It is found, drawn and named as designed.
std::shared_ptr<const Target> Displaced(std::shared_ptr<const Target> designed, const PointOffsets& offsets);

}  // namespace heba
