#include "solvers/rig/rig_of_one.h"

#include <algorithm>
#include <utility>

#include "solvers/refine/hand_eye_problem.h"

namespace heba {

RigOfOne AsRig(const Calibration& calibration, const CalibrationOptions& options) {
  const Solution& solution = *calibration.refined;
  // The views, and whether they are used.
  std::vector<std::pair<const View*, bool>> views;
  for (const View& view : calibration.views) views.emplace_back(&view, true);
  for (const View& view : calibration.left_out) views.emplace_back(&view, false);
  std::stable_sort(views.begin(), views.end(),
                   [](const auto& a, const auto& b) { return a.first->capture < b.first->capture; });
  RigOfOne rig;
  Problem problem{calibration.camera, {}, options.setup, options.shape};
  for (const auto& [view, is_used] : views) {
    if (!is_used) rig.judged.left_out.insert({problem.views.size(), 0});
    rig.captures.push_back(view->capture);
    problem.views.push_back(*view);
  }
  BundleOptions bundle = calibration.bundle;
  bundle.effects = solution.shared_effects;  // The effects that were estimated.
  rig.problem = HandEyeProblem(problem, bundle);
  rig.problem.targets[0].symmetries = options.symmetries;
  // The tests of images do not know noisy joints.
  for (RigCapture& capture : rig.problem.captures) capture.postures.clear();
  rig.judged.solution = ProblemSolution(solution);
  rig.judged.solution.captures.clear();  // They are in another order.
  return rig;
}

}  // namespace heba
