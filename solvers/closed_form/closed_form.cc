#include "heba/closed_form.h"

#include "solvers/closed_form/hand_eye_method.h"

namespace heba {

std::vector<ClosedForm> ClosedForms() {
  std::vector<ClosedForm> all;
  for (const HandEyeMethod& method : HandEyeMethods()) {
    all.push_back({std::string(method.name), std::string(method.description)});
  }
  return all;
}

Outcome<HandEye> SolveClosedForm(std::string_view method, const std::vector<PosePair>& pairs) {
  const HandEyeMethod* const found = FindHandEyeMethod(method);
  CHECK(found != nullptr) << "no closed form is named " << method;
  return found->solve(pairs);
}

}  // namespace heba
