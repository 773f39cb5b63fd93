// The program's words on a target that looks the same after half a turn or a quarter of a turn.
#pragma once

#include <string>

#include "targets/target.h"

namespace heba {

// "the target looks the same after half a turn"; empty for a target without symmetry.
std::string SymmetryText(const Target& target);
// The same with what it means for the user: "..., so 'heba locate' finds 2 possible poses in an image unless --near
// decides; the calibration itself is not affected".
std::string SymmetryRemark(const Target& target);
// Which target would have no symmetry: "a chessboard with columns: 8, or a charuco, has one pose only".
std::string SymmetryCure(const Target& target);

}  // namespace heba
