// Fang et al., "Hand-eye calibration of a monocular camera by two steps", 2021, for both setups. With M =
// camera_mount_from_target_mount (eye-to-hand: base_from_gripper), c the position of the target's point in the camera
// and y its position in the target's mount, X c = M y for every capture.
//
// Step 1 (their section 1.1): without rotation, the mount's displacements e = M y - M_home y and the target's
// displacements u in the camera differ only by the rotation of X. It is determined by the columns u_x, u_y and u_x x
// u_y of unit vectors and the same columns of e, and projected to the nearest rotation by SVD.
// Step 2 (section 1.2): rotations about the tool point relative to home, equations (8) to (10), give (R_M - R_M,home)
// y = R_X (c - c_home) - (p_M - p_M,home), solved by linear least squares over all rotations; eye-to-hand the last
// term is zero. The translation of X then follows from the home capture.
#include <algorithm>
#include <optional>

#include <Eigen/LU>

#include "heba/base/factorisation.h"
#include "heba/base/failure_code.h"
#include "heba/base/units.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/closed_form/known_rotation.h"
#include "solvers/closed_form/target_position.h"

namespace heba {
namespace {

// Returns the indices of the captures that have this role.
std::vector<size_t> WithRole(const std::vector<PosePair>& pairs, CaptureRole role) {
  std::vector<size_t> found;
  for (size_t i = 0; i < pairs.size(); ++i) {
    if (pairs[i].role == role) found.push_back(i);
  }
  return found;
}

// Returns the matrix with the columns x, y and x cross y, all of unit length.
Eigen::Matrix3d Frame(const Eigen::Vector3d& along_x, const Eigen::Vector3d& along_y) {
  const Eigen::Vector3d x = along_x.normalized();
  const Eigen::Vector3d y = along_y.normalized();
  Eigen::Matrix3d frame;
  frame << x, y, x.cross(y).normalized();
  return frame;
}

}  // namespace

Outcome<HandEye> SolveHandEye_two_step(const HandEyeInput& input) {
  const std::vector<PosePair>& pairs = input.pairs();
  const std::vector<size_t> homes = WithRole(pairs, CaptureRole::kHome);
  const std::vector<size_t> turns = WithRole(pairs, CaptureRole::kRotate);
  if (homes.empty()) {
    return Failure{FailureCode("no_home")};
  }
  const size_t home = homes.front();
  const auto mount_position = [&](size_t i) { return pairs[i].camera_mount_from_target_mount.translation; };
  const auto mount_rotation = [&](size_t i) { return pairs[i].camera_mount_from_target_mount.RotationMatrix(); };
  // For each axis only the longest translation is used, because the paper has one.
  std::vector<size_t> translations;
  for (const std::string axis : {"x", "y"}) {
    const std::vector<size_t> candidates =
        WithRole(pairs, axis == "x" ? CaptureRole::kTranslateX : CaptureRole::kTranslateY);
    if (candidates.empty()) {
      return Failure{FailureCode("no_translation"), {}, {{"axis", axis}}};
    }
    translations.push_back(*std::max_element(candidates.begin(), candidates.end(), [&](size_t a, size_t b) {
      return (mount_position(a) - mount_position(home)).norm() < (mount_position(b) - mount_position(home)).norm();
    }));
  }
  const TargetPositions& positions = input.positions();
  const auto position = [&](size_t i) { return positions.captures[i].in_camera; };
  const Eigen::Matrix3d camera_from_frame =
      Frame(position(translations[0]) - position(home), position(translations[1]) - position(home));
  const Eigen::Matrix3d mount_from_frame = Frame(mount_position(translations[0]) - mount_position(home),
                                                 mount_position(translations[1]) - mount_position(home));
  const Eigen::Matrix3d rotation_x = NearestRotation(mount_from_frame * camera_from_frame.inverse());

  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const size_t i : turns) {
    const Eigen::Matrix3d left = mount_rotation(i) - mount_rotation(home);
    normal += left.transpose() * left;
    right +=
        left.transpose() * (rotation_x * (position(i) - position(home)) - (mount_position(i) - mount_position(home)));
  }
  // A rotation by w displaces a unit vector perpendicular to its axis by |w|: the direction in which the point is
  // determined worst must have been displaced by a few degrees in total.
  const double least_rad = std::sqrt(std::max(0.0, EigenOfSymmetric(normal).values[0]));
  const double needed_rad = DegToRad(2.0);
  if (least_rad < needed_rad) {
    return Failure{FailureCode("few_rotations"),
                   {{"rotations", static_cast<double>(turns.size())}, {"least_deg", RadToDeg(least_rad)}}};
  }
  const Eigen::Vector3d point_in_mount = SolveSymmetric(normal, right);
  const Eigen::Vector3d translation =
      mount_rotation(home) * point_in_mount + mount_position(home) - rotation_x * position(home);
  return WithBoardAtPoint(pairs, Rigid3d(rotation_x, translation), positions.point_in_target, point_in_mount);
}

}  // namespace heba
