#include "solvers/hand_eye_method.h"

namespace heba {

#define HEBA_HAND_EYE_METHOD(name, motion, description) \
  Outcome<HandEye> SolveHandEye_##name(const std::vector<PosePair>& pairs);
#include "solvers/methods.def"
#undef HEBA_HAND_EYE_METHOD

const std::vector<HandEyeMethod>& HandEyeMethods() {
  static const std::vector<HandEyeMethod> methods = {
#define HEBA_HAND_EYE_METHOD(name, motion, description) \
  {#name, MethodMotion::motion, description, &SolveHandEye_##name},
#include "solvers/methods.def"
#undef HEBA_HAND_EYE_METHOD
  };
  return methods;
}

const HandEyeMethod* FindHandEyeMethod(std::string_view name) {
  for (const HandEyeMethod& method : HandEyeMethods()) {
    if (method.name == name) return &method;
  }
  return nullptr;
}

std::vector<std::string> HandEyeMethodNames() {
  std::vector<std::string> names;
  for (const HandEyeMethod& method : HandEyeMethods()) names.emplace_back(method.name);
  return names;
}

}  // namespace heba
