// A pose on the command line.
#pragma once

#include <string>

#include "heba/io/pose_formats.h"

namespace heba {

// The pose that `text`, the value of the flag --`name`, gives: the numbers of `format` with commas between them.
// InputError if they are not that.
Rigid3d PoseOfFlag(const std::string& name, const std::string& text, const PoseFormat& format);

}  // namespace heba
