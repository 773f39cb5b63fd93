// Parts that the AX = XB methods share. A = M_j M_i^-1 and B = C_j C_i^-1 are the motions of two captures
// (solvers/hand_eye_method.h); no list of them is stored, so that memory does not grow with the square of the captures.
#pragma once

#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "heba/base/error.h"
#include "solvers/hand_eye_method.h"

namespace heba {

// Calls `use(A, B)` for every two captures whose rotation is large enough to carry information (5 deg, or a quarter of
// the largest one) and not so near half a turn that its axis could flip.
template <class Use>
void ForEachMotion(const std::vector<PosePair>& pairs, const Use& use);

// Why the captures cannot determine a hand-eye pose; nothing if they can.
std::optional<Failure> CheckPairs(const std::vector<PosePair>& pairs);

// The translation of X for a known rotation: least squares of (R_A - I) t = R_X t_B - t_A over all motions.
Eigen::Vector3d SolveTranslation(const std::vector<PosePair>& pairs, const Eigen::Matrix3d& rotation_x);

// X with the board that belongs to it: the mean of M_i^-1 X C_i.
HandEye WithMeanBoard(const std::vector<PosePair>& pairs, const Rigid3d& camera_mount_from_camera);

// Translations of X and of Z for known rotations: least squares of R_M t_Z - t_X = R_X t_C - t_M over all captures.
HandEye SolveTranslations(const std::vector<PosePair>& pairs, const Eigen::Matrix3d& rotation_x,
                          const Eigen::Matrix3d& rotation_z);

// ---------------------------------------------------------------------------------------------------------------------

double MinMotionAngleRad(const std::vector<PosePair>& pairs);
bool CarriesInformation(const Rigid3d& a, const Rigid3d& b, double min_angle_rad);

template <class Use>
void ForEachMotion(const std::vector<PosePair>& pairs, const Use& use) {
  const double min_angle_rad = MinMotionAngleRad(pairs);
  for (size_t i = 0; i < pairs.size(); ++i) {
    const Rigid3d m_i_inverse = Inverse(pairs[i].camera_mount_from_target_mount);
    const Rigid3d c_i_inverse = Inverse(pairs[i].camera_from_target);
    for (size_t j = i + 1; j < pairs.size(); ++j) {
      const Rigid3d a = pairs[j].camera_mount_from_target_mount * m_i_inverse;
      const Rigid3d b = pairs[j].camera_from_target * c_i_inverse;
      if (CarriesInformation(a, b, min_angle_rad)) use(a, b);
    }
  }
}

}  // namespace heba
