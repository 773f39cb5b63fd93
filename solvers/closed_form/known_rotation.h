// Steps that several closed-form methods share once a rotation is known.
#pragma once

#include <vector>

#include "heba/evaluation/metrics.h"
#include "solvers/closed_form/motion_sums.h"

namespace heba {

// Computes the translation of X for a known rotation: least squares of (R_A - I) t = R_X t_B - t_A over all motions.
Eigen::Vector3d SolveTranslation(const MotionSums& motions, const Eigen::Matrix3d& rotation_x);

// Returns X together with the board pose that it implies: the mean of M_i^-1 X C_i.
HandEye WithAverageBoardPose(const std::vector<PosePair>& pairs, const Rigid3d& camera_mount_from_camera);

// Computes the translations of X and Z for known rotations: least squares of R_M t_Z - t_X = R_X t_C - t_M over all
// captures.
HandEye SolveTranslations(const std::vector<PosePair>& pairs, const Eigen::Matrix3d& rotation_x,
                          const Eigen::Matrix3d& rotation_z);

}  // namespace heba
