#include "solvers/calibration/smooth_remainder.h"

#include <utility>
#include <vector>

#include "heba/base/units.h"
#include "solvers/calibration/choice_levels.h"
#include "solvers/calibration/smooth_search.h"
#include "solvers/refine/fit.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// Returns H (smooth_remainder.h) of the smooth errors of an arm, whose corrections are the effects from `first_column`.
Eigen::MatrixXd ChangesBy(const SmoothErrors& errors, const std::vector<LinearisedView>& views,
                          const std::vector<Rigid3d>& poses, Eigen::Index first_column,
                          const Eigen::VectorXd& variances, const Eigen::MatrixXd& covariance) {
  const Eigen::Index n = covariance.rows();
  Eigen::MatrixXd products = Eigen::MatrixXd::Zero(n, errors.effects().size());
  for (size_t i = 0; i < poses.size(); ++i) {
    LinearisedView view = views[i];
    view.by_unknowns.conservativeResize(Eigen::NoChange, n + 6);
    view.by_unknowns.rightCols<6>() = view.by_effects.middleCols<6>(first_column);
    const RowMajorMatrix whitened = WhitenedRows(view, 1, variances);
    products += whitened.leftCols(n).transpose() * (whitened.middleCols<6>(n) * errors.GripperByEffects(poses[i]));
  }
  return covariance * products;
}

Finding DescribeRemainder(const std::string& arm, const FoundSmoothErrors& found) {
  const std::vector<EffectGroup>& groups = found.errors.effects().groups;
  const SmoothLengths& lengths = found.errors.lengths();
  return {Grade::kGood,
          FindingCode("smooth_errors"),
          {{"smooth_mm", 1000 * groups[0].sigma},
           {"smooth_deg", RadToDeg(groups[1].sigma)},
           {"length_mm", 1000 * lengths.translation_m},
           {"length_deg", RadToDeg(lengths.rotation_rad)},
           {"p_value", PValueWithout(found)}},
          {{"evidence", "shown"}, {"beside", "errors_of_arm"}, {"of_arm", arm}}};
}

}  // namespace

Advice DiagnoseSmoothRemainder(const Problem& problem, const Solution& solution) {
  Advice advice;
  const Problem weighted = WeightedAs(solution, problem);
  const CaptureGroups groups = GroupByRobotPoses(weighted);
  const std::vector<size_t> moving = MovingRobots(weighted);
  const FitNoise noise = NoiseOf(solution);
  if (noise.robots.empty()) return advice;
  const std::optional<std::vector<LinearisedView>> views =
      LineariseFit(weighted, groups, StateOf(solution), noise, LossOf(LossKind::kNone), 1);
  if (!views) return advice;
  const Eigen::VectorXd variances = CorrectionVariances(noise, NoisyJointsOf(weighted, moving));
  for (size_t k = 0; k < moving.size(); ++k) {
    const SharedEffects* const effects = EffectsOf(weighted, moving[k]);
    if (effects == nullptr || effects->kind != SharedEffectsKind::kArm) continue;
    SmoothSearch search{*views, {}, VarianceGroupsOf(weighted, noise, {}), 6 * static_cast<Eigen::Index>(k), false};
    for (const std::vector<size_t>& group : groups) {
      search.poses.push_back(weighted.captures[group.front()].base_from_gripper[moving[k]]);
    }
    const FoundSmoothErrors found = FindSmoothErrors(search);
    if (PValueWithout(found) >= kRandomErrorsRejected) continue;
    const Eigen::MatrixXd changes =
        ChangesBy(found.errors, *views, search.poses, search.first_column, variances, solution.covariance.matrix);
    const SharedEffects& smooth = found.errors.effects();
    for (Eigen::Index j = 0; j < changes.cols(); ++j) {
      const double sigma = smooth.groups[smooth.effects[static_cast<size_t>(j)].group].sigma;
      advice.changes.emplace_back(sigma * changes.col(j));
    }
    advice.findings.push_back(DescribeRemainder(problem.robots[moving[k]], found));
  }
  return advice;
}

}  // namespace heba
