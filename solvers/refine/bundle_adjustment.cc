#include "heba/bundle_adjustment.h"

#include <algorithm>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "solvers/closed_form/motion_analysis.h"
#include "solvers/refine/bundle_model.h"
#include "solvers/refine/fit.h"
#include "solvers/refine/hand_eye_problem.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {

std::string BundleOptions::Check() const { return AdjustmentOptionsOf(*this).Check(); }

FreeUnknowns FreeOf(const CameraModel& model, const BundleOptions& options) {
  return {FreeOf(model, options.free_intrinsics, options.free_shape), options.effects};
}

const Loss& InlierLoss(const BundleOptions& options) {
  return LossOf(options.loss == LossKind::kTruncated ? LossKind::kNone : options.loss);
}

Outcome<Solution> RefineHandEye(const Problem& problem, const HandEye& start, const BundleOptions& options) {
  std::vector<Rigid3d> poses;
  for (const View& view : problem.views) poses.push_back(view.camera_mount_from_target_mount);
  const std::string why_not = WhyNotObservable(AnalyseMotion(poses));
  if (!why_not.empty()) return Failure{why_not};
  const Outcome<RigSolution> solution =
      RefineRig(HandEyeProblem(problem, options), HandEyePosesOf(start), AdjustmentOptionsOf(options));
  if (!solution) return Failure{solution.reason()};
  return HandEyeSolution(*solution, options);
}

namespace {

// The rows and the variances of a solution, by which its restricted likelihood is computed.
struct SolutionRows {
  std::vector<LinearisedView> views;
  std::vector<VarianceGroup> groups;
  Eigen::Index num_common;

  double LogLikelihood(double pixel_sigma_px) const {
    return RestrictedLogLikelihood(views, pixel_sigma_px, groups, num_common);
  }
};

// Returns nothing if a point cannot be projected.
std::optional<SolutionRows> RowsOf(const Problem& problem, const Solution& solution, const BundleOptions& options) {
  const Loss& loss = InlierLoss(options);
  RigProblem whole = HandEyeProblem(problem, options);
  whole.cameras[0].camera = solution.camera;
  const RigSolution of_whole = ProblemSolution(solution);
  const FitNoise noise = NoiseOf(of_whole);
  std::optional<std::vector<LinearisedView>> views =
      LineariseFit(whole, GroupByRobotPoses(whole), StateOf(of_whole), noise, loss, loss.consistency);
  if (!views) return std::nullopt;
  VarianceSetting setting;
  setting.pixel_variance = loss.consistency;
  setting.robot_prior = options.robot_noise_prior;
  setting.effects_avoid_zero = false;  // Models are compared without that.
  return SolutionRows{std::move(*views), VarianceGroupsOf(whole, noise, setting),
                      RigUnknowns(whole).Block(kTargetBlock).first};
}

}  // namespace

double LogLikelihoodOf(const Problem& problem, const Solution& solution, const BundleOptions& options) {
  const std::optional<SolutionRows> rows = RowsOf(problem, solution, options);
  return rows ? rows->LogLikelihood(solution.pixel_sigma_px) : -std::numeric_limits<double>::infinity();
}

std::optional<double> LogLikelihoodAtLeast(const Problem& problem, const Solution& solution,
                                           const BundleOptions& options, const SharedEffects& smaller) {
  if (options.effects == nullptr) return std::nullopt;
  std::optional<SolutionRows> rows = RowsOf(problem, solution, options);
  if (!rows || !RaiseToLeast(rows->views, *options.effects, smaller, &rows->groups)) return std::nullopt;
  return rows->LogLikelihood(solution.pixel_sigma_px);
}

}  // namespace heba
