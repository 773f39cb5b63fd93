// Kinematic loops: the pose of a target in a camera as a product of known and unknown poses. Equations (1) to (3) of
// docs/estimation.md.
#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "heba/data/shared_effects.h"
#include "heba/geometry/rigid3.h"
#include "heba/kernels/small_matrix.h"

namespace heba {

// One factor of a loop.
struct LoopFactor {
  enum class Kind {
    kKnown,   // `known`, for example a pose that the robot reports.
    kShared,  // The unknown pose `index`, which captures share.
    kEffect,  // `effect` of the effects `index`.
    kOwn,     // The unknown pose `index` of the capture.
  };
  Kind kind = Kind::kKnown;
  int index = 0;
  Rigid3d known = {};
  std::shared_ptr<const PoseEffect> effect = {};
  bool is_inverted = false;  // The factor is the inverse of this pose.
};
LoopFactor KnownFactor(const Rigid3d& pose);
LoopFactor SharedFactor(int index);
LoopFactor EffectFactor(int index, std::shared_ptr<const PoseEffect> effect);
LoopFactor OwnFactor(int index);
// Returns the factor of the inverse pose.
LoopFactor Inverse(LoopFactor factor);

// The poses and effects at which a loop is evaluated.
struct LoopPoses {
  const std::vector<Rigid3d>& shared;
  const std::vector<Eigen::VectorXd>& effects;
  const std::vector<Rigid3d>& own;
};

// The derivatives of the left perturbation of camera_from_target (m, rad, in the camera's frame) by the tangents of the
// unknown poses, in the child frame, and by the effects; in the order of KinematicLoop::shared, effects and own.
struct LoopDerivatives {
  std::vector<Matrix6> shared;
  std::vector<Matrix6X> effects;
  std::vector<Matrix6> own;
};

// camera_from_target as the product of factors. An unknown may occur in several of them.
class KinematicLoop {
 public:
  explicit KinematicLoop(std::vector<LoopFactor> factors);

  // Returns the same loop with other known poses and, if there are any, other functions of the effects, each given in
  // the order of their factors. Loops that are made from one another share what they have in common.
  KinematicLoop With(std::vector<Rigid3d> known, std::vector<std::shared_ptr<const PoseEffect>> effects = {}) const;

  // Returns camera_from_target. `derivatives` may be null.
  Rigid3d Evaluate(const LoopPoses& poses, LoopDerivatives* derivatives) const;

  // Returns the factors.
  std::vector<LoopFactor> Factors() const;
  // The indices of the unknowns on which the loop depends, in ascending order.
  const std::vector<int>& shared() const { return pattern_->shared; }
  const std::vector<int>& effects() const { return pattern_->effects; }
  const std::vector<int>& own() const { return pattern_->own; }

 private:
  // All about a loop but the known poses and the functions of the effects.
  struct Pattern {
    std::vector<LoopFactor> factors;  // Without their known poses and functions.
    std::vector<size_t> slots;   // For each factor, its place among the known poses, or `shared`, `effects` or `own`.
    std::vector<bool> is_first;  // For each factor, whether its unknown does not occur before.
    std::vector<int> shared;
    std::vector<int> effects;
    std::vector<int> own;
  };

  std::shared_ptr<const Pattern> pattern_;
  std::vector<Rigid3d> known_;                                   // The poses of inverted factors are stored inverted.
  std::vector<std::shared_ptr<const PoseEffect>> pose_effects_;  // In the order of their factors.
};

}  // namespace heba
