// Reads a pose from the command line.
#pragma once

#include <string>

#include "heba/io/pose_formats.h"

namespace heba {

// Returns the pose that `text`, the value of the flag --`name`, gives: the numbers of `format`, separated by commas.
// Throws InputError if they are malformed.
Rigid3d PoseOfFlag(const std::string& name, const std::string& text, const PoseFormat& format);

// Returns the format of --near, a pose, if the run's poses have `format`: the same, or `ros` if those are joints.
const PoseFormat& FormatOfNear(const PoseFormat& format);

}  // namespace heba
