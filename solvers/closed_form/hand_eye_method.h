// Closed-form hand-eye methods: what one is, and the table of them.
//
// A method gets one pair of poses a capture, M_i = camera_mount_from_target_mount and C_i = camera_from_target, and
// finds X = camera_mount_from_camera and Z = target_mount_from_target with
//   X C_i = M_i Z                                                (the papers' AX = ZB, read as X B = A Z)
// or, for two captures i and j, without Z,
//   A X = X B,  A = M_j M_i^-1 (motion of the mounts), B = C_j C_i^-1 (motion seen by the camera).
// It serves eye-to-hand and eye-in-hand alike: the set-ups differ in what M_i is (heba/data/setup.h).
//
// For every method: exact on noise-free data of the motion that it is made for; a change of the world's or of the
// camera's frame changes the answer in the same way; too few captures, parallel rotation axes and a motion that it
// cannot use are a Failure (tests/conformance/hand_eye_method_test.cc).
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

// What captures a method can use: any with turns about two axes, or those of the two-step motion
// (solvers/closed_form/two_step_motion.h).
enum class MethodMotion { kAny, kTwoStep };

// What the methods are given: several of them share what is calculated of the captures.
class HandEyeInput {
 public:
  // `pairs` must outlive it.
  HandEyeInput(const std::vector<PosePair>& pairs);  // NOLINT(google-explicit-constructor): pairs are an input.
  const std::vector<PosePair>& pairs() const { return *pairs_; }
  // Why no method can determine a hand-eye pose from the captures; nothing if one may.
  const std::optional<Failure>& why_not() const { return why_not_; }
  // Summed when first asked for: not by several threads at once.
  const MotionSums& motions() const;
  // Of the target's best known point; likewise.
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
  std::string_view description;  // With the paper.
  // Of captures that have no why_not.
  Outcome<HandEye> (*solve_observable)(const HandEyeInput& input);

  Outcome<HandEye> solve(const HandEyeInput& input) const {
    return input.why_not() ? *input.why_not() : solve_observable(input);
  }
};

// In the order of methods.def.
const std::vector<HandEyeMethod>& HandEyeMethods();
// Null if there is none of that name.
const HandEyeMethod* FindHandEyeMethod(std::string_view name);
std::vector<std::string> HandEyeMethodNames();

}  // namespace heba
