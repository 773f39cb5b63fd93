#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <pybind11/stl.h>

#include "heba/base/error.h"
#include "heba/closed_form.h"
#include "heba/pair_calibration.h"
#include "python/bindings/arrays.h"
#include "python/bindings/bindings.h"
#include "tools/text/failure_text.h"

namespace heba {
namespace {

// Returns the refined poses of heba's own method, which weighs the errors of the robot's poses against those of the
// target's; a refinement with exact robot poses, or the best closed form, if that has no result.
Outcome<HandEye> BestHandEye(Setup setup, const std::vector<PosePair>& pairs) {
  PoseCalibrationOptions options;
  options.setup = setup;
  Outcome<HandEye> best;
  for (const bool has_robot_noise : {true, false}) {
    options.has_robot_noise = has_robot_noise;
    const PairCalibration calibration = CalibratePoses(pairs, options);
    if (calibration.chain) return calibration.chain->hand_eye;
    best = calibration.chain.failure();
    for (const MethodResult& method : calibration.methods) {
      if (method.method == calibration.seed && method.hand_eye) best = method.hand_eye;
    }
  }
  return best;
}

std::pair<pybind11::array, pybind11::array> SolvePairs(const std::string& setup_name, const DoubleArray& mounts,
                                                       const DoubleArray& targets, const std::string& method) {
  const Setup setup = setup_name == "eye_in_hand" ? Setup::kEyeInHand : Setup::kEyeToHand;
  const std::vector<Rigid3d> base_from_grippers = PosesFrom(mounts);
  const std::vector<Rigid3d> camera_from_targets = PosesFrom(targets);
  std::vector<PosePair> pairs;
  for (size_t i = 0; i < base_from_grippers.size(); ++i) {
    pairs.push_back({CameraMountFromTargetMount(setup, base_from_grippers[i]), camera_from_targets[i]});
  }
  Outcome<HandEye> found;
  {
    const pybind11::gil_scoped_release release;
    found = method == "best" ? BestHandEye(setup, pairs) : SolveClosedForm(method, pairs);
  }
  if (!found) throw InputError(FailureText(found.failure(), ConfigKeys::kOmitted));
  return {ArrayOf(found->camera_mount_from_camera), ArrayOf(found->target_mount_from_target)};
}

}  // namespace

void BindPosePairs(pybind11::module_& module) {
  module.def("solve_pairs", &SolvePairs, pybind11::arg("setup"), pybind11::arg("base_from_gripper"),
             pybind11::arg("camera_from_target"), pybind11::arg("method"));
  module.def("closed_forms", [] {
    std::vector<std::pair<std::string, std::string>> forms;
    for (const ClosedForm& form : ClosedForms()) forms.emplace_back(form.name, form.description);
    return forms;
  });
}

}  // namespace heba
