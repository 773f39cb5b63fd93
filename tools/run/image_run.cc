#include "tools/run/image_run.h"

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "heba/base/failure_code.h"
#include "heba/base/stopwatch.h"
#include "heba/base/text.h"
#include "heba/image_detection.h"
#include "heba/pair_calibration.h"
#include "solvers/calibration/drift_search.h"
#include "solvers/calibration/residual_structure.h"
#include "solvers/calibration/scale_share.h"
#include "solvers/residuals/inliers.h"
#include "tools/run/calibrated_images.h"
#include "tools/run/cell_images.h"
#include "tools/run/cell_result.h"
#include "tools/run/earlier_run.h"
#include "tools/run/free_points.h"
#include "tools/run/image_results.h"
#include "tools/run/pair_images.h"
#include "tools/run/pair_result.h"
#include "tools/run/reached_accuracy.h"
#include "tools/run/run_stage.h"
#include "tools/run/second_detection.h"
#include "tools/run/stand_in_arm.h"
#include "tools/run/time_offset.h"

namespace heba {
namespace {

// Detects the targets in the images, or takes the given detections; the cameras get the sizes of their images.
ImageRun SearchedRun(const Dataset& dataset, const RunOptions& options, RunObserver* observer) {
  CheckCamerasByHeader(dataset);
  ImageRun run{dataset, options, DetectDataset(dataset, options.detect, options.num_threads, observer), {}, observer};
  run.dataset.rig = WithImageSizes(dataset, run.detections);
  if (options.earlier) run.detections = ReadAsEarlier(*options.earlier, run.dataset, std::move(run.detections));
  run.duplicates = FindDuplicates(run.dataset, run.detections);
  EndIfCancelled(observer);
  return run;
}

// Tells the observer what was detected by the only camera. Returns the failure of images of which none can be used;
// nothing if some can.
std::optional<Failure> TellDetected(const ImageRun& run) {
  const std::vector<std::string> notes = DuplicateNotes(run.duplicates, run.dataset.captures.size());
  const size_t num_images = run.detections.size() - run.duplicates.size();
  const TargetDetection* first = nullptr;
  int num_seen = 0;
  for (const TargetDetection& seen : run.detections) {
    if (IsDuplicate(run.duplicates, seen)) continue;
    if (first == nullptr) first = &seen;
    num_seen += seen.detection.detection.ids.empty() ? 0 : 1;
  }
  if (run.observer != nullptr) run.observer->OnDetected(notes, num_seen, static_cast<int>(num_images));
  if (first == nullptr) return Failure{FailureCode("all_left_out"), {}, {{"notes", Join(notes, "; ")}}};
  if (num_seen > 0) return std::nullopt;
  return Failure{FailureCode("nothing_detected"),
                 {{"images", static_cast<double>(num_images)}},
                 {{"image", run.dataset.captures[first->capture].name}, {"why", first->detection.detection.reason}}};
}

Outcome<CalibratedImages> CalibrateImages(const ImageRun& run) {
  return IsSinglePair(run.dataset) ? CalibratePairImages(run) : CalibrateCell(run);
}

// The points that a calibration uses.
Problem UsedBy(const CalibratedImages& calibrated) {
  return WithoutRejected(calibrated.calibration.problem, *calibrated.calibration.refined);
}

// A calibration with the robot's poses at the times of the captures plus an offset.
struct CalibratedAtOffset {
  double offset_s = 0;
  Dataset dataset;  // With these poses.
  Outcome<CalibratedImages> calibrated;
  // The calibration leaves this of the offset; nothing if the captures do not determine it.
  std::optional<TimeOffset> rest;

  bool IsCalibrated() const { return calibrated.ok(); }
};

// Calibrates with an offset that is estimated beside all unknowns until it has settled; targets may be detected again.
CalibratedAtOffset CalibrateStream(const ImageRun& run) {
  ImageRun at_offset = run;
  const auto calibrate_at = [&](double offset_s) {
    at_offset.dataset = WithPosesAt(std::move(at_offset.dataset), offset_s);
    CalibratedAtOffset at{offset_s, at_offset.dataset, CalibrateImages(at_offset), {}};
    at_offset.is_first = false;
    if (!at.calibrated) return at;
    at_offset.detections = at.calibrated->detections;
    at.rest = EstimateTimeOffset(UsedBy(*at.calibrated), *at.calibrated->calibration.refined,
                                 VelocitiesAt(at.dataset, offset_s));
    return at;
  };
  return SettleOffset(FindTimeOffset(run.dataset, PosesInImages(run.dataset, run.detections)), calibrate_at);
}

// A calibration with all that is estimated beside it.
struct Settled {
  ImageRun run;  // Its robot's poses are those at the offset, and its targets' points are where they are estimated.
  CalibratedImages calibrated;
  bool has_offset = false;
  double offset_s = 0;
  std::optional<TimeOffset> rest_of_offset;
  EstimatedPoints points;
};

// Estimates the points of targets where that is wanted, and calibrates again with the data set whose points lie there.
Settled WithEstimatedPoints(Settled settled) {
  const std::vector<size_t> targets = TargetsWithFreePoints(settled.run.dataset);
  const std::vector<std::shared_ptr<const Target>> designed = settled.run.dataset.targets;
  EstimatedPoints& points = settled.points;
  points.offsets.resize(designed.size());
  if (targets.empty()) return settled;
  for (int round = 0; round <= kRoundsOfPoints; ++round) {
    std::optional<EstimatedPoints> estimated =
        EstimatePoints(UsedBy(settled.calibrated), *settled.calibrated.calibration.refined, targets, points.offsets);
    if (!estimated) break;
    if (round == kRoundsOfPoints) {
      // The changes are those at the points that were used.
      estimated->offsets = std::move(points.offsets);
      points = *std::move(estimated);
      break;
    }
    ImageRun displaced = settled.run;
    displaced.is_first = false;
    displaced.detections = settled.calibrated.detections;
    displaced.dataset.targets = DisplacedTargets(designed, estimated->offsets);
    Outcome<CalibratedImages> next = CalibrateImages(displaced);
    if (!next) break;
    settled.run = std::move(displaced);
    settled.calibrated = *std::move(next);
    points = *std::move(estimated);
  }
  return settled;
}

// Calibrates, and tells the observer.
Outcome<Settled> Settle(ImageRun run) {
  Settled settled;
  settled.has_offset = run.dataset.stream && run.options.estimates_time_offset;
  if (settled.has_offset) {
    CalibratedAtOffset at = CalibrateStream(run);
    if (!at.calibrated) return at.calibrated.failure();
    run.dataset = std::move(at.dataset);
    settled.calibrated = *std::move(at.calibrated);
    settled.offset_s = at.offset_s;
    settled.rest_of_offset = std::move(at.rest);
  } else {
    Outcome<CalibratedImages> calibrated = CalibrateImages(run);
    if (!calibrated) return calibrated.failure();
    settled.calibrated = *std::move(calibrated);
  }
  settled.run = std::move(run);
  settled = WithEstimatedPoints(std::move(settled));
  RunObserver* const observer = settled.run.observer;
  if (observer != nullptr && settled.calibrated.pair_options) {
    observer->OnCalibrated(*settled.calibrated.calibration.pairs.front().calibration);
  }
  return settled;
}

// Returns the findings that the form of a calibration has by itself, and all changes of the estimate but those of
// scales and of what no capture shows of an arm.
Advice AdviceOn(const Settled& settled, const Problem& used) {
  const ImageRun& run = settled.run;
  const CalibratedImages& calibrated = settled.calibrated;
  const Solution& solution = *calibrated.calibration.refined;
  Advice advice = calibrated.pair_options
                      ? Advise(*calibrated.calibration.pairs.front().calibration, *calibrated.pair_options)
                      : AdviseOnCell(run, calibrated);
  if (run.options.earlier) advice.findings.push_back(JudgePrior(*run.options.earlier, used, solution));
  const CaptureTimes times = TimesInOrder(run.dataset.captures.size());
  for (Eigen::VectorXd& change : ChangesByDrifts(used, solution, times, calibrated.drifts)) {
    advice.changes.push_back(std::move(change));
  }
  advice.changes.insert(advice.changes.end(), settled.points.changes.begin(), settled.points.changes.end());
  if (settled.rest_of_offset) advice.changes.push_back(settled.rest_of_offset->change_of_estimate);
  return advice;
}

// Returns a result with the points of targets that were estimated, and what is to be said of them.
RunResult WithPoints(RunResult result, const Dataset& dataset, const EstimatedPoints& points) {
  for (Finding& finding : DescribePoints(dataset.rig, TargetsWithFreePoints(dataset), points)) {
    result.observations.push_back(std::move(finding));
  }
  if (points.changes.empty()) return result;
  result.point_offsets = points.offsets;
  // Only a pair has a model beside its solution.
  if (result.estimates.empty()) return result;
  result.model.target_shape.emplace_back(kTargetShapeGroupNames[static_cast<size_t>(TargetShapeGroup::kPoints)]);
  return result;
}

// Returns the calibration with the total covariance, for the pair, too, if it is that of one.
Calibration WithTotalCovariance(Calibration calibration, bool is_pair, const ScaleShare& scales,
                                const std::vector<Eigen::VectorXd>& changes,
                                const std::vector<Eigen::VectorXd>& of_arms) {
  calibration.refined = WithShare(*std::move(calibration.refined), scales, changes, of_arms);
  if (!is_pair) return calibration;
  PairSolution& of_pair = *calibration.pairs.front().calibration->refined;
  of_pair.covariance = calibration.refined->covariance;
  of_pair.covariance_repeatable = calibration.refined->covariance_repeatable;
  return calibration;
}

// Returns what is required of the parts of the calibration.
std::vector<PlacedRequirement> RequirementsOf(const Settled& settled) {
  std::vector<PlacedRequirement> requirements = settled.run.options.requirements;
  // The parts of a pair have no names yet.
  for (PlacedRequirement& required : requirements) {
    if (settled.calibrated.pair_options) required.camera.clear();
  }
  return requirements;
}

// Assesses a calibration: every figure of the result except its timing, and the findings.
RunOutput Assess(Settled settled) {
  const ImageRun& run = settled.run;
  const Dataset& dataset = run.dataset;
  CalibratedImages& calibrated = settled.calibrated;
  const bool is_pair = calibrated.pair_options.has_value();
  const Solution solution = *calibrated.calibration.refined;
  const Problem used = UsedBy(calibrated);
  const Advice advice = AdviceOn(settled, used);
  const ScaleShare scales = ShareOfScales(used, solution, ScaleSigmasOf(dataset, calibrated.calibration.problem));
  const std::vector<Eigen::VectorXd> of_arms = ChangesByUnknownArms(used, solution);
  ResidualStructure structure = FindResidualStructure(used, solution);
  const PredictedImages predicted = PredictionsOf(calibrated.calibration, calibrated.detections);
  const LossKind loss = run.options.calibration.adjustment.loss;
  std::vector<ImageResult> images =
      WithDuplicates(ImageResults(run, calibrated, used, loss), dataset, run.duplicates, calibrated.detections);
  calibrated.calibration =
      WithTotalCovariance(std::move(calibrated.calibration), is_pair, scales, advice.changes, of_arms);

  FormOfResult form = is_pair ? PairForm(run, calibrated) : CellForm(run, calibrated, used);
  RunResult result = std::move(form.result);
  result.images = WithHeldOutDistances(std::move(images), dataset, form.held_out_m);
  result.captures = CaptureResults(dataset, used, solution);
  result.point_deviations = std::move(structure.points);
  // A wrong scale moves the cameras, and not what they see of an object of known size.
  Solution with_scales = solution;
  with_scales.covariance = WithChanges(std::move(with_scales.covariance), scales.changes);
  std::vector<Eigen::VectorXd> changes = advice.changes;
  changes.insert(changes.end(), of_arms.begin(), of_arms.end());
  result.working_points = WorkingPointsOf(used, with_scales, changes);
  result.requirements =
      ReachedAccuracies(RequirementsOf(settled), used, *calibrated.calibration.refined, result.working_points);
  for (const std::vector<Finding>& findings :
       {advice.findings, scales.findings, structure.findings, FindMissingIds(dataset, calibrated.detections, predicted),
        FindSeenFromBehind(dataset, calibrated.detections, predicted), form.of_calibration}) {
    result.observations.insert(result.observations.end(), findings.begin(), findings.end());
  }
  result = WithPoints(std::move(result), dataset, settled.points);
  if (settled.has_offset) result = WithTimeOffset(std::move(result), settled.offset_s, settled.rest_of_offset);
  result.observations.insert(result.observations.end(), form.of_arms.begin(), form.of_arms.end());
  RunOutput output;
  output.result = std::move(result);
  if (is_pair) output.result = WithFinalEstimate(std::move(output.result));
  output.detections = std::move(calibrated.detections);
  output.calibration = std::move(calibrated.calibration);
  output.dataset = std::move(settled.run.dataset);
  if (is_pair) output = WithNames(std::move(output));
  return output;
}

}  // namespace

Outcome<RunOutput> RunOnImages(const Dataset& dataset, const RunOptions& options, RunObserver* observer) {
  Timing timing;
  const Stopwatch detect_watch;
  ImageRun run = SearchedRun(dataset, options, observer);
  timing.detect_s = detect_watch.Seconds();
  if (IsSinglePair(run.dataset)) {
    if (const std::optional<Failure> failure = TellDetected(run)) return *failure;
  }
  const Stopwatch solve_watch;
  Outcome<Settled> settled = Settle(std::move(run));
  if (!settled) return settled.failure();
  timing.refine_s = settled->calibrated.calibration.refined->convergence.seconds;
  timing.seed_s = std::max(0.0, solve_watch.Seconds() - timing.refine_s);
  RunOutput output = Assess(*std::move(settled));
  output.result.timing = timing;
  return output;
}

}  // namespace heba
