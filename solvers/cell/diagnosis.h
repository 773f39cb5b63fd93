// A fault of all images of one camera of a rig: they are shifted against the poses.
#pragma once

#include <optional>
#include <vector>

#include "heba/calibration_types.h"

namespace heba {

// The images of a camera belong to other captures.
struct ShiftedCamera {
  size_t camera = 0;
  int shift = 0;  // An image belongs to the capture this many places after its own; negative: before.
};

// Tries, for each camera of which a pair could not be calibrated or left out more than a quarter of its images, whether
// all images of the camera fit the poses of captures that are one or two places before or after. A shift is accepted if
// it leaves out at most a tenth of the pair's images. Returns nothing if no camera is shifted.
std::optional<ShiftedCamera> FindShiftedCamera(const Problem& problem, const std::vector<CalibratedPair>& pairs,
                                               const CalibrationOptions& options);

}  // namespace heba
