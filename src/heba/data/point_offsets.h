// The places of a target's points beside their design: local errors of a print, a warped sheet, markers that were
// placed by hand.
#pragma once

#include <map>

#include <Eigen/Core>

namespace heba {

// The displacement of points in the frame of their target, m, by their ids. Points that are not listed are where the
// design has them.
using PointOffsets = std::map<int, Eigen::Vector3d>;

}  // namespace heba
