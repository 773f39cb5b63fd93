#include "solvers/study/study.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "heba/base/failure_code.h"
#include "heba/base/median.h"
#include "heba/base/rng.h"
#include "solvers/refine/fit.h"
#include "solvers/refine/noise_iteration.h"
#include "solvers/study/hand_eye_estimates.h"
#include "solvers/study/pose_estimates.h"
#include "solvers/study/study_captures.h"
#include "solvers/study/study_places.h"

namespace heba {
namespace {

TrialEstimate EstimateOf(StudyEstimator estimator, const Rigid3d& truth, const Outcome<PoseEstimate>& found) {
  TrialEstimate estimate;
  estimate.method = kStudyEstimatorNames[static_cast<size_t>(estimator)];
  estimate.ok = found.ok();
  if (!found) return estimate;
  estimate.error = LocalCoordinates(truth, found->pose);
  estimate.is_covered = IsCovered(estimate.error, found->covariance, found->dof);
  return estimate;
}

// Computes RMS errors from the mean squared error of each unknown (TrialEstimate::error).
StudyErrors FromMeanSquares(const StudyCell& cell, const Eigen::VectorXd& squares) {
  constexpr Eigen::Index kBoard = 6;
  constexpr Eigen::Index kFocal = 12;
  const auto length_at = [&](Eigen::Index at) { return std::sqrt(squares.segment<3>(at).sum()); };
  StudyErrors errors;
  errors.hand_eye_m = length_at(0);
  errors.hand_eye_rad = length_at(3);
  if (squares.size() == kBoard) return errors;
  errors.board_m = length_at(kBoard);
  errors.board_rad = length_at(kBoard + 3);
  const ProblemCamera& camera = cell.problem.cameras[0];
  const FreeParameters free = FreeOf(camera.camera.Model(), camera.free_intrinsics);
  if (free[0] && free[1] && squares.size() >= kFocal + 2) {
    errors.focal_px = std::sqrt(0.5 * squares.segment<2>(kFocal).sum());
  }
  return errors;
}

// Counts how often something is true of the trials of which it is known.
struct Share {
  int num_true = 0;
  int num = 0;

  void Add(const std::optional<bool>& is_true) {
    num += is_true ? 1 : 0;
    num_true += is_true.value_or(false) ? 1 : 0;
  }
  std::optional<double> Value() const {
    return num > 0 ? std::optional(static_cast<double>(num_true) / num) : std::nullopt;
  }
};

std::optional<double> RmsOf(const PlaceErrors& errors) {
  return errors.num > 0 ? std::optional(std::sqrt(errors.sum_m2 / errors.num)) : std::nullopt;
}

// Summarises the estimates of one pose by one method; those of trials that lack it are null.
MethodSummary SummaryOf(const StudyCell& cell, const std::string& method,
                        const std::vector<const TrialEstimate*>& estimates) {
  MethodSummary summary;
  summary.method = method;
  summary.num_trials = static_cast<int>(estimates.size());
  Eigen::VectorXd squares;
  Share covered;
  Share right;
  Share with_effects;
  PlaceErrors inside;
  PlaceErrors outside;
  std::vector<double> pixel_sigmas;
  std::vector<double> translations;
  std::vector<double> rotations;
  for (const TrialEstimate* const estimate : estimates) {
    if (estimate == nullptr || !estimate->ok) {
      ++summary.num_failed;
      continue;
    }
    if (squares.size() == 0) squares = Eigen::VectorXd::Zero(estimate->error.size());
    squares += estimate->error.cwiseAbs2();
    summary.axxb_mean_mm += estimate->axxb_mean_mm;
    covered.Add(estimate->is_covered);
    right.Add(estimate->has_right_model);
    with_effects.Add(estimate->has_effects);
    inside.Add(estimate->inside);
    outside.Add(estimate->outside);
    if (estimate->pixel_sigma_px) pixel_sigmas.push_back(*estimate->pixel_sigma_px);
    if (estimate->robot_noise) {
      translations.push_back(estimate->robot_noise->translation_m);
      rotations.push_back(estimate->robot_noise->rotation_rad);
    }
  }
  const int num_good = summary.num_trials - summary.num_failed;
  if (num_good > 0) {
    summary.rms = FromMeanSquares(cell, squares / num_good);
    summary.axxb_mean_mm /= num_good;
  }
  summary.coverage = covered.Value();
  summary.right_model = right.Value();
  summary.estimated_effects = with_effects.Value();
  summary.rms.inside_m = RmsOf(inside);
  summary.rms.outside_m = RmsOf(outside);
  summary.coverage_inside = Share{inside.num_covered, inside.num}.Value();
  summary.coverage_outside = Share{outside.num_covered, outside.num}.Value();
  if (!pixel_sigmas.empty()) summary.pixel_sigma_px = Median(pixel_sigmas);
  if (!translations.empty()) summary.robot_noise = RobotNoise{Median(translations), Median(rotations)};
  return summary;
}

}  // namespace

std::vector<std::string> StudiedPoses(const StudyCell& cell) {
  if (IsHandEye(cell)) return {""};
  std::vector<std::string> names;
  for (const PoseEstimate& pose : TruePoses(cell)) names.push_back(pose.name);
  return names;
}

std::vector<std::vector<TrialEstimate>> RunTrial(const StudyCell& cell, uint64_t seed, int trial) {
  Rng rng(seed, static_cast<uint64_t>(trial));
  if (IsHandEye(cell)) return {EstimateHandEye(cell, rng)};
  const Problem problem = SimulateProblem(cell, rng);
  const std::vector<PoseEstimate> truth = TruePoses(cell);
  std::vector<std::vector<TrialEstimate>> estimates(truth.size());
  for (const StudyEstimator estimator : cell.estimators) {
    const PoseEstimates found = EstimatePoses(cell, estimator, problem);
    for (size_t i = 0; i < truth.size(); ++i) {
      if (found[i]) estimates[i].push_back(EstimateOf(estimator, truth[i].pose, *found[i]));
    }
  }
  return estimates;
}

Outcome<std::vector<PoseBound>> ErrorBounds(const StudyCell& cell) {
  const Problem problem = ExactProblem(cell);
  Fit fit;
  fit.problem = Borrowed(problem);
  fit.groups = GroupByRobotPoses(problem);
  if (fit.groups.empty()) return Failure{FailureCode("no_target_in_view")};
  fit.state.poses = cell.poses;
  for (const ProblemCamera& camera : problem.cameras) fit.state.cameras.push_back(camera.camera);
  for (const ProblemTarget& target : problem.targets) fit.state.shapes.push_back(target.shape);
  fit.noise.pixel_px.assign(problem.cameras.size(), cell.pixel_sigma_px);
  fit.noise.image_px.assign(problem.cameras.size(), 0);
  RobotNoise noise = cell.robot_noise;
  if (cell.robot) noise.joint_rad = cell.robot->joint_noise_rad;
  const bool is_exact = noise.translation_m == 0 && noise.rotation_rad == 0 && noise.joint_rad == 0;
  if (!is_exact) fit.noise.robots.assign(MovingRobots(problem).size(), AtLeastExact(noise));
  fit = WithStartOfEffects(std::move(fit), problem);
  const std::optional<Information> information = FitInformation(fit, LossOf(LossKind::kNone), 1);
  CHECK(information.has_value());
  if (const std::optional<Failure> failure = CheckObservable(*information)) return *failure;
  Solution bound;
  bound.poses = cell.poses;
  bound.covariance = InvertInformation(*information, 1.0);
  std::vector<PoseBound> bounds;
  if (IsHandEye(cell)) {
    const std::vector<Eigen::Index> studied = StudiedUnknowns(bound.covariance.layout);
    bounds.push_back({bound.covariance.matrix(studied, studied), {}});
  } else {
    for (const PoseEstimate& pose : PosesOf(cell.problem, bound)) bounds.push_back({pose.covariance, {}});
  }
  for (PoseBound& of_pose : bounds) of_pose.errors = FromMeanSquares(cell, of_pose.covariance.diagonal());
  if (cell.robot) {
    bounds[0].errors = WithPlaceBounds(std::move(bounds[0].errors), cell, DrawnErrors(cell).get(), bound.covariance);
  }
  return bounds;
}

std::vector<PoseSummary> Summarise(const StudyCell& cell,
                                   const std::vector<std::vector<std::vector<TrialEstimate>>>& trials) {
  CHECK(!trials.empty());
  const Outcome<std::vector<PoseBound>> bounds = ErrorBounds(cell);
  const std::vector<std::string> names = StudiedPoses(cell);
  std::vector<PoseSummary> summaries;
  for (size_t i = 0; i < names.size(); ++i) {
    PoseSummary& summary = summaries.emplace_back();
    summary.pose = names[i];
    summary.bound = bounds ? Outcome<StudyErrors>((*bounds)[i].errors) : Outcome<StudyErrors>(bounds.failure());
    for (const TrialEstimate& first : trials.front()[i]) {
      std::vector<const TrialEstimate*> estimates;
      for (const std::vector<std::vector<TrialEstimate>>& trial : trials) {
        const auto found = std::find_if(trial[i].begin(), trial[i].end(),
                                        [&](const TrialEstimate& entry) { return entry.method == first.method; });
        estimates.push_back(found == trial[i].end() ? nullptr : &*found);
      }
      summary.methods.push_back(SummaryOf(cell, first.method, estimates));
    }
  }
  return summaries;
}

}  // namespace heba
