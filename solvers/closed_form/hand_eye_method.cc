#include "solvers/closed_form/hand_eye_method.h"

#include "heba/base/registry.h"
#include "solvers/closed_form/motion_analysis.h"

namespace heba {

HandEyeInput::HandEyeInput(const std::vector<PosePair>& pairs) : pairs_(&pairs) {
  std::vector<Rigid3d> poses;
  poses.reserve(pairs.size());
  for (const PosePair& pair : pairs) poses.push_back(pair.camera_mount_from_target_mount);
  why_not_ = WhyNotObservable(AnalyseMotion(poses));
}

const MotionSums& HandEyeInput::motions() const {
  if (!motions_) motions_ = SumMotions(*pairs_);
  return *motions_;
}

const TargetPositions& HandEyeInput::positions() const {
  if (!positions_) positions_ = BestKnownPositions(*pairs_);
  return *positions_;
}

#define HEBA_HAND_EYE_METHOD(name, motion, description) Outcome<HandEye> SolveHandEye_##name(const HandEyeInput& input);
#include "solvers/closed_form/methods.def"
#undef HEBA_HAND_EYE_METHOD

const std::vector<HandEyeMethod>& HandEyeMethods() {
  static const std::vector<HandEyeMethod> methods = {
#define HEBA_HAND_EYE_METHOD(name, motion, description) \
  {#name, MethodMotion::motion, description, &SolveHandEye_##name},
#include "solvers/closed_form/methods.def"
#undef HEBA_HAND_EYE_METHOD
  };
  return methods;
}

const HandEyeMethod* FindHandEyeMethod(std::string_view name) { return FindEntry(HandEyeMethods(), name); }

std::vector<std::string> HandEyeMethodNames() { return NamesOf(HandEyeMethods()); }

}  // namespace heba
