#include "solvers/calibration/multi_start.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "heba/base/distributions.h"
#include "heba/base/error.h"
#include "heba/base/rng.h"
#include "heba/data/hand_eye.h"
#include "heba/evaluation/metrics.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/closed_form/known_rotation.h"
#include "solvers/refine/fit_start.h"
#include "solvers/refine/hand_eye_problem.h"
#include "solvers/refine/noise_iteration.h"
#include "solvers/residuals/inliers.h"
#include "solvers/residuals/noise_scale.h"

namespace heba {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Returns the stride that keeps no more than `most` of `count` elements.
size_t StrideFor(size_t count, size_t most) { return std::max<size_t>(1, (count + most - 1) / most); }

// Returns a part of the problem that is large enough to tell initial guesses apart and cheap to refine.
PairProblem PartOf(const PairProblem& problem) {
  constexpr size_t kMaxViews = 24;
  constexpr size_t kMaxPoints = 24;
  PairProblem part{problem.camera, {}, problem.setup, problem.shape};
  for (size_t i = 0; i < problem.views.size(); i += StrideFor(problem.views.size(), kMaxViews)) {
    View view = problem.views[i];
    const size_t n = view.observations.ids.size();
    std::vector<bool> keep(n, false);
    for (size_t k = 0; k < n; k += StrideFor(n, kMaxPoints)) keep[k] = true;
    // The covariances are dropped, because a subset of a covariance block cannot be kept.
    view.observations.covariances_px2.clear();
    view.observations.whitening.clear();
    view.observations = KeepPoints(view.observations, keep);
    part.views.push_back(std::move(view));
  }
  return part;
}

// Returns, for each pair, the sigma of one coordinate under the capture's own pose; infinite if there are no degrees
// of freedom left.
std::vector<double> OwnPoseSigmasPx(const PairProblem& problem, const std::vector<PosePair>& pairs) {
  std::vector<double> sigmas;
  for (size_t i = 0; i < pairs.size(); ++i) {
    const Observations& observations = problem.views[i].observations;
    const std::optional<SquaredErrors> errors = ViewErrors(problem.camera, pairs[i].camera_from_target, observations);
    const int dof = 2 * observations.size() - 6;
    sigmas.push_back(errors && dof > 0 ? std::sqrt(errors->sum_px2 / dof) : kInfinity);
  }
  return sigmas;
}

// Returns the pixel sigma of the captures whose points agree best with one another: the 10 % quantile of `sigmas`,
// corrected by the chi-square quantile for the selection of small values. All captures have about as many points.
double SigmaOfBestPx(std::vector<double> sigmas, const PairProblem& problem) {
  if (sigmas.empty()) return 0;
  constexpr double kShare = 0.1;
  const double dof = std::max(1, 2 * problem.views.front().observations.size() - 6);
  const auto chosen = sigmas.begin() + static_cast<std::ptrdiff_t>(kShare * static_cast<double>(sigmas.size()));
  std::nth_element(sigmas.begin(), chosen, sigmas.end());
  return std::isfinite(*chosen) ? *chosen / std::sqrt(ChiSquareQuantile(1 - kShare, dof) / dof) : 0;
}

// Returns Cauchy's cost of all points at a common scale. The residual of a point without an image counts as the image
// width.
double RobustCost(const PairProblem& problem, const HandEye& hand_eye, double sigma_px) {
  const Loss& cauchy = LossOf(LossKind::kCauchy);
  double cost = 0;
  for (const View& view : problem.views) {
    const std::optional<Points2> residuals =
        Residuals(problem.camera, CameraFromTarget(hand_eye, view.camera_mount_from_target_mount), view.observations);
    for (Eigen::Index i = 0; i < view.observations.size(); ++i) {
      const double distance_px = residuals ? residuals->col(i).norm() : problem.camera.width_px;
      cost += cauchy.rho(std::pow(distance_px / sigma_px, 2));
    }
  }
  return cost;
}

// Returns the best closed-form estimates of random subsets of four captures; some of many subsets contain no outlier.
// Every other subset is drawn from the half of the captures whose points agree best with one another.
std::vector<InitialGuess> RandomSubsetStarts(const PairProblem& part, const std::vector<PosePair>& pairs,
                                             const std::vector<double>& own_sigmas_px) {
  constexpr size_t kHandful = 4;
  constexpr int kNumHandfuls = 120;
  constexpr size_t kMaxSeeds = 4;
  if (pairs.size() <= 2 * kHandful) return {};
  std::vector<size_t> all(pairs.size());
  std::iota(all.begin(), all.end(), size_t{0});
  std::vector<size_t> better = all;
  std::sort(better.begin(), better.end(), [&](size_t a, size_t b) { return own_sigmas_px[a] < own_sigmas_px[b]; });
  better.resize(pairs.size() / 2);
  Rng rng(1);
  std::vector<std::pair<double, HandEye>> scored;
  for (int trial = 0; trial < kNumHandfuls; ++trial) {
    std::vector<size_t>& order = trial % 2 == 0 ? all : better;
    std::vector<PosePair> handful;
    for (size_t k = 0; k < kHandful; ++k) {
      std::swap(order[k], order[k + static_cast<size_t>(rng.Index(static_cast<int>(order.size() - k)))]);
      handful.push_back(pairs[order[k]]);
    }
    for (const char* name : {"shah", "two_step_ls"}) {
      const Outcome<HandEye> hand_eye = FindHandEyeMethod(name)->solve(handful);
      if (hand_eye) scored.emplace_back(RobustScalePx(part.camera, part.views, *hand_eye), *hand_eye);
    }
  }
  std::sort(scored.begin(), scored.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<InitialGuess> seeds;
  for (size_t i = 0; i < std::min(kMaxSeeds, scored.size()); ++i) {
    seeds.push_back({"a subset of captures", scored[i].second});
  }
  return seeds;
}

// Returns the seed's rotation multiplied by each rotation of a cube; translations and board pose follow by least
// squares.
std::vector<InitialGuess> RotatedStarts(const std::vector<PosePair>& pairs, const HandEye& start) {
  std::vector<InitialGuess> seeds;
  for (const Eigen::Matrix3d& turn : CubeRotations()) {
    const Eigen::Matrix3d rotation = start.camera_mount_from_camera.RotationMatrix() * turn;
    const HandEye board = WithAverageBoardPose(pairs, Rigid3d(rotation, Eigen::Vector3d::Zero()));
    seeds.push_back(
        {"a rotated start", SolveTranslations(pairs, rotation, board.target_mount_from_target.RotationMatrix())});
  }
  return seeds;
}

// Refines an initial guess robustly and only as far as it takes to tell it from others, with a fixed camera. A guess
// near the solution is there after some 20 steps; those that take more than 30 end far from it, and fail.
Outcome<HandEye> RefineRoughly(const PairProblem& part, const HandEye& start) {
  BundleOptions options;
  options.loss = LossKind::kTruncated;  // A start at which some targets are hidden is one.
  options.free_intrinsics = {};
  options.max_iterations = 30;
  const Problem problem = HandEyeProblem(part, options);
  Outcome<FitStart> at_start = StartFit(problem, HandEyePosesOf(start), options);
  if (!at_start) return at_start.failure();
  const Outcome<Fit> fit =
      IterateNoiseAndFit(std::move(at_start->fit), LossOf(LossKind::kCauchy), NoiseScale::kMedian, options);
  if (!fit) return fit.failure();
  return HandEyeOf(fit->state.poses);
}

double RejectedRatio(const PairProblem& problem, const PairSolution& solution) {
  size_t num_rejected = 0;
  size_t num_points = 0;
  for (const ViewOutcome& view : solution.views) num_rejected += view.rejected_ids.size();
  for (const View& view : problem.views) num_points += view.observations.ids.size();
  return static_cast<double>(num_rejected) / static_cast<double>(num_points);
}

// Rates how doubtful the residuals of a solution are; doubt begins at 1. Residuals that exceed those under the
// captures' own poses may be due to robot noise, but only up to an error that no robot has.
double FitQualityRatio(const PairProblem& problem, const std::vector<PosePair>& pairs,
                       const Outcome<PairSolution>& solution, double own_sigma_px) {
  if (!solution) return kInfinity;
  constexpr double kRejectedRatio = 0.2;
  constexpr double kSigmaRatio = 3;
  constexpr double kRobotM = 2e-3;
  double metres_per_px = 0;
  for (const PosePair& pair : pairs) {
    metres_per_px +=
        pair.camera_from_target.translation.norm() / problem.camera.params[0] / static_cast<double>(pairs.size());
  }
  const double sigma_px = solution->pixel_sigma_px;
  return std::max(
      RejectedRatio(problem, *solution) / kRejectedRatio,
      std::min(sigma_px / (kSigmaRatio * std::max(own_sigma_px, kMinSigmaPx)), sigma_px * metres_per_px / kRobotM));
}

}  // namespace

double RobustScalePx(const Camera& camera, const std::vector<View>& views, const HandEye& hand_eye) {
  constexpr size_t kMaxViews = 40;
  std::vector<double> squares;
  for (size_t i = 0; i < views.size(); i += StrideFor(views.size(), kMaxViews)) {
    const Observations& observations = views[i].observations;
    const std::optional<Points2> residuals =
        Residuals(camera, CameraFromTarget(hand_eye, views[i].camera_mount_from_target_mount), observations);
    for (Eigen::Index k = 0; k < observations.size(); ++k) {
      squares.push_back(residuals ? residuals->col(k).squaredNorm() : kInfinity);
    }
  }
  return SigmaFromMedian(std::move(squares));
}

MultiStartSolution RefineFromMultipleStarts(const PairProblem& problem, const std::vector<PosePair>& pairs,
                                            const std::vector<InitialGuess>& seeds, const BundleOptions& options) {
  CHECK(!seeds.empty());
  CHECK_LE(pairs.size(), problem.views.size());
  MultiStartSolution best{RefineHandEye(problem, seeds.front().hand_eye, options), seeds.front().name};
  const std::vector<double> own_sigmas_px = OwnPoseSigmasPx(problem, pairs);
  const double own_sigma_px = SigmaOfBestPx(own_sigmas_px, problem);
  const double doubt = FitQualityRatio(problem, pairs, best.solution, own_sigma_px);
  if (doubt < 1) return best;

  const PairProblem part = PartOf(problem);
  std::vector<InitialGuess> others(seeds.begin() + 1, seeds.end());
  for (InitialGuess& seed : RandomSubsetStarts(part, pairs, own_sigmas_px)) others.push_back(std::move(seed));
  // Unmodelled robot noise raises the same doubt, so all rotations are tried only if the fit is far off.
  constexpr double kFarOff = 10;
  if (doubt > kFarOff) {
    for (InitialGuess& seed : RotatedStarts(pairs, seeds.front().hand_eye)) others.push_back(std::move(seed));
  }
  const double scale_px = std::max(own_sigma_px, kMinSigmaPx);
  const InitialGuess* promising = nullptr;
  HandEye promising_start;
  double least_cost = kInfinity;
  for (const InitialGuess& seed : others) {
    const Outcome<HandEye> trial = RefineRoughly(part, seed.hand_eye);
    if (!trial) continue;
    const double cost = RobustCost(part, *trial, scale_px);
    if (cost >= least_cost) continue;
    least_cost = cost;
    promising = &seed;
    promising_start = *trial;
  }
  if (promising == nullptr) return best;
  MultiStartSolution other{RefineHandEye(problem, promising_start, options), promising->name};
  if (!other.solution) return best;
  constexpr double kBetter = 0.97;
  const auto cost_of = [&](const PairSolution& solution) {
    return RobustCost({solution.camera, ApplyShape(problem.views, solution.shape)}, solution.hand_eye, scale_px);
  };
  if (!best.solution || cost_of(*other.solution) < kBetter * cost_of(*best.solution)) {
    return other;
  }
  return best;
}

}  // namespace heba
