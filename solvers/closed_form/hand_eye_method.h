// Closed-form hand-eye methods: their common interface and the table of all methods.
//
// A method is given one pair of poses per capture, M_i = camera_mount_from_target_mount and C_i = camera_from_target,
// and finds X = camera_mount_from_camera and Z = target_mount_from_target with
//   X C_i = M_i Z                                                (the papers' AX = ZB, read as X B = A Z)
// or, for two captures i and j, without Z,
//   A X = X B,  A = M_j M_i^-1 (motion of the mounts), B = C_j C_i^-1 (motion seen by the camera).
// The equations hold for eye-to-hand and eye-in-hand alike: the setups differ only in the definition of M_i
// (heba/data/setup.h).
//
// Every method is exact on noise-free data of the motion that it is made for, and a change of the world frame or of
// the camera frame changes its result accordingly. Too few captures, parallel rotation axes and a motion that the
// method cannot use result in a Failure (tests/conformance/hand_eye_method_test.cc).
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "heba/base/error.h"
#include "heba/evaluation/metrics.h"
#include "solvers/closed_form/motion_sums.h"
#include "solvers/closed_form/target_position.h"

namespace heba {

// Selects the captures that a method can use: any motion with rotations about two axes, or the two-step motion
// (solvers/closed_form/two_step_motion.h).
enum class MethodMotion { kAny, kTwoStep };

// The input of all methods. Quantities that several methods need are computed once and cached.
class HandEyeInput {
 public:
  // `pairs` must outlive this object.
  HandEyeInput(const std::vector<PosePair>& pairs);  // NOLINT(google-explicit-constructor): pairs are an input.
  const std::vector<PosePair>& pairs() const { return *pairs_; }
  // Returns the reason why no method can determine the hand-eye pose from the captures, or nothing if the motion is
  // sufficient.
  const std::optional<Failure>& why_not() const { return why_not_; }
  // Computes the sums on the first call and caches them. Not safe to be called by several threads at once.
  const MotionSums& motions() const;
  // Computes the positions of the target's best-determined point, under the same conditions as motions().
  const TargetPositions& positions() const;

 private:
  const std::vector<PosePair>* pairs_;
  std::optional<Failure> why_not_;
  mutable std::optional<MotionSums> motions_;
  mutable std::optional<TargetPositions> positions_;
};

struct HandEyeMethod {
  std::string_view name;
  MethodMotion motion;
  std::string_view description;  // Includes the reference to the paper.
  // Is called only if the captures have no why_not.
  Outcome<HandEye> (*solve_observable)(const HandEyeInput& input);

  Outcome<HandEye> solve(const HandEyeInput& input) const {
    return input.why_not() ? *input.why_not() : solve_observable(input);
  }
};

// Returns all methods in the order of methods.def.
const std::vector<HandEyeMethod>& HandEyeMethods();
// Returns null if there is no method of this name.
const HandEyeMethod* FindHandEyeMethod(std::string_view name);
std::vector<std::string> HandEyeMethodNames();

}  // namespace heba
