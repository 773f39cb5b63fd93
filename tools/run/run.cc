#include "heba/run.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "heba/base/failure_code.h"
#include "heba/base/stopwatch.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/cross_validation.h"
#include "heba/data/hand_eye.h"
#include "heba/evaluation/metrics.h"
#include "heba/evaluation/verdict.h"
#include "heba/image_detection.h"
#include "solvers/calibration/drift_search.h"
#include "solvers/calibration/influence.h"
#include "solvers/calibration/residual_structure.h"
#include "solvers/calibration/scale_share.h"
#include "solvers/calibration/smooth_remainder.h"
#include "solvers/cell/calibration_stages.h"
#include "solvers/cell/drift_calibration.h"
#include "solvers/residuals/inliers.h"
#include "solvers/residuals/loss.h"
#include "tools/run/arm_errors.h"
#include "tools/run/arm_setup.h"
#include "tools/run/assessment.h"
#include "tools/run/captures.h"
#include "tools/run/duplicate_images.h"
#include "tools/run/earlier_run.h"
#include "tools/run/free_points.h"
#include "tools/run/pair_run.h"
#include "tools/run/reached_accuracy.h"
#include "tools/run/run_stage.h"
#include "tools/run/second_detection.h"
#include "tools/run/stand_in_arm.h"

namespace heba {
namespace {

// Returns the problem of the detections, without the images that must not be used.
Problem ProblemOf(const Dataset& dataset, const std::vector<TargetDetection>& detections,
                  const std::vector<DuplicateInDataset>& duplicates, const std::optional<EarlierRun>& earlier) {
  Problem rig = dataset.rig;
  FitCamerasToImages(dataset, detections, &rig);
  for (size_t t = 0; t < rig.targets.size(); ++t) {
    rig.targets[t].shape = DesignedShape(AllPoints(*dataset.targets[t]).points_in_target);
    rig.targets[t].symmetries = dataset.targets[t]->Symmetries();
    rig.targets[t].free_shape = GroupsOfSurface(rig.targets[t].free_shape);
    rig.targets[t].known_scale_sigma = dataset.targets[t]->scale_sigma().value_or(kTargetScaleSigma);
  }
  if (earlier) AddPrior(*earlier, &rig);
  rig.captures.clear();
  for (const Recording& recording : dataset.captures) {
    rig.captures.push_back({recording.name, recording.base_from_gripper, {}});
  }
  for (const TargetDetection& detection : detections) {
    const bool is_duplicate =
        std::any_of(duplicates.begin(), duplicates.end(), [&](const DuplicateInDataset& duplicate) {
          return duplicate.capture == detection.capture && duplicate.camera == detection.camera;
        });
    if (is_duplicate || detection.detection.detection.ids.empty()) continue;
    rig.captures[detection.capture].images.push_back(
        {detection.camera, detection.target,
         ObservationsOf(*dataset.targets[detection.target], detection.detection.detection)});
  }
  return rig;
}

// Returns the errors of an image with the poses of the arms as given, corrected by the errors that captures share;
// nothing if a point has no image.
std::optional<SquaredErrors> ErrorsOf(const Problem& rig, const Solution& solution, const ProblemCapture& capture,
                                      const ProblemImage& image) {
  return ViewErrors(
      solution.cameras[image.camera],
      CameraFromTarget(rig, solution.poses, image.camera, image.target, WithErrors(capture, solution.effects)),
      ApplyShape(image.observations, solution.shapes[image.target]));
}

// Returns the errors of each camera over the images that are used, with the poses of the arms as given.
std::vector<SquaredErrors> ErrorsOfCameras(const Problem& used, const Solution& solution) {
  std::vector<SquaredErrors> sums(used.cameras.size());
  for (const ProblemCapture& capture : used.captures) {
    for (const ProblemImage& image : capture.images) {
      if (image.observations.size() == 0) continue;
      const std::optional<SquaredErrors> errors = ErrorsOf(used, solution, capture, image);
      if (errors) sums[image.camera].Add(*errors);
    }
  }
  return sums;
}

// The reasons why targets in an image were not used, in words.
class Reasons {
 public:
  void Add(const std::string& reason, const std::string& target) {
    const auto known = std::find_if(all_.begin(), all_.end(), [&](const auto& entry) { return entry.first == reason; });
    (known == all_.end() ? all_.emplace_back(reason, std::vector<std::string>()) : *known).second.push_back(target);
  }
  // Returns each reason after the targets that it concerns.
  std::string Text() const {
    std::vector<std::string> texts;
    for (const auto& [reason, targets] : all_) texts.push_back("target " + Join(targets, ", target ") + ": " + reason);
    return Join(texts, "; ");
  }

 private:
  std::vector<std::pair<std::string, std::vector<std::string>>> all_;
};

// The changes of the pose of each camera without each capture.
using MovesOfCameras = std::vector<std::vector<std::optional<CaptureMove>>>;

// Returns the entries of all images, used or not. `seen` has the points of all images, `used` those of the estimate.
std::vector<ImageResult> ImageResults(const Dataset& dataset, const Problem& seen, const Problem& used,
                                      const Calibration& calibration, const MovesOfCameras& moves) {
  const Solution& solution = *calibration.refined;
  std::map<std::pair<size_t, size_t>, std::string> reason_of;
  for (const UnusedProblemImage& unused : calibration.unused) {
    for (size_t k = 0; k < seen.captures[unused.capture].images.size(); ++k) {
      if (!unused.image || *unused.image == k) reason_of[{unused.capture, k}] = unused.reason;
    }
  }
  std::vector<ImageResult> results;
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    const ProblemCapture& capture = seen.captures[i];
    for (size_t c = 0; c < dataset.rig.cameras.size(); ++c) {
      if (dataset.captures[i].images[c].empty()) continue;
      ImageResult result{dataset.captures[i].name,
                         dataset.rig.cameras[c].name,
                         dataset.captures[i].images[c].filename().string(),
                         false,
                         "",
                         {}};
      Reasons reasons;
      for (size_t k = 0; k < capture.images.size(); ++k) {
        const ProblemImage& image = capture.images[k];
        if (image.camera != c) continue;
        TargetInImage& target = result.targets.emplace_back();
        target.target = dataset.rig.targets[image.target].name;
        target.num_points = image.observations.size();
        target.num_rejected = static_cast<int>(solution.captures[i].rejected_ids[k].size());
        target.used = used.captures[i].images[k].observations.size() > 0;
        const std::optional<SquaredErrors> errors =
            ErrorsOf(seen, solution, used.captures[i], target.used ? used.captures[i].images[k] : image);
        if (errors) target.rms_px = errors->RmsPx();
        result.used = result.used || target.used;
        const auto reason = reason_of.find({i, k});
        if (reason != reason_of.end()) {
          target.reason = reason->second;
        } else if (!target.used) {
          target.reason = "none of its points is where the estimate predicts it";
        }
        if (!target.reason.empty()) reasons.Add(target.reason, target.target);
      }
      if (result.used) result.move_without = moves[c][i];
      result.reason = result.targets.empty() ? "no target was detected" : reasons.Text();
      results.push_back(std::move(result));
    }
  }
  return results;
}

// Returns the entries of what was left out before the images were searched: one for each image, or one without an
// image.
std::vector<ImageResult> LeftOutResults(const Dataset& dataset) {
  std::vector<ImageResult> results;
  for (const LeftOutImages& entry : dataset.left_out) {
    const size_t first = results.size();
    for (size_t c = 0; c < entry.images.size(); ++c) {
      if (entry.images[c].empty()) continue;
      results.push_back({entry.capture,
                         dataset.rig.cameras[c].name,
                         entry.images[c].filename().string(),
                         false,
                         entry.reason,
                         {},
                         false});
    }
    if (results.size() > first) continue;
    const bool is_only = dataset.rig.cameras.front().name.empty();
    results.push_back({entry.name, "", is_only ? entry.name : "", false, entry.reason, {}, false});
  }
  return results;
}

PoseError ErrorOf(const Rigid3d& pose, const Rigid3d& truth) {
  return {1000 * DistanceM(pose, truth), RadToDeg(AngleRad(pose, truth))};
}

// Returns the error of a target's pose, in the nearest of the orientations in which it looks the same.
PoseError ErrorOfTarget(const Rigid3d& pose, const std::vector<Rigid3d>& symmetries, const Rigid3d& truth) {
  std::vector<PoseError> errors;
  for (const Rigid3d& symmetry : symmetries) errors.push_back(ErrorOf(pose * symmetry, truth));
  return *std::min_element(errors.begin(), errors.end(),
                           [](const PoseError& a, const PoseError& b) { return a.deg < b.deg; });
}

// Returns the errors of the poses of a result by the truth.
CellPoseErrors PoseErrors(const Problem& rig, const RunResult& result, const CellTruth& truth) {
  CellPoseErrors errors;
  const CellPoses& poses = result.solution.poses;
  for (size_t t = 0; t < rig.targets.size(); ++t) {
    errors.targets.emplace_back();
    if (!truth.mount_from_target[t]) continue;
    errors.targets.back() =
        ErrorOfTarget(poses.mount_from_target[t], rig.targets[t].symmetries, *truth.mount_from_target[t]);
  }
  for (size_t r = 0; r < rig.robots.size(); ++r) {
    errors.bases.emplace_back();
    if (r > 0 && truth.world_from_base[r]) {
      errors.bases.back() = ErrorOf(poses.world_from_base[r], *truth.world_from_base[r]);
    }
  }
  // The poses of the cameras in the world or, if a gripper carries them, in that gripper.
  std::map<std::string, std::optional<Rigid3d>> true_pose_of;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const Mount& mount = rig.cameras[c].mount;
    std::optional<Rigid3d> pose = truth.mount_from_camera[c];
    if (mount.part == Mount::Part::kBase && mount.robot > 0) {
      const std::optional<Rigid3d>& base = truth.world_from_base[mount.robot];
      pose = base ? std::optional(*base * *pose) : std::nullopt;
    }
    true_pose_of[rig.cameras[c].name] = pose;
  }
  for (const RelativePose& relative : result.relative_cameras) {
    const std::optional<Rigid3d>& parent = true_pose_of[relative.parent];
    const std::optional<Rigid3d>& child = true_pose_of[relative.child];
    errors.relative_cameras.emplace_back();
    if (parent && child) {
      errors.relative_cameras.back() = ErrorOf(relative.parent_from_child, Inverse(*parent) * *child);
    }
  }
  return errors;
}

// Fills in the in-sample errors of every camera, with the poses of the arms as given.
void AddErrors(const Problem& used, const Solution& solution, RunResult* result) {
  const std::vector<SquaredErrors> sums = ErrorsOfCameras(used, solution);
  for (size_t c = 0; c < sums.size(); ++c) {
    CameraErrors& errors = result->errors.emplace_back();
    errors.reprojection_rms_px = sums[c].RmsPx();
    const std::vector<Rigid3d> poses = TargetPosesOf(used, solution.poses, solution.effects, c);
    if (!poses.empty()) errors.distance_m = WorkingDistance(poses);
  }
}

// Fills in the errors of the images that contradict the others. `seen` has the points of all images.
void AddLeftOutErrors(const Problem& seen, const Calibration& calibration, RunResult* result) {
  ImageSet left_out;
  for (const UnusedProblemImage& unused : calibration.unused) {
    for (size_t k = 0; k < seen.captures[unused.capture].images.size(); ++k) {
      if (!unused.image || *unused.image == k) left_out.insert({unused.capture, k});
    }
  }
  for (size_t c = 0; c < result->errors.size(); ++c) {
    ImageSet of_camera = left_out;
    // A motion of the camera is stated by itself.
    for (const MovedCamera& moved : calibration.moved) {
      std::erase_if(of_camera, [&](const std::pair<size_t, size_t>& image) {
        return moved.camera == c &&
               std::find(moved.left_out.begin(), moved.left_out.end(), image.first) != moved.left_out.end();
      });
    }
    SetLeftOut(ErrorsOfUnused(seen, *calibration.refined, of_camera, c), &result->errors[c]);
  }
}

// Fills in the errors by the truth. `problem` is the one that was solved.
void AddTruth(const CellTruth& truth, const Problem& problem, RunResult* result) {
  for (size_t c = 0; c < result->errors.size(); ++c) {
    const PoseError error = ErrorOf(result->solution.poses.mount_from_camera[c], truth.mount_from_camera[c]);
    result->errors[c].truth_mm = error.mm;
    result->errors[c].truth_deg = error.deg;
  }
  result->truth = PoseErrors(problem, *result, truth);
}

// The images as they were seen, and the calibration from them.
struct SeenAndCalibrated {
  Problem seen;
  Calibration calibration;

  PredictedImages Predicted(const std::vector<TargetDetection>& detections) const {
    std::vector<double> rms_px;
    const Solution& solution = *calibration.refined;
    for (const SquaredErrors& errors : ErrorsOfCameras(WithoutRejected(calibration.problem, solution), solution)) {
      rms_px.push_back(errors.RmsPx().value_or(0));
    }
    return PredictImages(calibration.problem, solution, detections, std::move(rms_px));
  }
};

// Returns the first adjustment of a calibration; a Failure if there is none.
Outcome<SeenAndCalibrated> FirstOf(const Problem& seen, const Outcome<StartedCalibration>& started) {
  if (!started) return started.failure();
  if (!started->judged) return started->judged.failure();
  return SeenAndCalibrated{seen, FirstAdjustment(*started)};
}

// Calibrates from the detections. The images are searched again for the points that the first adjustment predicts; the
// better of both adjustments is completed.
Outcome<SeenAndCalibrated> CalibrateDetections(const Dataset& dataset,
                                               const std::vector<DuplicateInDataset>& duplicates,
                                               const CalibrationOptions& options,
                                               const std::optional<EarlierRun>& earlier,
                                               std::vector<TargetDetection>* detections, RunObserver* observer) {
  Problem seen = ProblemOf(dataset, *detections, duplicates, earlier);
  Outcome<StartedCalibration> started = StartCalibration(seen, options);
  const Outcome<SeenAndCalibrated> first = FirstOf(seen, started);
  if (!first) return first;
  std::optional<std::vector<TargetDetection>> again =
      DetectAgain(dataset, *detections, first->Predicted(*detections), options.adjustment.num_threads, observer);
  EndIfCancelled(observer);
  if (again) {
    Problem more = ProblemOf(dataset, *again, duplicates, earlier);
    Outcome<StartedCalibration> restarted = StartCalibration(more, options);
    const Outcome<SeenAndCalibrated> second = FirstOf(more, restarted);
    if (second && IsAtLeastAsGood(second->calibration, first->calibration)) {
      *detections = std::move(*again);
      seen = std::move(more);
      started = std::move(restarted);
    }
  }
  EndIfCancelled(observer);
  SeenAndCalibrated finished{std::move(seen), FinishCalibration(*std::move(started), options)};
  if (!finished.calibration.refined) return finished.calibration.refined.failure();
  return finished;
}

// Corrects the images for drifts, if there are any, and calibrates from the corrected ones. Returns the drifts, and
// adds a finding if those that are wanted are not determined.
std::vector<Drift> CorrectForDrifts(const RunOptions& options, const CalibrationOptions& of_calibration,
                                    SeenAndCalibrated* calibrated, std::vector<Finding>* findings) {
  std::optional<DriftCalibration> corrected =
      CalibrateWithDrifts(calibrated->seen, calibrated->calibration, of_calibration, options.drift);
  if (corrected) {
    *calibrated = {std::move(corrected->seen), std::move(corrected->calibration)};
    return corrected->drifts;
  }
  if (!options.drift.wanted.empty()) {
    findings->push_back({Grade::kDoubtful, FindingCode("drift_unseen"), {}, {{"reason", "undetermined"}}});
  }
  return {};
}

// A calibration with the drifts that its images were corrected for, and the findings about these.
struct Calibrated {
  SeenAndCalibrated of_images;
  std::vector<Drift> drifts;
  std::vector<Finding> findings;
};

// Calibrates from the detections, and again with the drifts that there are.
Outcome<Calibrated> CalibrateAll(const Dataset& dataset, const std::vector<DuplicateInDataset>& duplicates,
                                 const RunOptions& options, const CalibrationOptions& of_calibration,
                                 std::vector<TargetDetection>* detections, RunObserver* observer) {
  Outcome<SeenAndCalibrated> of_images =
      CalibrateDetections(dataset, duplicates, of_calibration, options.earlier, detections, observer);
  if (!of_images) return of_images.failure();
  EndIfCancelled(observer);
  Calibrated calibrated{std::move(*of_images), {}, {}};
  calibrated.drifts = CorrectForDrifts(options, of_calibration, &calibrated.of_images, &calibrated.findings);
  EndIfCancelled(observer);
  return calibrated;
}

// Estimates the points of targets where that is wanted, and calibrates again with the data set whose points lie there.
EstimatedPoints CalibratePoints(const std::vector<DuplicateInDataset>& duplicates, const RunOptions& options,
                                const CalibrationOptions& of_calibration, Dataset* dataset, Calibrated* calibrated,
                                std::vector<TargetDetection>* detections, RunObserver* observer) {
  const std::vector<size_t> targets = TargetsWithFreePoints(*dataset);
  const std::vector<std::shared_ptr<const Target>> designed = dataset->targets;
  EstimatedPoints points;
  points.offsets.resize(designed.size());
  if (targets.empty()) return points;
  for (int round = 0; round <= kRoundsOfPoints; ++round) {
    const Calibration& calibration = calibrated->of_images.calibration;
    std::optional<EstimatedPoints> estimated = EstimatePoints(
        WithoutRejected(calibration.problem, *calibration.refined), *calibration.refined, targets, points.offsets);
    if (!estimated) break;
    if (round == kRoundsOfPoints) {
      // The changes are those at the points that were used.
      estimated->offsets = std::move(points.offsets);
      return *std::move(estimated);
    }
    Dataset displaced = *dataset;
    displaced.targets = DisplacedTargets(designed, estimated->offsets);
    Outcome<Calibrated> next = CalibrateAll(displaced, duplicates, options, of_calibration, detections, observer);
    if (!next) break;
    *dataset = std::move(displaced);
    *calibrated = std::move(*next);
    points = std::move(*estimated);
  }
  return points;
}

MovesOfCameras MovesWithoutCaptures(const Problem& used, const Solution& solution) {
  MovesOfCameras moves;
  for (size_t c = 0; c < used.cameras.size(); ++c) {
    moves.push_back(MoveWithoutEachCapture(used, solution, c, LossOf(LossKind::kNone)));
  }
  return moves;
}

// Returns the description and the poses of the rig, without captures and figures.
RunResult PosesResult(const Dataset& dataset, const Calibration& calibration) {
  RunResult result;
  result.name = dataset.name;
  result.about = dataset.about;
  result.rig = calibration.problem;
  result.rig.captures.clear();
  // The basis of smooth errors is not written.
  for (std::shared_ptr<const SharedEffects>& effects : result.rig.effects) {
    if (effects != nullptr && effects->kind == SharedEffectsKind::kSmooth) effects = nullptr;
  }
  for (const std::shared_ptr<const Target>& target : dataset.targets)
    result.target_types.push_back(std::string(target->type()));
  result.solution = WithEffectsOf(result.rig, *calibration.refined);
  result.solution.captures.clear();
  result.relative_cameras = RelativeCameraPoses(result.rig, result.solution);
  result.relative_targets = RelativeTargetPoses(result.rig, result.solution);
  result.relative_bases = RelativeBasePoses(result.rig, result.solution);
  return result;
}

// Returns the poses of the arms in all captures, with their corrections.
std::vector<CapturePoses> CaptureResults(const Dataset& dataset, const Calibration& calibration) {
  const Solution& solution = *calibration.refined;
  std::vector<CapturePoses> results;
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    // With the errors that captures share.
    std::vector<Rigid3d> corrections =
        Corrected(WithErrors(calibration.problem.captures[i], solution.effects), solution.captures[i].corrections);
    for (size_t r = 0; r < corrections.size(); ++r) {
      corrections[r] = Inverse(dataset.captures[i].base_from_gripper[r]) * corrections[r];
    }
    if (solution.captures[i].corrections.empty()) corrections.clear();
    results.push_back({dataset.captures[i].name, dataset.captures[i].base_from_gripper, std::move(corrections)});
  }
  return results;
}

// Returns the errors of the cameras with those of held-out images.
std::vector<CameraErrors> WithHoldOuts(std::vector<CameraErrors> errors, const std::vector<CameraHoldOut>& hold_outs) {
  for (size_t c = 0; c < hold_outs.size(); ++c) {
    const CameraHoldOut& camera = hold_outs[c];
    errors[c].holdout_rms_px = camera.rms_px;
    if (camera.target_m) errors[c].holdout_target_mm = 1000 * *camera.target_m;
    if (camera.target_rad) errors[c].holdout_target_deg = RadToDeg(*camera.target_rad);
    errors[c].holdout_reason = camera.reason;
  }
  return errors;
}

// Fills in the held-out distance of each image.
void AddHoldOutsOfImages(const std::vector<CameraHoldOut>& hold_outs, RunResult* result) {
  std::map<std::pair<std::string, std::string>, std::pair<double, int>> squares_of;
  for (size_t c = 0; c < hold_outs.size(); ++c) {
    for (const auto& [capture, distance_m] : hold_outs[c].target_m_of_capture) {
      auto& [sum_m2, number] = squares_of[{result->captures[capture].name, result->rig.cameras[c].name}];
      sum_m2 += distance_m * distance_m;
      ++number;
    }
  }
  for (ImageResult& image : result->images) {
    const auto squares = squares_of.find({image.capture, image.camera});
    if (squares == squares_of.end()) continue;
    const auto& [sum_m2, number] = squares->second;
    image.holdout_target_mm = 1000 * std::sqrt(sum_m2 / number);
  }
}

Outcome<RunOutput> RunOnImages(const Dataset& given, const RunOptions& options, RunObserver* observer) {
  RunOutput output;
  Dataset dataset = given;
  RunResult& result = output.result;
  Timing timing;
  const Stopwatch detect_watch;
  CheckCamerasByHeader(dataset);
  output.detections = DetectDataset(dataset, options.detect, options.num_threads, observer);
  if (options.earlier) ReadAsEarlier(*options.earlier, dataset, &output.detections);
  timing.detect_s = detect_watch.Seconds();
  const std::vector<DuplicateInDataset> duplicates = FindDuplicates(dataset, output.detections);
  EndIfCancelled(observer);
  const Stopwatch solve_watch;
  CalibrationOptions calibration_options = options.calibration;
  calibration_options.has_camera = dataset.has_camera;
  calibration_options.adjustment.num_threads = options.num_threads;
  const std::vector<std::optional<ArmSetup>> arms = SetUpArms(dataset, options.kinematics);
  calibration_options.arms = ErrorsOfArms(dataset, arms, options.kinematics);
  Outcome<Calibrated> calibrated =
      CalibrateAll(dataset, duplicates, options, calibration_options, &output.detections, observer);
  if (!calibrated) return calibrated.failure();
  const EstimatedPoints points =
      CalibratePoints(duplicates, options, calibration_options, &dataset, &*calibrated, &output.detections, observer);
  const std::vector<Drift> drifts = std::move(calibrated->drifts);
  std::vector<Finding> of_drifts = std::move(calibrated->findings);
  const PredictedImages predicted = calibrated->of_images.Predicted(output.detections);
  const std::vector<Finding> missing_ids = FindMissingIds(dataset, output.detections, predicted);
  const std::vector<Finding> from_behind = FindSeenFromBehind(dataset, output.detections, predicted);
  const Problem seen = std::move(calibrated->of_images.seen);
  output.calibration = std::move(calibrated->of_images.calibration);
  std::vector<Finding> of_rig = DiagnoseCalibration(seen, output.calibration);
  const std::vector<Finding> directions = DiagnoseWeakDirectionsOf(output.calibration);
  const Advice of_held = DiagnoseHeldIntrinsics(seen, output.calibration, calibration_options.adjustment);
  Advice of_smooth;
  if (options.calibration.smooth != SmoothPoseErrors::kNone) {
    of_smooth = DiagnoseSmoothRemainder(output.calibration.problem, *output.calibration.refined);
  }
  const Solution& solution = *output.calibration.refined;
  const Problem used = WithoutRejected(output.calibration.problem, solution);
  if (options.earlier) of_rig.push_back(JudgePrior(*options.earlier, used, solution));
  // The influence of a capture is that on the estimate from the captures alone.
  const MovesOfCameras moves = MovesWithoutCaptures(used, solution);
  std::vector<Eigen::VectorXd> changes = of_held.changes;
  changes.insert(changes.end(), of_smooth.changes.begin(), of_smooth.changes.end());
  changes.insert(changes.end(), points.changes.begin(), points.changes.end());
  const CaptureTimes times = TimesInOrder(dataset.captures.size());
  for (Eigen::VectorXd& change : ChangesByDrifts(used, solution, times, drifts)) changes.push_back(std::move(change));
  for (const Drift& drift : drifts) {
    of_drifts.push_back(DescribeDrift(used, drift, dataset.captures[drift.capture].name, true));
  }
  const ScaleShare scales = ShareOfScales(used, solution, ScaleSigmasOf(dataset, output.calibration.problem));
  // A wrong scale moves the cameras, and not what they see of an object of known size.
  Solution with_scales = solution;
  AddChanges(scales.changes, &with_scales.covariance);
  const std::vector<Eigen::VectorXd> of_arms = ChangesByUnknownArms(used, solution);
  ResidualStructure structure = FindResidualStructure(used, solution);
  std::vector<Eigen::VectorXd> all_changes = changes;
  all_changes.insert(all_changes.end(), of_arms.begin(), of_arms.end());
  const std::vector<std::optional<WorkingPoint>> working_points = WorkingPointsOf(used, with_scales, all_changes);
  AddShare(scales, changes, of_arms, &*output.calibration.refined);
  timing.refine_s = solution.convergence.seconds;
  timing.seed_s = std::max(0.0, solve_watch.Seconds() - timing.refine_s);

  result = PosesResult(dataset, output.calibration);
  result.timing = timing;
  result.images = ImageResults(dataset, seen, used, output.calibration, moves);
  MarkDuplicates(dataset, duplicates, output.detections, &result.images);
  result.captures = CaptureResults(dataset, output.calibration);
  AddErrors(used, solution, &result);
  AddLeftOutErrors(seen, output.calibration, &result);
  const int num_folds = std::min(options.folds, static_cast<int>(output.calibration.problem.captures.size()));
  if (num_folds > 1) {
    StageReport report(RunStage::kHoldOut, num_folds, observer);
    const HoldOuts hold_outs =
        CrossValidate(output.calibration, calibration_options, num_folds, [&] { report.Step(); });
    result.errors = WithHoldOuts(std::move(result.errors), hold_outs.of_cameras);
    AddHoldOutsOfImages(hold_outs.of_cameras, &result);
    result.holdout_chi2 = hold_outs.chi2_per_dof;
  }
  ArmSummaries summaries = SummariseArms(dataset, arms, options.kinematics, output.calibration);
  result.arms = std::move(summaries.arms);
  NameKnownArms(result.arms, result.rig.robots, &of_rig);
  for (const std::vector<Finding>& findings :
       {scales.findings, of_rig, of_drifts, summaries.findings, of_held.findings, of_smooth.findings,
        DescribePoints(used, TargetsWithFreePoints(given), points), structure.findings, directions, missing_ids,
        from_behind}) {
    result.observations.insert(result.observations.end(), findings.begin(), findings.end());
  }
  result.point_deviations = std::move(structure.points);
  if (!points.changes.empty()) result.point_offsets = points.offsets;
  result.working_points = working_points;
  result.requirements = ReachedAccuracies(options.requirements, used, solution, working_points);
  output.dataset = std::move(dataset);
  return output;
}

// Moves the captures in which the recorded joints of an arm contradict its pose to those that are left out.
Dataset WithoutWrongJoints(const Dataset& dataset) {
  std::map<size_t, std::string> reason_of;
  for (size_t r = 0; r < dataset.arms.size(); ++r) {
    const std::string& arm = dataset.rig.robots[r];
    for (const ContradictingJoints& joints : FindContradictingJoints(dataset, r)) {
      reason_of.try_emplace(joints.capture,
                            WhyLeftOut(joints, dataset.arms.size() == 1 ? "its joints" : "the joints of arm " + arm));
    }
  }
  return WithoutCaptures(dataset, reason_of);
}

// Orders the entries of images as the captures are in a data set, whose roles they get. Those of no capture come last.
void SortImages(const Dataset& dataset, std::vector<ImageResult>* images) {
  std::map<std::string, size_t> place_of;
  for (size_t i = 0; i < dataset.captures.size(); ++i) place_of.emplace(dataset.captures[i].name, i);
  const auto place = [&](const ImageResult& image) {
    const auto found = place_of.find(image.capture);
    return found == place_of.end() ? place_of.size() : found->second;
  };
  for (ImageResult& image : *images) {
    const auto found = place_of.find(image.capture);
    if (found != place_of.end()) image.role = dataset.captures[found->second].role;
  }
  std::stable_sort(images->begin(), images->end(),
                   [&](const ImageResult& a, const ImageResult& b) { return place(a) < place(b); });
}

// Throws InputError unless a capture has one entry for each arm and each camera.
void CheckCapture(const Dataset& dataset, const Recording& capture) {
  const size_t num_arms = dataset.rig.robots.size();
  if (!capture.joints.empty() && capture.joints.size() != num_arms) {
    throw InputError("capture " + capture.name + " needs a list of joints for each arm, or none");
  }
  if (capture.base_from_gripper.size() != num_arms || capture.images.size() != dataset.rig.cameras.size()) {
    throw InputError("capture " + capture.name + " needs one pose for each arm and one image for each camera");
  }
}

// Throws InputError if poses of the target were given and the data set is not complete without images.
void CheckTargetPoses(const Dataset& dataset, const RunOptions& options) {
  if (!IsSinglePair(dataset)) {
    throw InputError("poses of the target are for one camera and one target that one arm moves against each other");
  }
  if (dataset.target_poses.size() != dataset.captures.size()) {
    throw InputError("the data set has " + std::to_string(dataset.captures.size()) + " captures, but " +
                     std::to_string(dataset.target_poses.size()) + " poses of the target");
  }
  if (options.earlier) {
    throw InputError("the result of an earlier run is combined with images or points, not with poses of the target");
  }
}

// Throws InputError unless the poses of all captures can be taken from a robot's stream.
void CheckStream(const Dataset& dataset) {
  if (!IsSinglePair(dataset)) {
    throw InputError("a stream of poses is for one camera, one target and one arm");
  }
  const std::vector<double>& times_s = dataset.stream->times_s;
  if (times_s.size() < 2 || times_s.size() != dataset.stream->base_from_gripper.size() ||
      std::adjacent_find(times_s.begin(), times_s.end(), std::greater_equal<>()) != times_s.end()) {
    throw InputError("a stream needs two poses or more, at increasing times");
  }
  for (const Recording& capture : dataset.captures) {
    if (!capture.time_s) throw InputError("capture " + capture.name + " needs a time, for the stream of poses");
  }
}

// Throws InputError unless every detection is one of an image of the data set.
void CheckDetections(const Dataset& dataset) {
  for (const TargetDetection& given : dataset.given_detections) {
    const bool is_known = given.capture < dataset.captures.size() && given.camera < dataset.rig.cameras.size() &&
                          given.target < dataset.targets.size();
    if (is_known && !dataset.captures[given.capture].images[given.camera].empty()) continue;
    throw InputError(dataset.detections_source + ": has a detection in an image that no capture has");
  }
}

// Throws InputError if the data set is incomplete.
void CheckDataset(const Dataset& dataset, const RunOptions& options) {
  const size_t num_cameras = dataset.rig.cameras.size();
  if (dataset.captures.empty()) throw InputError("the data set has no captures");
  if (num_cameras == 0 || dataset.targets.empty() || dataset.rig.robots.empty()) {
    throw InputError("a data set needs at least one camera, one target and one arm");
  }
  if (dataset.has_camera.size() != num_cameras || dataset.camera_sources.size() != num_cameras ||
      dataset.targets.size() != dataset.rig.targets.size()) {
    throw InputError("the lists of the data set differ in size from those of the rig");
  }
  const size_t num_arms = dataset.rig.robots.size();
  if (!dataset.arms.empty() && dataset.arms.size() != num_arms) {
    throw InputError("the kinematics of the arms differ in number from the arms");
  }
  if (!dataset.robot_scale_sigmas.empty() && dataset.robot_scale_sigmas.size() != num_arms) {
    throw InputError("the scales of the arms differ in number from the arms");
  }
  for (const Recording& capture : dataset.captures) CheckCapture(dataset, capture);
  if (dataset.stream) CheckStream(dataset);
  for (const PlacedRequirement& requirement : options.requirements) {
    const bool is_known = std::any_of(dataset.rig.cameras.begin(), dataset.rig.cameras.end(),
                                      [&](const ProblemCamera& camera) { return camera.name == requirement.camera; });
    if (!requirement.camera.empty() && !is_known) {
      throw InputError("there is no camera " + Quoted(requirement.camera) + " of which an accuracy is required");
    }
  }
  if (!dataset.target_poses.empty()) {
    CheckTargetPoses(dataset, options);
    return;
  }
  for (const std::shared_ptr<const Target>& target : dataset.targets) {
    if (target == nullptr) throw InputError("the data set has no target");
  }
  CheckDetections(dataset);
  TargetsWithFreePoints(dataset);
  const std::string faults = WhyNotToldApart(dataset);
  if (!faults.empty()) throw InputError(faults);
}

}  // namespace

std::string WhyNotToldApart(const Dataset& dataset) {
  std::map<std::string, size_t> target_of_code;
  for (size_t t = 0; t < dataset.targets.size(); ++t) {
    for (const std::string& code : dataset.targets[t]->Codes()) {
      const auto [other, is_new] = target_of_code.emplace(code, t);
      if (is_new) continue;
      return "targets " + dataset.rig.targets[other->second].name + " and " + dataset.rig.targets[t].name +
             " cannot be told apart in an image: both are recognised by " + code +
             "; print one of them with other codes or, if it has none, with another number of rows or columns";
    }
  }
  return "";
}

Dataset DatasetOf(Setup setup, std::shared_ptr<const Target> target, const std::optional<Camera>& camera) {
  Dataset dataset;
  dataset.rig = HandEyeProblem(setup, camera.value_or(Camera()), TargetShape());
  dataset.rig.cameras.front().free_intrinsics = BundleOptions().free_intrinsics;
  dataset.has_camera = {camera.has_value()};
  dataset.camera_sources = {"camera"};
  dataset.targets = {std::move(target)};
  return dataset;
}

Outcome<RunOutput> Run(const Dataset& dataset, const RunOptions& options_in, RunObserver* observer) {
  CheckDataset(dataset, options_in);
  const Stopwatch watch;
  try {
    RunOptions options = options_in;
    Dataset used = dataset;
    if (options.kinematics != Kinematics::kNone || options.joint_noise) used = WithoutWrongJoints(dataset);
    if (options.earlier) BuildOn(*options.earlier, &used, &options);
    Outcome<RunOutput> output =
        IsSinglePair(used) ? RunPair(used, options, observer) : RunOnImages(used, options, observer);
    if (!output) return output;
    RunResult& result = output->result;
    for (ImageResult& left_out : LeftOutResults(output->dataset)) result.images.push_back(std::move(left_out));
    SortImages(dataset, &result.images);
    result.verdict = JudgeRun(result);
    if (dataset.truth && !IsShort(result)) AddTruth(*dataset.truth, output->calibration.problem, &result);
    result.timing.total_s = watch.Seconds();
    return output;
  } catch (const Cancelled&) {
    return Failure{FailureCode(kCancelled)};
  }
}

}  // namespace heba
