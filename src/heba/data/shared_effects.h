// Errors of the robot that captures share: the poses that it reports are wrong by a function of numbers that are the
// same for all captures, such as the offsets of its joints.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heba/geometry/rigid3.h"

namespace heba {

// A pose near the identity that is a function of effects which captures share: the error of the pose that the robot
// reports for one capture.
struct PoseEffect {
  virtual ~PoseEffect() = default;
  // Returns the pose. `tangent_from_effects`, which may be null, becomes the 6 x n derivative of its tangent (m, rad,
  // in the child frame) by the n effects.
  virtual Rigid3d Evaluate(const Eigen::VectorXd& effects, Matrix6X* tangent_from_effects) const = 0;
};
// Returns the pose [Exp(w), v] with (v, w) = G * effects.
std::shared_ptr<const PoseEffect> MakeLinearEffect(Matrix6X g);
// Returns the pose of `effect` if those of its `num_all` effects that are not among `indices` are zero.
std::shared_ptr<const PoseEffect> SelectEffects(std::shared_ptr<const PoseEffect> effect, int num_all,
                                                const std::vector<int>& indices);

// Effects whose prior density is normal, with mean zero and one standard deviation.
struct EffectGroup {
  std::string name;  // For example "offsets".
  std::string unit;  // "rad" or "m"; empty if there is none.
  double sigma = 1;  // In that unit: the standard deviation, or the initial guess if it is estimated.
  // The least standard deviation that robots with such effects have; 0 if there is none.
  double least_sigma = 0;
  // The largest standard deviation that is estimated; 0 if there is no limit.
  double most_sigma = 0;
  // The scale of a half-Cauchy prior of the standard deviation; 0 without one.
  double half_cauchy_sigma = 0;
};

// One unknown effect.
struct SharedEffect {
  std::string name;  // For example "joint2.offset".
  int index = 0;     // Index among the effects of View::effect.
  size_t group = 0;  // Index in SharedEffects::groups.
};

enum class SharedEffectsKind {
  kArm,     // Errors of an arm's parameters (heba/robot/arm_errors.h).
  kSmooth,  // Errors that vary smoothly with the pose (heba/data/smooth_errors.h).
};

// The effects that are estimated. The other effects of View::effect are zero.
struct SharedEffects {
  std::string name;  // The model, for example "joint offsets".
  SharedEffectsKind kind = SharedEffectsKind::kArm;
  int num_fitted = 0;  // Number of figures of the model itself that were fitted to the captures.
  int num_all = 0;     // Number of effects of View::effect.
  std::vector<EffectGroup> groups;
  std::vector<SharedEffect> effects;

  Eigen::Index size() const { return static_cast<Eigen::Index>(effects.size()); }
  std::vector<std::string> Names() const;
};

// Returns the values of all effects of View::effect from those that are estimated.
Eigen::VectorXd AllEffects(const SharedEffects& shared, const Eigen::VectorXd& estimated);

}  // namespace heba
