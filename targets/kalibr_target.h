// Kalibr's own target files.
#pragma once

#include "heba/config/yaml_reader.h"

namespace heba {

// Whether a mapping is one of Kalibr's: it has a `target_type`.
bool IsKalibrTarget(MapReader& reader);

// The same target in heba's words: aprilgrid {tagCols, tagRows, tagSize, tagSpacing}, checkerboard {targetCols,
// targetRows, rowSpacingMeters, colSpacingMeters}, circlegrid {targetCols, targetRows, spacingMeters, asymmetricGrid}.
// Lengths there are plain numbers in m. An aprilgrid has tag36h11 with a black border of 2 bits and corner squares, as
// Kalibr draws it. InputError on unknown keys and on what heba has no target for (squares that are not square).
ConfigValue FromKalibrTarget(MapReader& reader);

}  // namespace heba
