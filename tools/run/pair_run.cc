#include "tools/run/pair_run.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include "heba/base/failure_code.h"
#include "heba/base/stopwatch.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/data/hand_eye.h"
#include "heba/evaluation/verdict.h"
#include "heba/image_detection.h"
#include "heba/robot/arm_errors.h"
#include "solvers/calibration/calibration_problem.h"
#include "solvers/calibration/capture_rejection.h"
#include "solvers/calibration/drift_search.h"
#include "solvers/calibration/model_choice.h"
#include "solvers/calibration/time_offset.h"
#include "solvers/cell/camera_motion.h"
#include "solvers/initial/pose_consistency.h"
#include "solvers/refine/hand_eye_problem.h"
#include "solvers/refine/pose_refinement.h"
#include "solvers/residuals/inliers.h"
#include "tools/run/arm_assessment.h"
#include "tools/run/arm_setup.h"
#include "tools/run/assessment.h"
#include "tools/run/captures.h"
#include "tools/run/duplicate_images.h"
#include "tools/run/earlier_run.h"
#include "tools/run/free_points.h"
#include "tools/run/pair_output.h"
#include "tools/run/robot_errors.h"
#include "tools/run/run_stage.h"
#include "tools/run/second_detection.h"
#include "tools/run/time_offset.h"

namespace heba {
namespace {

// Returns whether a calibration from more points is no worse: it uses at least as many views, and its residuals are at
// most 5 % larger than those of the first.
bool IsAtLeastAsGood(const PairCalibration& second, const PairCalibration& first) {
  constexpr double kMaxRise = 1.05;
  return second.views.size() >= first.views.size() &&
         second.refined->pixel_sigma_px <= kMaxRise * first.refined->pixel_sigma_px;
}

// Adds the arm, and what is to be said of it, to a result.
void AddRobot(const Dataset& dataset, const std::optional<ArmSetup>& setup, RobotSummary robot,
              const PairCalibration& calibration, RunResult* result) {
  for (Finding& finding : FindingsOf(robot, SetupOf(dataset), calibration)) {
    result->observations.push_back(std::move(finding));
  }
  if (setup) {
    std::optional<Finding> singular = FindSingularCaptures(dataset, 0, *setup, robot.is_estimated);
    if (singular) result->observations.push_back(std::move(*singular));
  }
  result->arms = {std::move(robot)};
}

bool HasArm(const Dataset& dataset) { return !dataset.arms.empty() && dataset.arms.front(); }

// Leaves out the captures whose pose of the target is not where the others predict it, by a robust fit to most of them;
// none if so many are that it is not clear which are wrong.
Dataset WithoutWrongPoses(Dataset dataset) {
  std::vector<PoseCandidates> pairs;
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    pairs.push_back({ViewOf(dataset, i, {}).camera_mount_from_target_mount, {dataset.target_poses[i]}});
  }
  const std::optional<PoseConsistency> fit = FindPoseConsistency(pairs, RobotScale::kOne);
  if (!fit) return dataset;
  // Seven of ten normal errors in six directions are below 2.7 sigmas, so that this is some twelve sigmas.
  constexpr double kDistinct = 4.5;
  constexpr double kLeastM = 1e-4;
  const double most_m = std::max(kLeastM, kDistinct * fit->typical_misfit_m);
  std::map<size_t, std::string> reason_of;
  for (size_t i = 0; i < pairs.size(); ++i) {
    if (fit->misfit_m[i] <= most_m) continue;
    reason_of[i] = "contradicts the other captures: the pose of the target is " +
                   Significant(1000 * fit->translation_m[i], 2) + " mm and " +
                   Significant(RadToDeg(fit->rotation_rad[i]), 2) +
                   " deg from where they predict it (7 of 10 captures differ by less than " +
                   Significant(1000 * fit->typical_misfit_m, 2) +
                   " mm); wrong pose for the image, robot not settled, or target misread";
  }
  if (static_cast<double>(reason_of.size()) > kMostWrong * static_cast<double>(pairs.size())) return dataset;
  return WithoutCaptures(std::move(dataset), reason_of);
}

PoseCalibrationOptions PoseOptions(const Dataset& dataset, const RunOptions& run) {
  PoseCalibrationOptions options;
  options.methods = run.methods;
  options.seed = run.seed;
  options.setup = SetupOf(dataset);
  return options;
}

// Calibrates from the poses of the target with an exact robot.
PairCalibration CalibrateTargetPoses(const Dataset& dataset, const RunOptions& run) {
  PairCalibration calibration;
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    View view = ViewOf(dataset, i, {});
    calibration.pairs.push_back(
        {view.camera_mount_from_target_mount, dataset.target_poses[i], view.role, std::nullopt});
    calibration.pairs.back().joints = std::move(view.joints);
  }
  CalibratePoses(PoseOptions(dataset, run), &calibration);
  return calibration;
}

Dataset WithoutWrong(Dataset dataset, const RunOptions& run) {
  const bool leaves_out = run.calibration.adjustment.loss != LossKind::kNone;
  return leaves_out ? WithoutWrongPoses(std::move(dataset)) : dataset;
}

// Calibrates with an offset of time that is estimated beside all unknowns until so little is left of it that it matters
// to nobody. `calibrate_at` returns the calibration at an offset, with what it leaves of it (`rest`).
template <typename CalibrateAt>
auto SettleOffset(double offset_s, const CalibrateAt& calibrate_at) {
  constexpr int kMostRounds = 8;
  constexpr double kLongestStepS = 0.1;
  constexpr double kSettledSigmas = 0.1;
  auto last = calibrate_at(offset_s);
  for (int round = 1; round < kMostRounds; ++round) {
    if (!last.rest || std::abs(last.rest->change_s) < kSettledSigmas * last.rest->sigma_s) return last;
    offset_s += std::clamp(last.rest->change_s, -kLongestStepS, kLongestStepS);
    auto next = calibrate_at(offset_s);
    // An offset with which there is no calibration is none.
    if (!next.IsCalibrated()) return last;
    last = std::move(next);
  }
  return last;
}

// Adds the offset, and what is to be said of it, to a result. `rest`: TimeOffset; nothing if it is not determined.
void AddTimeOffset(double offset_s, const std::optional<TimeOffset>& rest, RunResult* result) {
  if (!rest) {
    result->observations.push_back(UndeterminedTimeOffset());
    return;
  }
  result->time_offset = EstimatedTimeOffset{offset_s, rest->sigma_s};
  result->observations.push_back(DescribeTimeOffset(*result->time_offset));
}

// A calibration from poses of the target, with the robot's poses at the times of the captures plus an offset.
struct PosesAtOffset {
  double offset_s = 0;
  Dataset dataset;  // With these poses, and without those of the target that are wrong.
  PairCalibration calibration;
  // The calibration leaves this of the offset; nothing if the captures do not determine it.
  std::optional<TimeOffset> rest;

  bool IsCalibrated() const { return calibration.chain.ok(); }
};

// Calibrates with an offset that is estimated beside the poses until it has settled.
PosesAtOffset CalibratePosesOfStream(const Dataset& dataset, const RunOptions& run) {
  const auto calibrate_at = [&](double offset_s) {
    PosesAtOffset at{offset_s, WithoutWrong(WithPosesAt(dataset, offset_s), run), {}, {}};
    at.calibration = CalibrateTargetPoses(at.dataset, run);
    if (!at.IsCalibrated()) return at;
    const PairSolution& chain = *at.calibration.chain;
    std::vector<size_t> captures(at.dataset.captures.size());
    std::iota(captures.begin(), captures.end(), 0);
    at.rest =
        EstimateTimeOffset(LinearisePairs(SetupOf(dataset), at.calibration.pairs, chain), Eigen::VectorXd::Zero(6),
                           chain.covariance.matrix, VelocitiesAt(at.dataset, offset_s, captures));
    return at;
  };
  return SettleOffset(FindTimeOffset(dataset, PosesInImages(dataset, {}, {})), calibrate_at);
}

// Calibrates from poses of the target that others estimated, with the evaluation that is possible without images.
Outcome<PairOutput> RunOnPoses(const Dataset& given, const RunOptions& run, RunObserver* observer) {
  PairOutput output;
  const bool has_offset = given.stream && run.estimates_time_offset;
  PosesAtOffset at_offset;
  if (has_offset) {
    at_offset = CalibratePosesOfStream(given, run);
    output.dataset = std::move(at_offset.dataset);
    output.calibration = std::move(at_offset.calibration);
  } else {
    output.dataset = WithoutWrong(given, run);
    output.calibration = CalibrateTargetPoses(output.dataset, run);
  }
  const Dataset& dataset = output.dataset;
  PairCalibration& calibration = output.calibration;
  if (!calibration.chain) return calibration.chain.failure();
  PoseCalibrationOptions options = PoseOptions(dataset, run);
  std::optional<ArmSetup> arm;
  if (HasArm(dataset) && run.kinematics != Kinematics::kNone) {
    arm = SetUpArm(dataset, 0, run.kinematics);
    options.has_robot_noise = true;
    SetEffectsOfPairs(dataset, run, &*arm, &options, &calibration);
    CalibratePoses(options, &calibration);
    if (!calibration.chain) return calibration.chain.failure();
  }
  // The errors of an arm come after the poses in the covariance.
  if (at_offset.rest) {
    Eigen::VectorXd change = Eigen::VectorXd::Zero(calibration.chain->covariance.matrix.cols());
    change.head(at_offset.rest->change_of_estimate.size()) = at_offset.rest->change_of_estimate;
    AddChanges({change}, &calibration.chain->covariance);
  }
  if (observer != nullptr) observer->OnCalibrated(calibration);
  output.result = AssessPoses(dataset, run, calibration, options);
  if (HasArm(dataset)) {
    AddRobot(dataset, arm, SummariseArm(dataset, run.kinematics, arm, calibration), calibration, &output.result);
  }
  if (has_offset) AddTimeOffset(at_offset.offset_s, at_offset.rest, &output.result);
  return output;
}

// A PairInput is what a run begins with, once its images have been searched.
struct PairInput {
  Dataset dataset;
  RunOptions options;
  ImageSize image_size;
  std::optional<SmoothErrors> smooth;  // The smooth errors of an earlier run, which are taken as they are.
  std::set<size_t> unusable;           // The captures whose images must not be used.
  RunObserver* observer = nullptr;
};

// Returns the detections with the points that a calibration has shown where to search; nothing if there are no others.
std::optional<std::vector<TargetDetection>> DetectCapturesAgain(const PairInput& input,
                                                                const std::vector<TargetDetection>& detections,
                                                                const EffectsOfCaptures& effects,
                                                                const PairCalibration& calibration) {
  if (!calibration.refined) return std::nullopt;
  const PairSolution& solution = *calibration.refined;
  const std::optional<SquaredErrors> errors = ReprojectionErrors(
      solution.hand_eye, solution.camera,
      ApplyShape(CorrectedViews(SetupOf(input.dataset), calibration.views, solution), solution.shape));
  if (!errors) return std::nullopt;
  return DetectAgain(input.dataset, detections,
                     PredictCaptures(input.dataset, detections, effects, solution, errors->RmsPx().value_or(0)),
                     input.options.num_threads, input.observer);
}

// The drifts that the views are corrected for, with the poses of their bodies.
struct KnownDrifts {
  std::vector<Drift> drifts = {};
  HandEye hand_eye = {};
};

// A calibration that is not assessed yet, with the options and the errors of the arm that it ended with.
struct Calibrated {
  PairCalibration calibration;
  EffectsOfCaptures effects;
  PairCalibrationOptions options;  // The final refinement used these.
  std::optional<ArmSetup> arm;
  std::optional<Finding> of_smooth_errors;
  KnownDrifts known;  // The views were corrected for these.
};

void Correct(const Dataset& dataset, const KnownDrifts& known, std::vector<View>* views) {
  for (View& view : *views) {
    for (const Drift& drift : known.drifts) {
      view.camera_mount_from_target_mount = WithoutDrift(
          view.camera_mount_from_target_mount, drift, RemainingShare(drift, view.capture, dataset.captures.size()),
          known.hand_eye.camera_mount_from_camera, known.hand_eye.target_mount_from_target);
    }
  }
}

// Gives a calibration the smooth errors that are taken as they are.
void SetSmoothErrors(const Dataset& dataset, const SmoothErrors& errors, Calibrated* calibrated) {
  calibrated->options.bundle.effects = std::make_shared<const SharedEffects>(errors.effects());
  for (const Recording& capture : dataset.captures) {
    calibrated->effects.effects.push_back(errors.EffectAt(capture.base_from_gripper.front()));
  }
}

// Calibrates from the detections of the captures that are not in `left_out`, with the drifts that are known; the target
// may be detected again.
Outcome<Calibrated> CalibrateCaptures(const PairInput& input, const std::set<size_t>& left_out,
                                      const KnownDrifts& known, std::vector<TargetDetection>* detections) {
  const Dataset& dataset = input.dataset;
  const RunOptions& options = input.options;
  EndIfCancelled(input.observer);
  Calibrated calibrated;
  calibrated.known = known;
  calibrated.options = OptionsOf(dataset, options, input.image_size);
  if (input.smooth) SetSmoothErrors(dataset, *input.smooth, &calibrated);
  const auto calibrate = [&](const std::vector<TargetDetection>& seen) {
    std::vector<View> views = ViewsOf(dataset, seen, calibrated.effects);
    std::erase_if(views, [&](const View& view) { return left_out.contains(view.capture); });
    Correct(dataset, known, &views);
    return CalibratePair(views, calibrated.options);
  };
  Outcome<PairCalibration> calibration = calibrate(*detections);
  if (!calibration) return calibration.failure();
  if (std::optional<std::vector<TargetDetection>> again =
          DetectCapturesAgain(input, *detections, calibrated.effects, *calibration)) {
    EndIfCancelled(input.observer);
    Outcome<PairCalibration> second = calibrate(*again);
    if (second && second->refined && IsAtLeastAsGood(*second, *calibration)) {
      calibration = std::move(second);
      *detections = std::move(*again);
    }
  }
  const bool needs_arm = options.kinematics != Kinematics::kNone || options.joint_noise;
  if (calibration->refined) {
    EndIfCancelled(input.observer);
    if (HasArm(dataset) && needs_arm) calibrated.arm = SetUpArm(dataset, 0, options.kinematics);
    calibrated.of_smooth_errors =
        CalibrateWithRobotErrors(dataset, options, calibrated.arm ? &*calibrated.arm : nullptr, &calibrated.effects,
                                 &calibrated.options, &*calibration);
  }
  calibrated.calibration = std::move(*calibration);
  return calibrated;
}

// The captures that a calibration uses, as a problem, with its solution and the times of the captures.
struct UsedCaptures {
  Problem problem;
  Solution solution;
  CaptureTimes times;
};

UsedCaptures UsedBy(const PairInput& input, const Calibrated& calibrated) {
  const CalibrationProblem of_captures = AsProblem(calibrated.calibration, calibrated.options);
  const JudgedProblem& judged = of_captures.model.judged;
  UsedCaptures used{WithoutRejected(Without(of_captures.model.problem, judged.left_out), judged.solution),
                    judged.solution,
                    {{}, input.dataset.captures.size()}};
  for (const View& view : of_captures.views) used.times.places.push_back(view.capture);
  return used;
}

// Returns all captures as they were detected, with the readings that the calibration chose.
DetectedCaptures DetectedBy(const PairInput& input, const Calibrated& calibrated,
                            const std::vector<TargetDetection>& detections) {
  const CalibrationProblem of_captures = AsProblem(calibrated.calibration, calibrated.options);
  std::map<size_t, View> views;
  // The reading of a target with a symmetry is known of captures that were calibrated only.
  if (calibrated.options.symmetries.size() == 1) {
    for (View& view : ViewsOf(input.dataset, detections)) {
      if (!input.unusable.contains(view.capture)) views[view.capture] = std::move(view);
    }
  }
  for (const View& view : of_captures.views) views[view.capture] = view;
  PairProblem problem{calibrated.calibration.refined->camera, {}, calibrated.options.setup, calibrated.options.shape};
  DetectedCaptures detected{{}, {{}, input.dataset.captures.size()}};
  for (auto& [capture, view] : views) {
    view.effect = nullptr;
    view.gripper_by_joints.resize(6, 0);
    problem.views.push_back(view);
    detected.times.places.push_back(capture);
  }
  BundleOptions options = calibrated.calibration.bundle;
  options.effects = nullptr;
  detected.problem = HandEyeProblem(problem, options);
  return detected;
}

// Calibrates with drifts of the bodies and forms of `known`, which are estimated again with the captures that they
// bring back. Returns nothing if the captures do not determine them.
std::optional<Calibrated> CalibrateCorrected(const PairInput& input, KnownDrifts known,
                                             std::vector<TargetDetection>* detections) {
  // Captures at one pose are told by that of the robot: with the corrections they are at several.
  const bool is_at_revisits = known.drifts.front().evidence == DriftEvidence::kRevisits;
  std::optional<Calibrated> with_drifts;
  const int num_rounds = is_at_revisits ? 1 : 2;
  for (int round = 0; round < num_rounds; ++round) {
    EndIfCancelled(input.observer);
    Outcome<Calibrated> next = CalibrateCaptures(input, input.unusable, known, detections);
    if (!next || !next->calibration.refined) return with_drifts;
    if (is_at_revisits) return std::move(*next);
    const UsedCaptures used = UsedBy(input, *next);
    const std::optional<std::vector<Drift>> rest =
        EstimateDrifts(used.problem, used.solution, used.times, known.drifts);
    if (!rest) return with_drifts;
    for (size_t d = 0; d < known.drifts.size(); ++d) {
      next->known.drifts[d].covariance = (*rest)[d].covariance;
      known.drifts[d] = next->known.drifts[d];
      known.drifts[d].change += (*rest)[d].change;
    }
    with_drifts = std::move(*next);
  }
  return with_drifts;
}

// Looks for a drift, or takes the drifts that are wanted.
DriftSearch SearchDrift(const PairInput& input, const Calibrated& calibrated,
                        const std::vector<TargetDetection>& detections, std::vector<Drift>* drifts) {
  const UsedCaptures used = UsedBy(input, calibrated);
  const DriftOptions& options = input.options.drift;
  DriftSearch search;
  if (options.is_tested) {
    search = FindDrift(used.problem, used.solution, used.times, DetectedBy(input, calibrated, detections));
    if (search.found) drifts->push_back(*search.found);
    return search;
  }
  std::vector<Drift> wanted;
  for (const DriftBody& body : options.wanted) wanted.emplace_back().body = body;
  if (wanted.empty()) return search;
  const std::optional<std::vector<Drift>> estimated = EstimateDrifts(used.problem, used.solution, used.times, wanted);
  if (estimated) *drifts = *estimated;
  return search;
}

// The captures on one side of a motion of the camera.
struct LeftOutByMotion {
  std::vector<size_t> captures;
  std::string reason;
  Finding finding;
};

// Returns the captures that a motion of the camera makes useless; nothing if it was not moved.
std::optional<LeftOutByMotion> FindMotion(const Calibrated& calibrated, int num_threads) {
  CalibrationProblem of_captures = InOrder(AsProblem(calibrated.calibration, calibrated.options));
  Problem& problem = of_captures.model.problem;
  // The tests of single images do not know noisy joints.
  for (ProblemCapture& capture : problem.captures) capture.postures.clear();
  AdjustmentOptions options;
  options.loss = calibrated.options.bundle.loss;
  options.pixel_noise_px = calibrated.options.bundle.pixel_noise_px;
  options.num_threads = num_threads;
  const std::optional<MovedCamera> moved = FindMovedCamera(problem, of_captures.model.judged, options);
  if (!moved) return std::nullopt;
  LeftOutByMotion left_out{{}, WhyLeftOut(problem, *moved), DescribeMotion(problem, *moved)};
  for (const size_t i : moved->left_out) left_out.captures.push_back(of_captures.views[i].capture);
  return left_out;
}

// Calibrates from the captures, corrected for a drift or without those on the shorter side of each motion of the
// camera; `motions` are the findings about them.
Outcome<Calibrated> CalibrateWithoutMotions(const PairInput& input, std::vector<TargetDetection>* detections,
                                            std::vector<Finding>* motions) {
  const Dataset& dataset = input.dataset;
  const int num_threads = input.options.num_threads;
  const bool leaves_out = input.options.calibration.adjustment.loss != LossKind::kNone;
  const bool wants_drifts = !input.options.drift.wanted.empty();
  std::set<size_t> left_out = input.unusable;
  std::vector<UnusedView> unused;
  Outcome<Calibrated> calibrated = CalibrateCaptures(input, left_out, {}, detections);
  std::optional<Finding> unseen;
  std::vector<Drift> drifts;
  if (calibrated && calibrated->calibration.refined) {
    EndIfCancelled(input.observer);
    unseen = SearchDrift(input, *calibrated, *detections, &drifts).unseen;
    // A knock that is clear by itself leaves out the captures on one side of it.
    const bool is_step = !drifts.empty() && drifts.front().form == DriftForm::kStep;
    if (is_step && leaves_out && FindMotion(*calibrated, num_threads)) drifts.clear();
    std::optional<Calibrated> corrected;
    if (!drifts.empty()) {
      corrected = CalibrateCorrected(input, {drifts, calibrated->calibration.refined->hand_eye}, detections);
    }
    if (corrected) calibrated = std::move(*corrected);
    if (wants_drifts && drifts.empty()) {
      unseen = Finding{Grade::kDoubtful, FindingCode("drift_unseen"), {}, {{"reason", "undetermined"}}};
    }
  }
  for (int motion = 0; motion < kMostMotions; ++motion) {
    if (!calibrated || !calibrated->calibration.refined || !leaves_out) break;
    EndIfCancelled(input.observer);
    const std::optional<LeftOutByMotion> found = FindMotion(*calibrated, num_threads);
    if (!found) break;
    std::set<size_t> without = left_out;
    without.insert(found->captures.begin(), found->captures.end());
    Outcome<Calibrated> rest = CalibrateCaptures(input, without, calibrated->known, detections);
    // A motion that leaves too few captures is not found out.
    if (!rest || !rest->calibration.refined) break;
    calibrated = std::move(rest);
    left_out = std::move(without);
    motions->push_back(found->finding);
    for (const size_t i : found->captures) unused.push_back({dataset.captures[i].name, i, found->reason});
  }
  if (!calibrated) return calibrated;
  // A drift that the calibration was not corrected for is said, too.
  const bool is_corrected = !calibrated->known.drifts.empty();
  for (const Drift& drift : is_corrected ? calibrated->known.drifts : drifts) {
    motions->push_back(DescribeDrift(HandEyeProblem(SetupOf(dataset), Camera(), TargetShape()), drift,
                                     dataset.captures[drift.capture].name, is_corrected));
  }
  if (unseen && motions->empty()) motions->push_back(std::move(*unseen));
  std::vector<UnusedView>& all = calibrated->calibration.unused;
  all.insert(all.end(), unused.begin(), unused.end());
  return calibrated;
}

// A calibration with the robot's poses at the times of the captures plus an offset.
struct CalibratedAtOffset {
  double offset_s = 0;
  Dataset dataset;  // With these poses.
  Outcome<Calibrated> calibrated;
  std::vector<Finding> motions;
  // The calibration leaves this of the offset; nothing if the captures do not determine it.
  std::optional<TimeOffset> rest;

  bool IsCalibrated() const { return calibrated && calibrated->calibration.refined; }
};

// Calibrates with an offset that is estimated beside all unknowns until it has settled; the target may be detected
// again.
CalibratedAtOffset CalibrateStream(const PairInput& input, std::vector<TargetDetection>* detections) {
  const auto calibrate_at = [&](double offset_s) {
    PairInput at_offset = input;
    at_offset.dataset = WithPosesAt(std::move(at_offset.dataset), offset_s);
    CalibratedAtOffset at{offset_s, at_offset.dataset, {}, {}, {}};
    at.calibrated = CalibrateWithoutMotions(at_offset, detections, &at.motions);
    if (!at.IsCalibrated()) return at;
    const UsedCaptures used = UsedBy(at_offset, *at.calibrated);
    at.rest = EstimateTimeOffset(used.problem, used.solution, VelocitiesAt(at.dataset, offset_s, used.times.places));
    return at;
  };
  const double start_s = FindTimeOffset(input.dataset, PosesInImages(input.dataset, *detections, input.image_size));
  return SettleOffset(start_s, calibrate_at);
}

// Estimates the points of the target if that is wanted, and calibrates again with the data set whose points lie there.
EstimatedPoints CalibratePoints(PairInput* input, Calibrated* calibrated, std::vector<TargetDetection>* detections,
                                std::vector<Finding>* motions) {
  const std::vector<size_t> targets = TargetsWithFreePoints(input->dataset);
  const std::vector<std::shared_ptr<const Target>> designed = input->dataset.targets;
  EstimatedPoints points;
  points.offsets.resize(designed.size());
  if (targets.empty()) return points;
  for (int round = 0; round <= kRoundsOfPoints; ++round) {
    const UsedCaptures used = UsedBy(*input, *calibrated);
    std::optional<EstimatedPoints> estimated = EstimatePoints(used.problem, used.solution, targets, points.offsets);
    if (!estimated) break;
    if (round == kRoundsOfPoints) {
      // The changes are those at the points that were used.
      estimated->offsets = std::move(points.offsets);
      return *std::move(estimated);
    }
    PairInput displaced = *input;
    displaced.dataset.targets = DisplacedTargets(designed, estimated->offsets);
    std::vector<Finding> of_next;
    Outcome<Calibrated> next = CalibrateWithoutMotions(displaced, detections, &of_next);
    if (!next || !next->calibration.refined) break;
    *input = std::move(displaced);
    *calibrated = std::move(*next);
    *motions = std::move(of_next);
    points = std::move(*estimated);
  }
  return points;
}

// The detections in the images, and the images that must not be used.
struct SearchedImages {
  std::vector<TargetDetection> detections;
  std::vector<DuplicateInDataset> duplicates;
};

// Detects the target in the images, or takes the given detections; the camera gets the size of its images.
SearchedImages SearchImages(const RunOptions& options, RunObserver* observer, Dataset* dataset) {
  SearchedImages searched;
  CheckCamerasByHeader(*dataset);
  searched.detections = DetectDataset(*dataset, options.detect, options.num_threads, observer);
  FitCamerasToImages(*dataset, searched.detections, &dataset->rig);
  if (options.earlier) ReadAsEarlier(*options.earlier, *dataset, &searched.detections);
  searched.duplicates = FindDuplicates(*dataset, searched.detections);
  return searched;
}

// Tells the observer what was detected. Returns the failure of images of which none can be used; nothing if some can.
std::optional<Failure> TellDetected(const PairInput& input, const SearchedImages& searched) {
  const std::vector<std::string> notes = DuplicateNotes(searched.duplicates, input.dataset.captures.size());
  const size_t num_images = searched.detections.size() - input.unusable.size();
  const TargetDetection* first = nullptr;
  int num_seen = 0;
  for (const TargetDetection& seen : searched.detections) {
    if (input.unusable.contains(seen.capture)) continue;
    if (first == nullptr) first = &seen;
    num_seen += seen.detection.detection.ids.empty() ? 0 : 1;
  }
  if (input.observer != nullptr) input.observer->OnDetected(notes, num_seen, static_cast<int>(num_images));
  if (first == nullptr) return Failure{FailureCode("all_left_out"), {}, {{"notes", Join(notes, "; ")}}};
  if (num_seen > 0) return std::nullopt;
  return Failure{FailureCode("nothing_detected"),
                 {{"images", static_cast<double>(num_images)}},
                 {{"image", input.dataset.captures[first->capture].name}, {"why", first->detection.detection.reason}}};
}

Outcome<PairOutput> RunOnImages(const Dataset& dataset, const RunOptions& options, std::optional<SmoothErrors> smooth,
                                RunObserver* observer) {
  PairOutput output;
  PairInput input{dataset, options, {}, std::move(smooth), {}, observer};
  const Stopwatch detect_watch;
  SearchedImages searched = SearchImages(options, observer, &input.dataset);
  Timing timing;
  timing.detect_s = detect_watch.Seconds();
  for (const DuplicateInDataset& duplicate : searched.duplicates) input.unusable.insert(duplicate.capture);
  if (const std::optional<Failure> failure = TellDetected(input, searched)) return *failure;
  const CaptureDetection& first = searched.detections.front().detection;
  input.image_size = {first.width_px, first.height_px};

  const Stopwatch solve_watch;
  std::vector<Finding> motions;
  const bool has_offset = input.dataset.stream && options.estimates_time_offset;
  CalibratedAtOffset at_offset;
  if (has_offset) {
    at_offset = CalibrateStream(input, &searched.detections);
    input.dataset = std::move(at_offset.dataset);
    motions = std::move(at_offset.motions);
  }
  Outcome<Calibrated> calibrated =
      has_offset ? std::move(at_offset.calibrated) : CalibrateWithoutMotions(input, &searched.detections, &motions);
  if (!calibrated) return calibrated.failure();
  EstimatedPoints points;
  if (calibrated->calibration.refined) {
    points = CalibratePoints(&input, &*calibrated, &searched.detections, &motions);
  }
  PairCalibration& calibration = calibrated->calibration;
  if (observer != nullptr) observer->OnCalibrated(calibration);
  if (!calibration.refined) return calibration.refined.failure();
  timing.refine_s = calibration.refined->convergence.seconds;
  timing.seed_s = solve_watch.Seconds() - timing.refine_s;
  Advice advice = Advise(calibration, calibrated->options);
  if (options.earlier) {
    const SearchedModel model = AsProblem(calibration, calibrated->options).model;
    advice.findings.push_back(
        JudgePrior(*options.earlier, UsedPoints(model.problem, model.judged), model.judged.solution));
  }
  if (!calibrated->known.drifts.empty()) {
    const UsedCaptures used = UsedBy(input, *calibrated);
    for (Eigen::VectorXd& change : ChangesByDrifts(used.problem, used.solution, used.times, calibrated->known.drifts)) {
      advice.changes.push_back(std::move(change));
    }
  }
  advice.changes.insert(advice.changes.end(), points.changes.begin(), points.changes.end());
  if (at_offset.rest) advice.changes.push_back(at_offset.rest->change_of_estimate);
  output.result = Assess(input.dataset, options, searched.detections, calibrated->effects, calibration, advice,
                         calibrated->options, observer);
  const PairSolution& assessed = *output.result.estimates.back().solution;
  calibration.refined->covariance = assessed.covariance;
  calibration.refined->covariance_repeatable = assessed.covariance_repeatable;
  std::vector<Finding>& observations = output.result.observations;
  for (Finding& motion : motions) observations.push_back(std::move(motion));
  for (Finding& finding : DescribePoints(dataset.rig, TargetsWithFreePoints(dataset), points)) {
    observations.push_back(std::move(finding));
  }
  if (has_offset) AddTimeOffset(at_offset.offset_s, at_offset.rest, &output.result);
  if (!points.changes.empty()) {
    output.result.point_offsets = points.offsets;
    output.result.model.target_shape.emplace_back(
        kTargetShapeGroupNames[static_cast<size_t>(TargetShapeGroup::kPoints)]);
  }
  if (HasArm(dataset)) {
    AddRobot(dataset, calibrated->arm, SummariseArm(dataset, options.kinematics, calibrated->arm, calibration),
             calibration, &output.result);
  }
  if (calibrated->of_smooth_errors) observations.push_back(std::move(*calibrated->of_smooth_errors));
  output.result.timing = timing;
  MarkDuplicates(dataset, searched.duplicates, searched.detections, &output.result.images);
  output.dataset = std::move(input.dataset);
  output.detections = std::move(searched.detections);
  output.effects = std::move(calibrated->effects);
  output.calibration = std::move(calibration);
  return output;
}

}  // namespace

Outcome<RunOutput> RunPair(const Dataset& dataset, const RunOptions& options_in, RunObserver* observer) {
  RunOptions options = options_in;
  std::optional<SmoothErrors> smooth;
  if (options.earlier) smooth = BuildNoiseOn(*options.earlier, dataset, &options);
  Outcome<PairOutput> output = dataset.target_poses.empty() ? RunOnImages(dataset, options, std::move(smooth), observer)
                                                            : RunOnPoses(dataset, options, observer);
  if (!output) return output.failure();
  return AsRunOutput(*std::move(output));
}

}  // namespace heba
