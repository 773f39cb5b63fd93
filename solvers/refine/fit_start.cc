#include "solvers/refine/fit_start.h"

#include <algorithm>
#include <utility>

#include "heba/base/failure_code.h"
#include "heba/evaluation/metrics.h"
#include "solvers/refine/noise_iteration.h"
#include "solvers/refine/uncertainty_limits.h"
#include "solvers/residuals/noise_scale.h"

namespace heba {
namespace {

Failure HiddenAtStart(const Problem& problem, const ImageIndex& index) {
  const ProblemCapture& capture = problem.captures[index.capture];
  const std::string& camera = problem.cameras[capture.images[index.image].camera].name;
  return {FailureCode("hidden_at_start"), {}, {{"capture", capture.name}, {"camera", camera}}};
}

// Returns the fit with the noise that its iteration starts from, and with corrections of zero if arms have noise.
// `of_cameras`: the distances of each camera's points at the start.
Fit WithStartOfNoise(Fit fit, std::vector<std::vector<double>> of_cameras, const AdjustmentOptions& options) {
  const std::vector<std::vector<const Observations*>> points = PointsOfCameras(*fit.problem);
  for (size_t c = 0; c < of_cameras.size(); ++c) {
    if (!options.pixel_noise_px) {
      const bool is_guessed = options.loss != LossKind::kTruncated && !options.pixel_noise_start_px.empty();
      fit.noise.pixel_px[c] = is_guessed ? options.pixel_noise_start_px[c] : SigmaFromMedian(std::move(of_cameras[c]));
      continue;
    }
    const double detector_px = TypicalDetectorSigma(points[c]).value_or(0);
    if (detector_px > 0) fit.unmodelled_sigma_px[c] = UnmodelledSigmaPx(*options.pixel_noise_px, detector_px);
  }
  if (options.robot != BundleOptions::Robot::kExact) {
    fit.state.corrections.assign(fit.problem->captures.size(), std::vector<Rigid3d>(fit.problem->robots.size()));
    const bool is_estimated = options.robot == BundleOptions::Robot::kEstimatedNoise;
    fit.noise.robots.assign(MovingRobots(*fit.problem).size(),
                            AtLeastExact(is_estimated ? options.robot_noise_start : options.robot_noise));
  }
  return fit;
}

}  // namespace

Outcome<FitStart> StartFit(const Problem& problem, const CellPoses& start, const AdjustmentOptions& options) {
  const bool is_truncated = options.loss == LossKind::kTruncated;
  Fit fit;
  fit.state.poses = start;
  for (const ProblemCamera& camera : problem.cameras) fit.state.cameras.push_back(camera.camera);
  for (const ProblemTarget& target : problem.targets) fit.state.shapes.push_back(target.shape);
  fit = WithStartOfEffects(std::move(fit), problem);
  fit.unmodelled_sigma_px.resize(problem.cameras.size());
  PointFlags keep = AllFlags(problem, true);
  UsePoints(problem, keep, &fit);
  if (fit.groups.empty()) return Failure{FailureCode("no_points")};

  const ImageDistances distances = DistancesAt(problem, fit.groups, fit.state, options.num_threads);
  const std::vector<ImageIndex> images = ImagesOf(problem, fit.groups);
  std::vector<std::vector<double>> of_cameras = DistancesOfCameras(problem, fit.groups, distances);
  std::vector<ImageIndex> hidden;
  for (size_t v = 0; v < images.size(); ++v) {
    if (distances[v]) continue;
    std::vector<bool>& flags = keep[images[v].capture][images[v].image];
    std::fill(flags.begin(), flags.end(), false);
    hidden.push_back(images[v]);
  }
  // A few captures may have a wrong pose, which `truncated` tolerates.
  if (hidden.size() > (is_truncated ? images.size() / 2 : 0)) return HiddenAtStart(problem, hidden.front());
  if (!hidden.empty()) UsePoints(problem, keep, &fit);
  if (const std::optional<Failure> failure = CheckNumPoints(problem, keep)) return *failure;

  // Observability is checked at sigma = 0.05 px: a direction that is unobservable even then cannot be solved for.
  constexpr double kLittleNoisePx = 0.05;
  fit.noise.pixel_px.assign(problem.cameras.size(), options.pixel_noise_px.value_or(kLittleNoisePx));
  fit.noise.image_px.assign(problem.cameras.size(), 0);
  const std::optional<Information> start_information =
      FitInformation(fit, LossOf(LossKind::kNone), options.num_threads);
  if (!start_information) return HiddenPoint();
  if (const std::optional<Failure> failure = CheckObservable(*start_information)) return *failure;
  const Covariance at_little_noise = InvertInformation(*start_information, 1.0);
  if (const std::optional<Failure> failure = CheckDetermined(*fit.problem, fit.state, at_little_noise)) return *failure;

  fit = WithStartOfNoise(std::move(fit), std::move(of_cameras), options);
  return FitStart{std::move(fit), std::move(keep)};
}

}  // namespace heba
