#include "solvers/cell/drift_calibration.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "heba/base/factorisation.h"
#include "heba/calibration.h"
#include "solvers/calibration/drift_search.h"
#include "solvers/calibration/problem_model.h"
#include "solvers/cell/start.h"
#include "solvers/residuals/inliers.h"
#include "solvers/residuals/loss.h"

namespace heba {
namespace {

// An adjustment, and the points that it used.
struct Adjusted {
  Problem problem;
  Solution solution;
};

// Returns the adjustment of a calibration. Images that it left out because their camera was moved are taken back: they
// show the creep, too. Returns nothing if the adjustment with them fails.
std::optional<Adjusted> WithMoved(const Problem& seen, const Calibration& calibration,
                                  const AdjustmentOptions& options_in) {
  Adjusted adjusted{WithoutRejected(calibration.problem, *calibration.refined), *calibration.refined};
  if (calibration.moved.empty()) return adjusted;
  for (const MovedCamera& moved : calibration.moved) {
    for (const size_t i : moved.left_out) {
      for (size_t k = 0; k < adjusted.problem.captures[i].images.size(); ++k) {
        ProblemImage& image = adjusted.problem.captures[i].images[k];
        if (image.camera == moved.camera) image.observations = seen.captures[i].images[k].observations;
      }
    }
  }
  AdjustmentOptions options = options_in;
  options.loss = OfInliers(options.loss);
  Outcome<Solution> solution =
      RefineProblem(StartingFrom(adjusted.problem, adjusted.solution), adjusted.solution.poses, options);
  if (!solution) return std::nullopt;
  adjusted.solution = std::move(*solution);
  return adjusted;
}

// Returns which poses are those of bodies of a kind.
std::vector<Rigid3d> CellPoses::*PosesOf(DriftBody::Kind kind) {
  switch (kind) {
    case DriftBody::Kind::kCamera:
      return &CellPoses::mount_from_camera;
    case DriftBody::Kind::kTarget:
      return &CellPoses::mount_from_target;
    case DriftBody::Kind::kBase:
      break;
  }
  return &CellPoses::world_from_base;
}

// Returns the problem as it would have been seen if all bodies had stood where they stand at the end.
Problem WithoutDrifts(Problem seen, const Calibration& at, const std::vector<Drift>& drifts) {
  const Solution& solution = *at.refined;
  for (size_t i = 0; i < seen.captures.size(); ++i) {
    CellPoses then = solution.poses;
    for (const Drift& drift : drifts) {
      Rigid3d& pose = (then.*PosesOf(drift.body.kind))[drift.body.index];
      pose = Retract(pose, -RemainingShare(drift, i, seen.captures.size()) * drift.change);
    }
    const std::vector<Rigid3d> base_from_gripper =
        Corrected(WithErrors(at.problem.captures[i], solution.effects), solution.captures[i].corrections);
    for (ProblemImage& image : seen.captures[i].images) {
      const Rigid3d camera_from_target =
          CameraFromTarget(seen, solution.poses, image.camera, image.target, base_from_gripper);
      const Rigid3d target_from_then =
          Inverse(camera_from_target) * CameraFromTarget(seen, then, image.camera, image.target, base_from_gripper);
      Points3& points = image.observations.points_in_target;
      points = ((target_from_then.RotationMatrix() * points).colwise() + target_from_then.translation).eval();
    }
  }
  return seen;
}

// Returns the drifts to estimate, still without a motion.
std::vector<Drift> DriftsToEstimate(const Calibration& first, const CaptureTimes& times, const DriftOptions& options) {
  std::vector<Drift> drifts;
  for (const DriftBody& body : options.wanted) drifts.emplace_back().body = body;
  if (!options.is_tested) return drifts;
  for (const MovedCamera& moved : first.moved) {
    Drift drift;
    drift.body = {DriftBody::Kind::kCamera, moved.camera};
    drift.evidence = DriftEvidence::kMotion;
    const bool is_new =
        std::none_of(drifts.begin(), drifts.end(), [&](const Drift& other) { return other.body == drift.body; });
    if (is_new) drifts.push_back(drift);
  }
  if (!drifts.empty()) return drifts;
  const Problem used = WithoutRejected(first.problem, *first.refined);
  if (std::optional<Drift> creep = FindCreepOfCamera(used, *first.refined, times)) {
    creep->change.setZero();
    drifts.push_back(*creep);
  }
  return drifts;
}

// Returns one sigma of the errors of a camera's images, px.
double ImageErrorPx(const Calibration& calibration, size_t camera) {
  return std::hypot(calibration.refined->pixel_sigmas_px[camera], calibration.refined->image_sigmas_px[camera]);
}

// Returns whether the creeps of cameras explain their images: none seems to be knocked any more, no image is lost, and
// the errors of the camera's images are no larger than without those beyond the knock or, if there was none, much less
// than before.
bool AreExplained(const DriftCalibration& corrected, const Calibration& first) {
  const Calibration& calibration = corrected.calibration;
  constexpr double kMostLeft = 0.7;
  constexpr double kMostRise = 1.05;
  for (const Drift& drift : corrected.drifts) {
    const size_t camera = drift.body.index;
    const bool is_knocked = std::any_of(calibration.moved.begin(), calibration.moved.end(),
                                        [&](const MovedCamera& moved) { return moved.camera == camera; });
    const double most = drift.evidence == DriftEvidence::kCameras ? kMostLeft : kMostRise;
    if (is_knocked || ImageErrorPx(calibration, camera) > most * ImageErrorPx(first, camera)) return false;
  }
  return IsAtLeastAsGood(QualityOf(calibration), QualityOf(first));
}

}  // namespace

std::optional<DriftCalibration> CalibrateWithDrifts(const Problem& seen_in, const Calibration& first,
                                                    const CalibrationOptions& options, const DriftOptions& drift) {
  const CaptureTimes times = TimesInOrder(seen_in.captures.size());
  // Points are moved in the frame of the target as it was read.
  const Problem seen = InChosenOrders(seen_in, first.refined->poses);
  DriftCalibration last{seen, first, DriftsToEstimate(first, times, drift)};
  if (last.drifts.empty()) return std::nullopt;
  constexpr int kNumRounds = 3;
  for (int round = 0; round < kNumRounds; ++round) {
    const std::optional<Adjusted> at = WithMoved(last.seen, last.calibration, options.adjustment);
    if (!at) return std::nullopt;
    const std::optional<std::vector<Drift>> rest = EstimateDrifts(at->problem, at->solution, times, last.drifts);
    if (!rest) return std::nullopt;
    bool has_settled = round > 0;
    for (size_t d = 0; d < rest->size(); ++d) {
      // A tenth of a sigma matters to nobody.
      constexpr double kSettledSquare = 0.01;
      const Drift& left = (*rest)[d];
      last.drifts[d].covariance = left.covariance;
      has_settled = has_settled && MahalanobisSquare(left.change, left.covariance) < kSettledSquare;
    }
    if (has_settled) break;
    for (size_t d = 0; d < rest->size(); ++d) last.drifts[d].change += (*rest)[d].change;
    Problem corrected = WithoutDrifts(seen, last.calibration, last.drifts);
    Outcome<Calibration> next = Calibrate(corrected, options);
    if (!next || !next->refined) return std::nullopt;
    last.seen = std::move(corrected);
    last.calibration = std::move(*next);
  }
  if (drift.wanted.empty() && !AreExplained(last, first)) return std::nullopt;
  return last;
}

}  // namespace heba
