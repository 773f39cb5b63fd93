#include "solvers/refine/kinematic_loop.h"

#include "heba/geometry/pose_block.h"

namespace heba {
namespace {

// camera_from_target = (camera_mount_from_camera Exp(xi))^-1 M target_mount_from_target Exp(eta): to first order this
// is a left perturbation by -xi and by Adjoint(camera_from_target) eta.
class HandEyeLoop final : public KinematicLoop {
 public:
  explicit HandEyeLoop(const Rigid3d& camera_mount_from_target_mount)
      : camera_mount_from_target_mount_(camera_mount_from_target_mount) {}
  int num_blocks() const override { return 2; }
  Rigid3d Evaluate(const double* const* pose_blocks, std::vector<Matrix6>* left_from_tangent) const override {
    const HandEye hand_eye{FromBlock(pose_blocks[0]), FromBlock(pose_blocks[1])};
    const Rigid3d camera_from_target = CameraFromTarget(hand_eye, camera_mount_from_target_mount_);
    if (left_from_tangent != nullptr) *left_from_tangent = {-Matrix6::Identity(), Adjoint(camera_from_target)};
    return camera_from_target;
  }

 private:
  Rigid3d camera_mount_from_target_mount_;
};

class CorrectedLoop final : public KinematicLoop {
 public:
  CorrectedLoop(Setup setup, const Rigid3d& camera_mount_from_target_mount)
      : setup_(setup), camera_mount_from_target_mount_(camera_mount_from_target_mount) {}
  int num_blocks() const override { return 3; }
  Rigid3d Evaluate(const double* const* pose_blocks, std::vector<Matrix6>* left_from_tangent) const override {
    const HandEye hand_eye{FromBlock(pose_blocks[0]), FromBlock(pose_blocks[1])};
    const Rigid3d correction = FromBlock(pose_blocks[2]);
    const Rigid3d camera_from_target = CameraFromTarget(setup_, hand_eye, camera_mount_from_target_mount_, correction);
    if (left_from_tangent != nullptr) {
      *left_from_tangent = {-Matrix6::Identity(), Adjoint(camera_from_target),
                            LeftFromCorrection(setup_, hand_eye, camera_mount_from_target_mount_, correction)};
    }
    return camera_from_target;
  }

 private:
  Setup setup_;
  Rigid3d camera_mount_from_target_mount_;
};

class FreePoseLoop final : public KinematicLoop {
 public:
  int num_blocks() const override { return 1; }
  Rigid3d Evaluate(const double* const* pose_blocks, std::vector<Matrix6>* left_from_tangent) const override {
    const Rigid3d camera_from_target = FromBlock(pose_blocks[0]);
    if (left_from_tangent != nullptr) *left_from_tangent = {Adjoint(camera_from_target)};
    return camera_from_target;
  }
};

}  // namespace

std::unique_ptr<KinematicLoop> MakeHandEyeLoop(const Rigid3d& camera_mount_from_target_mount) {
  return std::make_unique<HandEyeLoop>(camera_mount_from_target_mount);
}

std::unique_ptr<KinematicLoop> MakeCorrectedLoop(Setup setup, const Rigid3d& camera_mount_from_target_mount) {
  return std::make_unique<CorrectedLoop>(setup, camera_mount_from_target_mount);
}

std::unique_ptr<KinematicLoop> MakeFreePoseLoop() { return std::make_unique<FreePoseLoop>(); }

}  // namespace heba
