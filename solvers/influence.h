// How much of a result hangs on each capture.
#pragma once

#include <optional>
#include <vector>

#include "heba/data/solution.h"
#include "solvers/information.h"

namespace heba {

// For each view, what the hand-eye pose would move by without it: the tangent of camera_mount_from_camera, m and rad,
// in the camera's frame. One Gauss-Newton step from the solution over the other views (Cook and Weisberg 1982, section
// 3.2), with the noise as the solution has it, the robot's averaged over. `problem` is what was solved, without the
// points that the solution left out. Nothing for a view without which the others could not tell the unknowns.
std::vector<std::optional<Tangent6>> MoveWithoutEachView(const Problem& problem, const Solution& solution,
                                                         const FreeParameters& free);

}  // namespace heba
