#include "solvers/calibration/lens_choice.h"

#include <algorithm>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>
#include <string>
#include <utility>

#include "heba/base/error.h"
#include "solvers/calibration/camera_choice.h"
#include "solvers/refine/fit.h"

namespace heba {
namespace {

using Robot = BundleOptions::Robot;

// Returns the options with all noise held at that of a solution.
AdjustmentOptions WithNoiseOf(const Solution& solution, AdjustmentOptions options) {
  // Every camera has the noise of the first one, which differs from the others' by a constant factor.
  options.pixel_noise_px = solution.pixel_sigmas_px.front();
  for (const std::optional<RobotNoise>& noise : solution.robot_noise) {
    if (!noise) continue;
    options.robot = Robot::kGivenNoise;
    options.robot_noise = *noise;
    break;
  }
  return options;
}

// Returns the problem with the sigmas of the arms' effects held at those of a solution.
Problem WithSigmasOf(const Solution& solution, Problem problem) {
  for (size_t r = 0; r < problem.effects.size(); ++r) {
    if (problem.effects[r] == nullptr) continue;
    auto effects = std::make_shared<SharedEffects>(*problem.effects[r]);
    for (size_t g = 0; g < effects->groups.size(); ++g) effects->groups[g].sigma = solution.effect_sigmas[r][g];
    problem.effects[r] = std::move(effects);
  }
  return problem;
}

// A lens that was fitted with the noise of the largest one.
struct FittedLens {
  Solution solution;
  std::vector<double> costs;  // GroupCosts.
  size_t alternative = 0;     // Index in LensChoice::alternatives.
};

}  // namespace

Outcome<LensChoice> ChooseLens(const ModelComparison& comparison, size_t camera, const ProblemModel& model) {
  const std::vector<Camera>& lenses = comparison.space.lenses[camera];
  LensChoice choice;
  for (const Camera& lens : lenses) {
    choice.alternatives.push_back({lens.model, 0, static_cast<int>(lens.params.size()), std::nullopt});
  }
  Problem problem = WithModel(comparison.problem, model, comparison.space);
  CellPoses from = comparison.start;
  AdjustmentOptions options = comparison.options;
  options.robot = model.robot;
  std::vector<FittedLens> fitted;  // The largest first.
  Failure last;
  double dof = std::numeric_limits<double>::infinity();
  for (size_t i = lenses.size(); i-- > 0;) {
    Problem with_lens = problem;
    Camera& of_camera = with_lens.cameras[camera].camera;
    if (of_camera.model != lenses[i].model) of_camera = lenses[i];
    if (fitted.empty()) {
      const Outcome<Solution> own = RefineProblem(with_lens, from, options);
      if (!own) {
        choice.alternatives[i].reason = last = own.failure();
        continue;
      }
      dof = own->covariance_dof;
      options = WithNoiseOf(*own, std::move(options));
      problem = WithSigmasOf(*own, std::move(problem));
      from = own->poses;
      with_lens = StartingFrom(problem, *own);
    }
    const Outcome<Solution> solution = RefineProblem(with_lens, from, options);
    if (solution) {
      fitted.push_back({*solution,
                        GroupCosts(problem, GroupByRobotPoses(problem), StateOf(*solution), NoiseOf(*solution),
                                   LossOf(options.loss)),
                        i});
    } else {
      choice.alternatives[i].reason = solution.failure();
    }
  }
  if (fitted.empty()) return last;
  const auto sum = [](const std::vector<double>& costs) { return std::accumulate(costs.begin(), costs.end(), 0.0); };
  const FittedLens* chosen = nullptr;
  for (size_t k = fitted.size(); k-- > 0;) {
    CameraAlternative& alternative = choice.alternatives[fitted[k].alternative];
    const Camera& smaller_lens = fitted[k].solution.cameras[camera];
    alternative.log_likelihood = sum(fitted.front().costs) - sum(fitted[k].costs);
    bool is_rejected = false;
    for (size_t larger = 0; larger < k; ++larger) {
      std::vector<double> gains;
      for (size_t g = 0; g < fitted[k].costs.size(); ++g) {
        gains.push_back(fitted[k].costs[g] - fitted[larger].costs[g]);
      }
      const LensComparison of_two =
          CompareLenses(gains, NumMoreParams(smaller_lens, fitted[larger].solution.cameras[camera]), dof);
      alternative.p = std::min(alternative.p.value_or(1), of_two.p);
      is_rejected = is_rejected || of_two.RejectsSmaller();
    }
    if (k > 0) alternative.reason = WhyNotBesideLarger(smaller_lens);
    if (chosen == nullptr && !is_rejected && alternative.reason.empty()) chosen = &fitted[k];
  }
  CHECK(chosen != nullptr) << "the largest lens cannot be rejected";
  choice.solution = chosen->solution;
  return choice;
}

std::vector<Problem> WithLenses(const Problem& problem, const ModelSpace& space) {
  std::vector<Problem> with_lenses = {problem};
  for (size_t c = 0; c < space.lenses.size(); ++c) {
    const std::vector<Camera>& lenses = space.lenses[c];
    for (auto lens = lenses.rbegin(); lenses.size() > 1 && lens != lenses.rend(); ++lens) {
      if (lens->model == problem.cameras[c].camera.model) continue;
      with_lenses.push_back(problem);
      with_lenses.back().cameras[c].camera = *lens;
    }
  }
  return with_lenses;
}

}  // namespace heba
