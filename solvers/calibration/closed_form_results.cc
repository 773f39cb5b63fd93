#include "solvers/calibration/closed_form_results.h"

#include <algorithm>
#include <utility>

#include "solvers/closed_form/hand_eye_method.h"

namespace heba {
namespace {

MethodResult ResultOf(const HandEyeMethod& method, Outcome<HandEye> hand_eye, const PairCalibration& calibration) {
  MethodResult result;
  result.method = method.name;
  result.hand_eye = std::move(hand_eye);
  if (result.hand_eye) {
    const std::optional<SquaredErrors> errors =
        ReprojectionErrors(*result.hand_eye, calibration.camera, calibration.views);
    if (errors) result.reprojection_rms_px = errors->RmsPx();
  }
  return result;
}

}  // namespace

std::vector<MethodResult> RunMethods(const PairCalibration& calibration,
                                     const std::vector<std::optional<Outcome<HandEye>>>& known) {
  std::vector<MethodResult> results;
  const HandEyeInput input(calibration.pairs);
  for (size_t i = 0; i < HandEyeMethods().size(); ++i) {
    const HandEyeMethod& method = HandEyeMethods()[i];
    results.push_back(ResultOf(method, i < known.size() && known[i] ? *known[i] : method.solve(input), calibration));
  }
  return results;
}

const MethodResult* FindResult(const std::vector<MethodResult>& results, const std::string& name) {
  const auto found =
      std::find_if(results.begin(), results.end(), [&](const MethodResult& r) { return r.method == name; });
  return found == results.end() ? nullptr : &*found;
}

std::vector<MethodResult> Reported(const std::vector<MethodResult>& results, const std::vector<std::string>& names) {
  if (names.empty()) return results;
  std::vector<MethodResult> reported;
  for (const std::string& name : names) {
    const MethodResult* result = FindResult(results, name);
    CHECK(result != nullptr) << name;
    reported.push_back(*result);
  }
  return reported;
}

}  // namespace heba
