#include "tools/run/pair_images.h"

#include <algorithm>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>

#include "heba/base/failure_code.h"
#include "heba/calibration.h"
#include "heba/data/hand_eye.h"
#include "heba/data/smooth_errors.h"
#include "heba/pair_calibration.h"
#include "solvers/calibration/calibration_problem.h"
#include "solvers/calibration/drift_search.h"
#include "solvers/cell/camera_motion.h"
#include "solvers/refine/hand_eye_problem.h"
#include "solvers/residuals/inliers.h"
#include "tools/run/arm_setup.h"
#include "tools/run/captures.h"
#include "tools/run/earlier_run.h"
#include "tools/run/pair_result.h"
#include "tools/run/robot_errors.h"
#include "tools/run/run_stage.h"
#include "tools/run/second_detection.h"

namespace heba {
namespace {

// A PairInput is what the calibration begins with.
struct PairInput {
  Dataset dataset;
  RunOptions options;
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

// A calibration that is not assessed yet.
struct Calibrated : RobotCalibration {
  std::vector<TargetDetection> detections;
  KnownDrifts known;              // The views were corrected for these.
  std::vector<Finding> findings;  // About motions and drifts.
};

std::vector<View> DriftCorrected(std::vector<View> views, const Dataset& dataset, const KnownDrifts& known) {
  for (View& view : views) {
    for (const Drift& drift : known.drifts) {
      view.camera_mount_from_target_mount = WithoutDrift(
          view.camera_mount_from_target_mount, drift, RemainingShare(drift, view.capture, dataset.captures.size()),
          known.hand_eye.camera_mount_from_camera, known.hand_eye.target_mount_from_target);
    }
  }
  return views;
}

// Calibrates from the detections of the captures that are not in `left_out`, with the drifts that are known; the target
// may be detected again.
Outcome<Calibrated> CalibrateCaptures(const PairInput& input, const std::set<size_t>& left_out,
                                      const KnownDrifts& known, const std::vector<TargetDetection>& detections) {
  const Dataset& dataset = input.dataset;
  const RunOptions& options = input.options;
  EndIfCancelled(input.observer);
  Calibrated calibrated;
  calibrated.detections = detections;
  calibrated.known = known;
  calibrated.options = OptionsOf(dataset, options);
  if (input.smooth) {
    calibrated.options.bundle.effects = std::make_shared<const SharedEffects>(input.smooth->effects());
    calibrated.effects.effects = EffectsAt(dataset, *input.smooth);
  }
  const auto calibrate = [&](const std::vector<TargetDetection>& seen) {
    std::vector<View> views = ViewsOf(dataset, seen, calibrated.effects);
    std::erase_if(views, [&](const View& view) { return left_out.contains(view.capture); });
    return CalibratePair(DriftCorrected(std::move(views), dataset, known), calibrated.options);
  };
  Outcome<PairCalibration> calibration = calibrate(detections);
  if (!calibration) return calibration.failure();
  if (std::optional<std::vector<TargetDetection>> again =
          DetectCapturesAgain(input, detections, calibrated.effects, *calibration)) {
    EndIfCancelled(input.observer);
    Outcome<PairCalibration> second = calibrate(*again);
    if (second && second->refined && IsAtLeastAsGood(QualityOf(*second), QualityOf(*calibration))) {
      calibration = std::move(second);
      calibrated.detections = std::move(*again);
    }
  }
  calibrated.calibration = std::move(*calibration);
  if (!calibrated.calibration.refined) return calibrated;
  EndIfCancelled(input.observer);
  const bool needs_arm = options.kinematics != Kinematics::kNone || options.joint_noise;
  if (!dataset.arms.empty() && dataset.arms.front() && needs_arm) {
    calibrated.arm = SetUpArm(dataset, 0, options.kinematics);
  }
  RobotCalibration& of_robot = calibrated;
  of_robot = CalibrateWithRobotErrors(dataset, options, std::move(of_robot));
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
DetectedCaptures DetectedBy(const PairInput& input, const Calibrated& calibrated) {
  const CalibrationProblem of_captures = AsProblem(calibrated.calibration, calibrated.options);
  std::map<size_t, View> views;
  // The reading of a target with a symmetry is known of captures that were calibrated only.
  if (calibrated.options.symmetries.size() == 1) {
    for (View& view : ViewsOf(input.dataset, calibrated.detections)) {
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
                                             std::vector<TargetDetection> detections) {
  // Captures at one pose are told by that of the robot: with the corrections they are at several.
  const bool is_at_revisits = known.drifts.front().evidence == DriftEvidence::kRevisits;
  std::optional<Calibrated> with_drifts;
  const int num_rounds = is_at_revisits ? 1 : 2;
  for (int round = 0; round < num_rounds; ++round) {
    EndIfCancelled(input.observer);
    Outcome<Calibrated> next = CalibrateCaptures(input, input.unusable, known, detections);
    if (!next || !next->calibration.refined) return with_drifts;
    if (is_at_revisits) return std::move(*next);
    detections = next->detections;
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

// The drifts of a session, and what is to be said if they cannot be seen.
struct DriftsOfSession {
  std::vector<Drift> drifts;
  std::optional<Finding> unseen;
};

// Looks for a drift, or takes the drifts that are wanted.
DriftsOfSession SearchDrifts(const PairInput& input, const Calibrated& calibrated) {
  const UsedCaptures used = UsedBy(input, calibrated);
  const DriftOptions& options = input.options.drift;
  if (options.is_tested) {
    DriftSearch search = FindDrift(used.problem, used.solution, used.times, DetectedBy(input, calibrated));
    DriftsOfSession tested;
    if (search.found) tested.drifts.push_back(*search.found);
    tested.unseen = std::move(search.unseen);
    return tested;
  }
  if (options.wanted.empty()) return {};
  std::vector<Drift> wanted;
  for (const DriftBody& body : options.wanted) wanted.emplace_back().body = body;
  if (auto estimated = EstimateDrifts(used.problem, used.solution, used.times, wanted)) return {*estimated, {}};
  return {{}, Finding{Grade::kDoubtful, FindingCode("drift_unseen"), {}, {{"reason", "undetermined"}}}};
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
// camera.
Outcome<Calibrated> CalibrateWithoutMotions(const PairInput& input, const std::vector<TargetDetection>& detections) {
  const Dataset& dataset = input.dataset;
  const int num_threads = input.options.num_threads;
  const bool leaves_out = input.options.calibration.adjustment.loss != LossKind::kNone;
  std::set<size_t> left_out = input.unusable;
  std::vector<UnusedView> unused;
  Outcome<Calibrated> calibrated = CalibrateCaptures(input, left_out, {}, detections);
  DriftsOfSession session;
  std::vector<Drift>& drifts = session.drifts;
  if (calibrated && calibrated->calibration.refined) {
    EndIfCancelled(input.observer);
    session = SearchDrifts(input, *calibrated);
    // A knock that is clear by itself leaves out the captures on one side of it.
    const bool is_step = !drifts.empty() && drifts.front().form == DriftForm::kStep;
    if (is_step && leaves_out && FindMotion(*calibrated, num_threads)) drifts.clear();
    std::optional<Calibrated> corrected;
    if (!drifts.empty()) {
      corrected =
          CalibrateCorrected(input, {drifts, calibrated->calibration.refined->hand_eye}, calibrated->detections);
    }
    if (corrected) calibrated = std::move(*corrected);
  }
  std::vector<Finding> findings;
  for (int motion = 0; motion < kMostMotions; ++motion) {
    if (!calibrated || !calibrated->calibration.refined || !leaves_out) break;
    EndIfCancelled(input.observer);
    const std::optional<LeftOutByMotion> found = FindMotion(*calibrated, num_threads);
    if (!found) break;
    std::set<size_t> without = left_out;
    without.insert(found->captures.begin(), found->captures.end());
    Outcome<Calibrated> rest = CalibrateCaptures(input, without, calibrated->known, calibrated->detections);
    // A motion that leaves too few captures is not found out.
    if (!rest || !rest->calibration.refined) break;
    calibrated = std::move(rest);
    left_out = std::move(without);
    findings.push_back(found->finding);
    for (const size_t i : found->captures) unused.push_back({dataset.captures[i].name, i, found->reason});
  }
  if (!calibrated) return calibrated;
  // A drift that the calibration was not corrected for is said, too.
  const bool is_corrected = !calibrated->known.drifts.empty();
  for (const Drift& drift : is_corrected ? calibrated->known.drifts : drifts) {
    findings.push_back(DescribeDrift(HandEyeProblem(SetupOf(dataset), Camera(), TargetShape()), drift,
                                     dataset.captures[drift.capture].name, is_corrected));
  }
  if (session.unseen && findings.empty()) findings.push_back(std::move(*session.unseen));
  calibrated->findings = std::move(findings);
  std::vector<UnusedView>& all = calibrated->calibration.unused;
  all.insert(all.end(), unused.begin(), unused.end());
  return calibrated;
}

// Returns all captures of the data set as the calibration sees them, with the points of all images.
Problem SeenBy(const PairInput& input, const Calibrated& calibrated) {
  const Dataset& dataset = input.dataset;
  const PairCalibration& calibration = calibrated.calibration;
  std::vector<View> views;
  for (size_t i = 0; i < dataset.captures.size(); ++i) views.push_back(ViewOf(dataset, i, {}, calibrated.effects));
  for (View& view : ViewsOf(dataset, calibrated.detections, calibrated.effects)) {
    if (!input.unusable.contains(view.capture)) views[view.capture] = std::move(view);
  }
  views = DriftCorrected(std::move(views), dataset, calibrated.known);
  BundleOptions bundle = calibration.bundle;
  bundle.effects = calibration.refined->shared_effects;
  Problem seen =
      HandEyeProblem({calibration.camera, views, calibrated.options.setup, calibrated.options.shape}, bundle);
  seen.targets[0].symmetries = calibrated.options.symmetries;
  for (ProblemCapture& capture : seen.captures) {
    if (capture.images[0].observations.size() == 0) capture.images.clear();
  }
  return seen;
}

// Returns a calibration with a refined estimate in the general form.
CalibratedImages InGeneralForm(const PairInput& input, Calibrated calibrated) {
  PairCalibration& pair = calibrated.calibration;
  const CalibrationProblem of_views = AsProblem(pair, calibrated.options);
  const JudgedProblem& judged = of_views.model.judged;
  CalibratedImages images;
  images.seen = SeenBy(input, calibrated);
  Problem& problem = images.calibration.problem;
  problem = images.seen;
  Solution refined = judged.solution;
  refined.captures.clear();
  for (ProblemCapture& capture : problem.captures) {
    for (ProblemImage& image : capture.images) image.observations = Observations();
    CaptureOutcome& outcome = refined.captures.emplace_back();
    if (refined.robot_noise[0]) outcome.corrections = {Rigid3d()};
    outcome.rejected_ids.resize(capture.images.size());
  }
  for (size_t k = 0; k < of_views.views.size(); ++k) {
    const size_t i = of_views.views[k].capture;
    images.seen.captures[i] = of_views.model.problem.captures[k];
    if (judged.left_out.contains({k, 0})) continue;
    problem.captures[i] = of_views.model.problem.captures[k];
    refined.captures[i] = judged.solution.captures[k];
  }
  for (const View& view : pair.with_rejected) {
    images.seen.captures[view.capture].images[0].observations = view.observations;
  }
  images.calibration.refined = std::move(refined);
  for (const UnusedView& unused : pair.unused) {
    images.calibration.unused.push_back({unused.capture, std::nullopt, unused.reason});
  }
  images.calibration.pairs.push_back(AsPair(std::move(pair)));
  images.drifts = std::move(calibrated.known.drifts);
  images.arms = {std::move(calibrated.arm)};
  images.detections = std::move(calibrated.detections);
  images.findings = std::move(calibrated.findings);
  if (calibrated.of_smooth_errors) images.findings.push_back(*std::move(calibrated.of_smooth_errors));
  images.pair_options = std::move(calibrated.options);
  return images;
}

}  // namespace

Outcome<CalibratedImages> CalibratePairImages(const ImageRun& run) {
  PairInput input{run.dataset, run.options, std::nullopt, {}, run.observer};
  if (run.options.earlier) {
    NoiseOfEarlier built = BuildNoiseOn(*run.options.earlier, run.dataset, run.options);
    input.options = std::move(built.options);
    input.smooth = std::move(built.smooth);
  }
  for (const DuplicateInDataset& duplicate : run.duplicates) input.unusable.insert(duplicate.capture);
  Outcome<Calibrated> calibrated = CalibrateWithoutMotions(input, run.detections);
  if (!calibrated) return calibrated.failure();
  const Outcome<PairSolution>& refined = calibrated->calibration.refined;
  if (!refined) {
    if (run.observer != nullptr && run.is_first) run.observer->OnCalibrated(calibrated->calibration);
    return refined.failure();
  }
  return InGeneralForm(input, *std::move(calibrated));
}

}  // namespace heba
