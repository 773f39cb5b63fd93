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
std::vector<TargetDetection> SearchImages(ImageRun* run) {
  CheckCamerasByHeader(run->dataset);
  std::vector<TargetDetection> detections =
      DetectDataset(run->dataset, run->options.detect, run->options.num_threads, run->observer);
  FitCamerasToImages(run->dataset, detections, &run->dataset.rig);
  if (run->options.earlier) ReadAsEarlier(*run->options.earlier, run->dataset, &detections);
  run->duplicates = FindDuplicates(run->dataset, detections);
  EndIfCancelled(run->observer);
  return detections;
}

// Tells the observer what was detected by the only camera. Returns the failure of images of which none can be used;
// nothing if some can.
std::optional<Failure> TellDetected(const ImageRun& run, const std::vector<TargetDetection>& detections) {
  const std::vector<std::string> notes = DuplicateNotes(run.duplicates, run.dataset.captures.size());
  const size_t num_images = detections.size() - run.duplicates.size();
  const TargetDetection* first = nullptr;
  int num_seen = 0;
  for (const TargetDetection& seen : detections) {
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

Outcome<CalibratedImages> CalibrateImages(const ImageRun& run, std::vector<TargetDetection>* detections) {
  return IsSinglePair(run.dataset) ? CalibratePairImages(run, detections) : CalibrateCell(run, detections);
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
CalibratedAtOffset CalibrateStream(const ImageRun& run, std::vector<TargetDetection>* detections) {
  bool is_first = true;
  const auto calibrate_at = [&](double offset_s) {
    ImageRun at_offset = run;
    at_offset.is_first = std::exchange(is_first, false);
    at_offset.dataset = WithPosesAt(std::move(at_offset.dataset), offset_s);
    CalibratedAtOffset at{offset_s, at_offset.dataset, CalibrateImages(at_offset, detections), {}};
    if (!at.calibrated) return at;
    at.rest = EstimateTimeOffset(UsedBy(*at.calibrated), *at.calibrated->calibration.refined,
                                 VelocitiesAt(at.dataset, offset_s));
    return at;
  };
  return SettleOffset(FindTimeOffset(run.dataset, PosesInImages(run.dataset, *detections)), calibrate_at);
}

// Estimates the points of targets where that is wanted, and calibrates again with the data set whose points lie there.
EstimatedPoints CalibratePoints(ImageRun* run, CalibratedImages* calibrated, std::vector<TargetDetection>* detections) {
  const std::vector<size_t> targets = TargetsWithFreePoints(run->dataset);
  const std::vector<std::shared_ptr<const Target>> designed = run->dataset.targets;
  EstimatedPoints points;
  points.offsets.resize(designed.size());
  if (targets.empty()) return points;
  for (int round = 0; round <= kRoundsOfPoints; ++round) {
    std::optional<EstimatedPoints> estimated =
        EstimatePoints(UsedBy(*calibrated), *calibrated->calibration.refined, targets, points.offsets);
    if (!estimated) break;
    if (round == kRoundsOfPoints) {
      // The changes are those at the points that were used.
      estimated->offsets = std::move(points.offsets);
      return *std::move(estimated);
    }
    ImageRun displaced = *run;
    displaced.is_first = false;
    displaced.dataset.targets = DisplacedTargets(designed, estimated->offsets);
    Outcome<CalibratedImages> next = CalibrateImages(displaced, detections);
    if (!next) break;
    *run = std::move(displaced);
    *calibrated = *std::move(next);
    points = *std::move(estimated);
  }
  return points;
}

// A calibration with all that is estimated beside it.
struct Settled {
  CalibratedImages calibrated;
  bool has_offset = false;
  double offset_s = 0;
  std::optional<TimeOffset> rest_of_offset;
  EstimatedPoints points;
};

// Calibrates, and tells the observer.
Outcome<Settled> Settle(ImageRun* run, std::vector<TargetDetection>* detections) {
  Settled settled;
  settled.has_offset = run->dataset.stream && run->options.estimates_time_offset;
  if (settled.has_offset) {
    CalibratedAtOffset at = CalibrateStream(*run, detections);
    if (!at.calibrated) return at.calibrated.failure();
    run->dataset = std::move(at.dataset);
    settled.calibrated = *std::move(at.calibrated);
    settled.offset_s = at.offset_s;
    settled.rest_of_offset = std::move(at.rest);
  } else {
    Outcome<CalibratedImages> calibrated = CalibrateImages(*run, detections);
    if (!calibrated) return calibrated.failure();
    settled.calibrated = *std::move(calibrated);
  }
  settled.points = CalibratePoints(run, &settled.calibrated, detections);
  const std::vector<CalibratedPair>& pairs = settled.calibrated.calibration.pairs;
  if (run->observer != nullptr && settled.calibrated.pair_options) {
    run->observer->OnCalibrated(*pairs.front().calibration);
  }
  return settled;
}

// Returns the findings that the form of a calibration has by itself, and all changes of the estimate but those of
// scales and of what no capture shows of an arm.
Advice AdviceOn(const ImageRun& run, const Settled& settled, const Problem& used) {
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

// Adds the points of targets that were estimated, and what is to be said of them, to a result.
void AddPoints(const Dataset& dataset, const EstimatedPoints& points, RunResult* result) {
  for (Finding& finding : DescribePoints(dataset.rig, TargetsWithFreePoints(dataset), points)) {
    result->observations.push_back(std::move(finding));
  }
  if (points.changes.empty()) return;
  result->point_offsets = points.offsets;
  // Only a pair has a model beside its solution.
  if (result->estimates.empty()) return;
  result->model.target_shape.emplace_back(kTargetShapeGroupNames[static_cast<size_t>(TargetShapeGroup::kPoints)]);
}

// Assesses a calibration: every figure of the result except its timing, and the findings. The covariance of the
// calibration becomes the total one.
RunResult Assess(const ImageRun& run, const std::vector<TargetDetection>& detections, Settled* settled) {
  const Dataset& dataset = run.dataset;
  CalibratedImages& calibrated = settled->calibrated;
  Calibration& calibration = calibrated.calibration;
  const Solution solution = *calibration.refined;
  const Problem used = WithoutRejected(calibration.problem, solution);
  const Advice advice = AdviceOn(run, *settled, used);
  const ScaleShare scales = ShareOfScales(used, solution, ScaleSigmasOf(dataset, calibration.problem));
  const std::vector<Eigen::VectorXd> of_arms = ChangesByUnknownArms(used, solution);
  ResidualStructure structure = FindResidualStructure(used, solution);
  const PredictedImages predicted = PredictionsOf(calibration, detections);
  const LossKind loss = run.options.calibration.adjustment.loss;
  std::vector<ImageResult> images = ImageResults(run, calibrated, used, detections, loss);
  MarkDuplicates(dataset, run.duplicates, detections, &images);
  AddShare(scales, advice.changes, of_arms, &*calibration.refined);

  FormOfResult form = calibrated.pair_options ? PairForm(run, &calibrated) : CellForm(run, &calibrated, used);
  SetHoldOuts(dataset, form.held_out_m, &images);
  RunResult result = std::move(form.result);
  result.images = std::move(images);
  result.captures = CaptureResults(dataset, used, solution);
  result.point_deviations = std::move(structure.points);
  // A wrong scale moves the cameras, and not what they see of an object of known size.
  Solution with_scales = solution;
  AddChanges(scales.changes, &with_scales.covariance);
  std::vector<Eigen::VectorXd> changes = advice.changes;
  changes.insert(changes.end(), of_arms.begin(), of_arms.end());
  result.working_points = WorkingPointsOf(used, with_scales, changes);
  std::vector<PlacedRequirement> requirements = run.options.requirements;
  // The parts of a pair have no names yet.
  for (PlacedRequirement& required : requirements) {
    if (calibrated.pair_options) required.camera.clear();
  }
  result.requirements = ReachedAccuracies(requirements, used, *calibration.refined, result.working_points);
  for (const std::vector<Finding>& findings :
       {advice.findings, scales.findings, structure.findings, FindMissingIds(dataset, detections, predicted),
        FindSeenFromBehind(dataset, detections, predicted), calibrated.findings}) {
    result.observations.insert(result.observations.end(), findings.begin(), findings.end());
  }
  AddPoints(dataset, settled->points, &result);
  if (settled->has_offset) AddTimeOffset(settled->offset_s, settled->rest_of_offset, &result);
  result.observations.insert(result.observations.end(), form.of_arms.begin(), form.of_arms.end());
  return calibrated.pair_options ? WithFinalEstimate(std::move(result)) : result;
}

}  // namespace

Outcome<RunOutput> RunOnImages(const Dataset& dataset, const RunOptions& options, RunObserver* observer) {
  ImageRun run{dataset, options, {}, observer};
  RunOutput output;
  Timing timing;
  const Stopwatch detect_watch;
  output.detections = SearchImages(&run);
  timing.detect_s = detect_watch.Seconds();
  if (IsSinglePair(run.dataset)) {
    if (const std::optional<Failure> failure = TellDetected(run, output.detections)) return *failure;
  }
  const Stopwatch solve_watch;
  Outcome<Settled> settled = Settle(&run, &output.detections);
  if (!settled) return settled.failure();
  Calibration& calibration = settled->calibrated.calibration;
  timing.refine_s = calibration.refined->convergence.seconds;
  timing.seed_s = std::max(0.0, solve_watch.Seconds() - timing.refine_s);
  output.result = Assess(run, output.detections, &*settled);
  output.result.timing = timing;
  output.calibration = std::move(calibration);
  output.dataset = std::move(run.dataset);
  if (settled->calibrated.pair_options) NameParts(&output);
  return output;
}

}  // namespace heba
