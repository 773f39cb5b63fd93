#include "solvers/rig/rig_smooth_errors.h"

#include <optional>
#include <utility>

#include "solvers/rig/rig_fit.h"
#include "solvers/rig/rig_outliers.h"

namespace heba {

std::vector<SmoothErrorsOfArm> FindSmoothErrorsOfArms(const RigProblem& problem, const RigSolution& solution) {
  const RigProblem weighted = WeightedAs(solution, problem);
  const RigNoise noise = NoiseOf(solution);
  const std::vector<size_t> moving = MovingRobots(weighted);
  const std::optional<LinearisedImages> images =
      LineariseImages(weighted, GroupByRobotPoses(weighted), StateOf(solution), noise, LossOf(LossKind::kNone));
  std::vector<SmoothErrorsOfArm> errors;
  if (!images || noise.robots.size() != moving.size()) return errors;
  std::vector<LinearisedView> captures = StackGroups(images->views, images->groups);
  for (LinearisedView& view : PriorViews(weighted, StateOf(solution), 1, captures.front().by_effects.cols())) {
    captures.push_back(std::move(view));
  }
  for (size_t k = 0; k < moving.size(); ++k) {
    if (EffectsOf(weighted, moving[k]) != nullptr) continue;
    SmoothSearch search{captures,
                        {},
                        1,
                        RigVarianceGroups(weighted, noise, 1, true, true, std::nullopt),
                        6 * static_cast<Eigen::Index>(k)};
    for (const std::vector<size_t>& group : images->groups) {
      const RigCapture& capture = weighted.captures[images->images[group.front()].capture];
      search.poses.push_back(capture.base_from_gripper[moving[k]]);
    }
    errors.push_back({moving[k], FindSmoothErrors(search)});
  }
  return errors;
}

}  // namespace heba
