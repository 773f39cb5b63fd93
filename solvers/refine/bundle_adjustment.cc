#include "heba/bundle_adjustment.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "heba/refinement.h"
#include "solvers/closed_form/motion_analysis.h"
#include "solvers/refine/hand_eye_problem.h"

namespace heba {

Outcome<PairSolution> RefineHandEye(const PairProblem& problem, const HandEye& start, const BundleOptions& options) {
  std::vector<Rigid3d> poses;
  for (const View& view : problem.views) poses.push_back(view.camera_mount_from_target_mount);
  if (const std::optional<Failure> why_not = WhyNotObservable(AnalyseMotion(poses))) return *why_not;
  const Outcome<Solution> solution = RefineProblem(HandEyeProblem(problem, options), HandEyePosesOf(start), options);
  if (!solution) return solution.failure();
  return HandEyeSolution(*solution, options);
}

}  // namespace heba
