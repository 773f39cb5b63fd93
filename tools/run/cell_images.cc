#include "tools/run/cell_images.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "heba/calibration.h"
#include "heba/data/scale_sigmas.h"
#include "solvers/calibration/drift_search.h"
#include "solvers/calibration/smooth_remainder.h"
#include "solvers/cell/calibration_stages.h"
#include "solvers/cell/drift_calibration.h"
#include "tools/run/arm_errors.h"
#include "tools/run/captures.h"
#include "tools/run/earlier_run.h"
#include "tools/run/free_points.h"
#include "tools/run/image_results.h"
#include "tools/run/run_stage.h"
#include "tools/run/second_detection.h"

namespace heba {
namespace {

// Returns the problem of the detections, without the images that must not be used.
Problem ProblemOf(const ImageRun& run, const std::vector<TargetDetection>& detections) {
  const Dataset& dataset = run.dataset;
  Problem problem = dataset.rig;
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    ProblemTarget& target = problem.targets[t];
    target.shape = DesignedShape(AllPoints(*dataset.targets[t]).points_in_target);
    target.symmetries = dataset.targets[t]->Symmetries();
    target.free_shape = GroupsOfSurface(target.free_shape);
    target.known_scale_sigma = dataset.targets[t]->scale_sigma().value_or(kTargetScaleSigma);
  }
  if (run.options.earlier) problem = WithPrior(std::move(problem), *run.options.earlier);
  problem.captures.clear();
  for (const Recording& recording : dataset.captures) {
    problem.captures.push_back({recording.name, recording.base_from_gripper, {}});
  }
  for (const TargetDetection& detection : detections) {
    if (IsDuplicate(run.duplicates, detection) || detection.detection.detection.ids.empty()) continue;
    problem.captures[detection.capture].images.push_back(
        {detection.camera, detection.target,
         ObservationsOf(*dataset.targets[detection.target], detection.detection.detection)});
  }
  return problem;
}

// Returns the first adjustment of a calibration; a Failure if there is none.
Outcome<Calibration> FirstOf(const Outcome<StartedCalibration>& started) {
  if (!started) return started.failure();
  if (!started->judged) return started->judged.failure();
  return FirstAdjustment(*started);
}

// Calibrates from the detections. The images are searched again for the points that the first adjustment predicts; the
// better of both adjustments is completed.
Outcome<CalibratedImages> CalibrateDetections(const ImageRun& run, const CalibrationOptions& options) {
  CalibratedImages finished;
  finished.detections = run.detections;
  finished.seen = ProblemOf(run, run.detections);
  Outcome<StartedCalibration> started = StartCalibration(finished.seen, options);
  const Outcome<Calibration> first = FirstOf(started);
  if (!first) return first.failure();
  std::optional<std::vector<TargetDetection>> again = DetectAgain(
      run.dataset, run.detections, PredictionsOf(*first, run.detections), options.adjustment.num_threads, run.observer);
  EndIfCancelled(run.observer);
  if (again) {
    Problem more = ProblemOf(run, *again);
    Outcome<StartedCalibration> restarted = StartCalibration(more, options);
    const Outcome<Calibration> second = FirstOf(restarted);
    if (second && IsAtLeastAsGood(QualityOf(*second), QualityOf(*first))) {
      finished.detections = std::move(*again);
      finished.seen = std::move(more);
      started = std::move(restarted);
    }
  }
  EndIfCancelled(run.observer);
  finished.calibration = FinishCalibration(*std::move(started), options);
  if (!finished.calibration.refined) return finished.calibration.refined.failure();
  return finished;
}

// Returns the calibration from images that are corrected for drifts, if there are any.
CalibratedImages CorrectedForDrifts(CalibratedImages calibrated, const RunOptions& options,
                                    const CalibrationOptions& of_calibration) {
  std::optional<DriftCalibration> corrected =
      CalibrateWithDrifts(calibrated.seen, calibrated.calibration, of_calibration, options.drift);
  if (corrected) {
    calibrated.seen = std::move(corrected->seen);
    calibrated.calibration = std::move(corrected->calibration);
    calibrated.drifts = std::move(corrected->drifts);
  } else if (!options.drift.wanted.empty()) {
    calibrated.findings.push_back({Grade::kDoubtful, FindingCode("drift_unseen"), {}, {{"reason", "undetermined"}}});
  }
  return calibrated;
}

}  // namespace

CalibrationOptions CellOptions(const ImageRun& run, const std::vector<std::optional<ArmSetup>>& arms) {
  CalibrationOptions options = run.options.calibration;
  options.has_camera = run.dataset.has_camera;
  options.adjustment.num_threads = run.options.num_threads;
  options.arms = ErrorsOfArms(run.dataset, arms, run.options.kinematics);
  options.robot_scale_sigma = RobotScaleSigmaOf(run.dataset);
  return options;
}

Outcome<CalibratedImages> CalibrateCell(const ImageRun& run) {
  std::vector<std::optional<ArmSetup>> arms = SetUpArms(run.dataset, run.options.kinematics);
  const CalibrationOptions options = CellOptions(run, arms);
  Outcome<CalibratedImages> first = CalibrateDetections(run, options);
  if (!first) return first;
  EndIfCancelled(run.observer);
  CalibratedImages calibrated = CorrectedForDrifts(*std::move(first), run.options, options);
  EndIfCancelled(run.observer);
  std::vector<Finding> findings = DiagnoseCalibration(calibrated.seen, calibrated.calibration);
  for (const Drift& drift : calibrated.drifts) {
    findings.push_back(
        DescribeDrift(calibrated.calibration.problem, drift, run.dataset.captures[drift.capture].name, true));
  }
  calibrated.findings.insert(calibrated.findings.begin(), findings.begin(), findings.end());
  calibrated.arms = std::move(arms);
  return calibrated;
}

Advice AdviseOnCell(const ImageRun& run, const CalibratedImages& calibrated) {
  const Calibration& calibration = calibrated.calibration;
  AdjustmentOptions adjustment = run.options.calibration.adjustment;
  adjustment.num_threads = run.options.num_threads;
  Advice advice = DiagnoseHeldIntrinsics(calibrated.seen, calibration, adjustment);
  if (run.options.calibration.smooth != SmoothPoseErrors::kNone) {
    const Advice of_smooth = DiagnoseSmoothRemainder(calibration.problem, *calibration.refined);
    advice.findings.insert(advice.findings.end(), of_smooth.findings.begin(), of_smooth.findings.end());
    advice.changes.insert(advice.changes.end(), of_smooth.changes.begin(), of_smooth.changes.end());
  }
  for (Finding& direction : DiagnoseWeakDirectionsOf(calibration)) advice.findings.push_back(std::move(direction));
  return advice;
}

}  // namespace heba
