// Reads the target files of Kalibr.
#pragma once

#include "heba/config/yaml_reader.h"

namespace heba {

// Returns whether a mapping is one of Kalibr's, recognised by its key `target_type`.
bool IsKalibrTarget(MapReader& reader);

// Returns the same target with heba's keys. The supported types are aprilgrid {tagCols, tagRows, tagSize,
// tagSpacing}, checkerboard {targetCols, targetRows, rowSpacingMeters, colSpacingMeters} and circlegrid {targetCols,
// targetRows, spacingMeters, asymmetricGrid}. Lengths in Kalibr's files are plain numbers in metres. An aprilgrid
// becomes a grid of tag36h11 tags with a black border of 2 bits and corner squares, as Kalibr draws it. Throws
// InputError on unknown keys and on targets that heba does not support (a checkerboard whose squares are not square).
ConfigValue FromKalibrTarget(MapReader& reader);

}  // namespace heba
