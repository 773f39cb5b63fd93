// Faults of the images of one camera of a rig: shifted against the poses, or a camera that was moved.
#pragma once

#include <optional>
#include <vector>

#include "heba/rig_calibration.h"

namespace heba {

// The images of a camera belong to other captures.
struct ShiftedCamera {
  size_t camera = 0;
  int shift = 0;  // An image belongs to the capture this many places after its own; negative: before.
};

// Tries, for each camera of which a pair could not be calibrated or left out more than a quarter of its images, whether
// all images of the camera fit the poses of captures that are one or two places before or after. A shift is accepted if
// it leaves out at most a tenth of the pair's images. Returns nothing if no camera is shifted.
std::optional<ShiftedCamera> FindShiftedCamera(const RigProblem& problem, const std::vector<RigPair>& pairs,
                                               const RigCalibrationOptions& options);

// A camera that was moved during the captures.
struct MovedCamera {
  size_t camera = 0;
  size_t first_capture = 0;   // The first capture after the motion.
  size_t last_capture = 0;    // The last capture before it.
  Rigid3d before_from_after;  // The pose of the camera after the motion, in its pose before it.
};

// Looks for cameras whose images contradict the others from one capture on, or up to one, all by the same motion of the
// camera. `problem` has the points of all images, `calibration` is that of it.
std::vector<MovedCamera> FindMovedCameras(const RigProblem& problem, const RigCalibration& calibration);

}  // namespace heba
