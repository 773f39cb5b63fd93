#include "heba/data/drift.h"

namespace heba {

DriftBody BodyOn(Setup setup, DriftSide side) {
  const bool is_camera = (setup == Setup::kEyeInHand) == (side == DriftSide::kHand);
  return {is_camera ? DriftBody::Kind::kCamera : DriftBody::Kind::kTarget, 0};
}

double RemainingShare(const Drift& drift, size_t capture, size_t num_captures) {
  if (drift.form == DriftForm::kStep) return capture < drift.capture ? 1 : 0;
  if (num_captures < 2) return 0;
  return static_cast<double>(num_captures - 1 - capture) / static_cast<double>(num_captures - 1);
}

Rigid3d WithoutDrift(const Rigid3d& camera_mount_from_target_mount, const Drift& drift, double remaining_share,
                     const Rigid3d& camera_mount_from_camera, const Rigid3d& target_mount_from_target) {
  // The body stood at its last pose times this motion.
  const Rigid3d motion = Retract(Rigid3d(), -remaining_share * drift.change);
  if (drift.body.kind == DriftBody::Kind::kCamera) {
    // inv(X motion) M Y = inv(X) (X inv(motion) inv(X) M) Y.
    return camera_mount_from_camera * Inverse(motion) * Inverse(camera_mount_from_camera) *
           camera_mount_from_target_mount;
  }
  return camera_mount_from_target_mount * target_mount_from_target * motion * Inverse(target_mount_from_target);
}

}  // namespace heba
