#include "solvers/closed_form/two_step_motion.h"

#include <algorithm>
#include <cmath>

#include "heba/base/units.h"

namespace heba {
namespace {

// Tolerances for a motion component that is commanded to be zero: above the wander of robots, below any motion that
// is worth a capture.
constexpr double kStillM = 0.3e-3;
const double kStillRad = DegToRad(0.1);
constexpr double kOffAxisRatio = 0.01;
constexpr double kMinTranslationM = 5e-3;
const double kMinTurnRad = DegToRad(2.0);

// Returns the role of a pose relative to the home pose.
CaptureRole RoleFrom(const Rigid3d& base_from_home, const Rigid3d& base_from_gripper) {
  const Rigid3d home_from_gripper = Inverse(base_from_home) * base_from_gripper;
  const double distance_m = home_from_gripper.translation.norm();
  const double angle_rad = RotationAngle(home_from_gripper.rotation);
  if (angle_rad < kStillRad && distance_m < kStillM) return CaptureRole::kHome;
  if (distance_m < kStillM && angle_rad >= kMinTurnRad) return CaptureRole::kRotate;
  if (angle_rad < kStillRad && distance_m >= kMinTranslationM) {
    for (const int axis : {0, 1}) {
      Eigen::Vector3d across = home_from_gripper.translation;
      across[axis] = 0;
      if (across.norm() <= kStillM + kOffAxisRatio * distance_m) {
        return axis == 0 ? CaptureRole::kTranslateX : CaptureRole::kTranslateY;
      }
    }
  }
  return CaptureRole::kFree;
}

}  // namespace

std::vector<CaptureRole> FindTwoStepRoles(Setup setup, const std::vector<View>& views) {
  std::vector<Rigid3d> poses;
  for (const View& view : views) poses.push_back(BaseFromGripper(setup, view.camera_mount_from_target_mount));
  std::vector<CaptureRole> best(views.size(), CaptureRole::kNone);
  std::ptrdiff_t most = 0;
  for (const Rigid3d& home : poses) {
    std::vector<CaptureRole> roles;
    for (const Rigid3d& pose : poses) roles.push_back(RoleFrom(home, pose));
    const auto count = [&](CaptureRole role) { return std::count(roles.begin(), roles.end(), role); };
    if (count(CaptureRole::kTranslateX) == 0 || count(CaptureRole::kTranslateY) == 0 ||
        count(CaptureRole::kRotate) < 2) {
      continue;
    }
    const std::ptrdiff_t in_motion = static_cast<std::ptrdiff_t>(roles.size()) - count(CaptureRole::kFree);
    if (in_motion <= most) continue;
    most = in_motion;
    best = std::move(roles);
  }
  return best;
}

}  // namespace heba
