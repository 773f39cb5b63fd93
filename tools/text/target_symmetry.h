// Texts about a target that looks the same after a rotation by 180 or 90 deg.
#pragma once

#include <string>

#include "heba/target.h"

namespace heba {

// Returns "the target looks the same after a rotation by 180 deg"; empty for a target without symmetry, which has a
// single one (Target::Symmetries).
std::string SymmetryText(const Target& target);
std::string SymmetryText(size_t num_symmetries);
// Adds the consequence for the user to SymmetryText: "..., so 'heba locate' finds 2 possible poses in an image unless
// --near decides; the calibration itself is not affected".
std::string SymmetryRemark(const Target& target);
std::string SymmetryRemark(size_t num_symmetries);
// Names a target without symmetry: "a chessboard with columns: 8, or a charuco, has one pose only".
std::string SymmetryCure(const Target& target);

}  // namespace heba
