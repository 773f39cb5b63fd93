#include "heba/pair_run.h"

#include <algorithm>
#include <map>
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
#include "solvers/cell/camera_motion.h"
#include "solvers/initial/pose_consistency.h"
#include "solvers/refine/hand_eye_problem.h"
#include "solvers/residuals/inliers.h"
#include "tools/run/arm_assessment.h"
#include "tools/run/arm_setup.h"
#include "tools/run/assessment.h"
#include "tools/run/captures.h"
#include "tools/run/duplicate_images.h"
#include "tools/run/earlier_run.h"
#include "tools/run/pair_output.h"
#include "tools/run/robot_errors.h"
#include "tools/run/run_stage.h"
#include "tools/run/second_detection.h"

namespace heba {
namespace {

// Returns whether a calibration from more points is no worse: it uses at least as many views, and its residuals are at
// most 5 % larger than those of the first.
bool IsAtLeastAsGood(const PairCalibration& second, const PairCalibration& first) {
  constexpr double kMaxRise = 1.05;
  return second.views.size() >= first.views.size() &&
         second.refined->pixel_sigma_px <= kMaxRise * first.refined->pixel_sigma_px;
}

// Throws InputError if the data set is incomplete.
void CheckDataset(const PairDataset& dataset, bool has_prior) {
  const auto check_count = [&](size_t count, const std::string& what) {
    if (count == 0 || count == dataset.captures.size()) return;
    throw InputError("the data set has " + std::to_string(dataset.captures.size()) + " captures, but " +
                     std::to_string(count) + " " + what);
  };
  if (dataset.captures.empty()) throw InputError("the data set has no captures");
  check_count(dataset.given_detections.size(), "detections");
  check_count(dataset.target_poses.size(), "poses of the target");
  if (has_prior && !dataset.target_poses.empty()) {
    throw InputError("the result of an earlier run is combined with images or points, not with poses of the target");
  }
  if (!dataset.target && dataset.target_poses.empty()) throw InputError("the data set has no target");
}

// Adds the arm, and what is to be said of it, to a result.
void AddRobot(const PairDataset& dataset, const std::optional<ArmSetup>& setup, RobotSummary robot,
              const PairCalibration& calibration, RunResult* result) {
  for (Finding& finding : FindingsOf(robot, dataset, calibration)) result->observations.push_back(std::move(finding));
  if (setup) {
    std::optional<Finding> singular = FindSingularCaptures(dataset, *setup, robot.is_estimated);
    if (singular) result->observations.push_back(std::move(*singular));
  }
  result->arms = {std::move(robot)};
}

// Leaves out the captures whose recorded joints contradict their poses: one of the two is wrong.
LeftOutCaptures LeaveOutWrongJoints(PairDataset* dataset) {
  LeftOutCaptures left_out;
  const std::vector<ContradictingJoints> wrong = FindContradictingJoints(*dataset);
  for (const ContradictingJoints& joints : wrong) {
    left_out.indices.push_back(joints.capture);
    left_out.results.push_back(EntryOfUnused(dataset->captures[joints.capture]));
    left_out.results.back().reason = WhyLeftOut(joints, "its joints");
  }
  RemoveAt(left_out.indices, &dataset->captures);
  RemoveAt(left_out.indices, &dataset->given_detections);
  RemoveAt(left_out.indices, &dataset->target_poses);
  return left_out;
}

// Leaves out the captures whose pose of the target is not where the others predict it, by a robust fit to most of them;
// none if so many are that it is not clear which are wrong.
LeftOutCaptures LeaveOutWrongPoses(PairDataset* dataset) {
  LeftOutCaptures left_out;
  std::vector<PoseCandidates> pairs;
  for (size_t i = 0; i < dataset->captures.size(); ++i) {
    pairs.push_back({CameraMountFromTargetMount(dataset->setup, dataset->captures[i].base_from_gripper),
                     {dataset->target_poses[i]}});
  }
  const std::optional<PoseConsistency> fit = FindPoseConsistency(pairs, RobotScale::kOne);
  if (!fit) return left_out;
  // Seven of ten normal errors in six directions are below 2.7 sigmas, so that this is some twelve sigmas.
  constexpr double kDistinct = 4.5;
  constexpr double kLeastM = 1e-4;
  const double most_m = std::max(kLeastM, kDistinct * fit->typical_misfit_m);
  for (size_t i = 0; i < pairs.size(); ++i) {
    if (fit->misfit_m[i] > most_m) left_out.indices.push_back(i);
  }
  if (static_cast<double>(left_out.indices.size()) > kMostWrong * static_cast<double>(pairs.size())) return {};
  for (const size_t i : left_out.indices) {
    ImageResult& result = left_out.results.emplace_back(EntryOfUnused(dataset->captures[i]));
    result.reason = "contradicts the other captures: the pose of the target is " +
                    Significant(1000 * fit->translation_m[i], 2) + " mm and " +
                    Significant(RadToDeg(fit->rotation_rad[i]), 2) +
                    " deg from where they predict it (7 of 10 captures differ by less than " +
                    Significant(1000 * fit->typical_misfit_m, 2) +
                    " mm); wrong pose for the image, robot not settled, or target misread";
  }
  RemoveAt(left_out.indices, &dataset->captures);
  RemoveAt(left_out.indices, &dataset->target_poses);
  return left_out;
}

// Calibrates from poses of the target that others estimated, with the evaluation that is possible without images.
Outcome<PairOutput> RunOnPoses(PairDataset dataset, const PairRunOptions& run, RunObserver* observer) {
  PairOutput output;
  LeftOutCaptures left_out;
  if (run.bundle.loss != LossKind::kNone) left_out = LeaveOutWrongPoses(&dataset);
  output.dataset = dataset;
  PairCalibration& calibration = output.calibration;
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    const Rigid3d mount = CameraMountFromTargetMount(dataset.setup, dataset.captures[i].base_from_gripper);
    calibration.pairs.push_back({mount, dataset.target_poses[i], dataset.captures[i].role, std::nullopt});
    calibration.pairs.back().joints = dataset.captures[i].joints;
  }
  PoseCalibrationOptions options;
  options.methods = run.methods;
  options.seed = run.seed;
  options.setup = dataset.setup;
  CalibratePoses(options, &calibration);
  if (!calibration.chain) return calibration.chain.failure();
  std::optional<ArmSetup> arm;
  if (dataset.robot && run.kinematics != Kinematics::kNone) {
    arm = SetUpArm(dataset, run.kinematics);
    options.has_robot_noise = true;
    SetEffectsOfPairs(dataset, run, &*arm, &options, &calibration);
    CalibratePoses(options, &calibration);
    if (!calibration.chain) return calibration.chain.failure();
  }
  if (observer != nullptr) observer->OnCalibrated(calibration);
  output.result = AssessPoses(dataset, run, calibration, options);
  if (dataset.robot) {
    AddRobot(dataset, arm, SummariseArm(dataset, run.kinematics, arm, calibration), calibration, &output.result);
  }
  InsertLeftOut(left_out, &output.result.images);
  return output;
}

// Returns the detections with the points that a calibration has shown where to search; nothing if there are no others.
std::optional<std::vector<CaptureDetection>> DetectCapturesAgain(const PairDataset& dataset,
                                                                 const std::vector<CaptureDetection>& detections,
                                                                 const PairCalibration& calibration, int num_threads,
                                                                 RunObserver* observer) {
  if (!calibration.refined) return std::nullopt;
  const PairSolution& solution = *calibration.refined;
  const std::optional<SquaredErrors> errors =
      ReprojectionErrors(solution.hand_eye, solution.camera,
                         ApplyShape(CorrectedViews(dataset.setup, calibration.views, solution), solution.shape));
  if (!errors) return std::nullopt;
  std::optional<std::vector<TargetDetection>> again =
      DetectAgain(AsDataset(dataset), AsTargetDetections(detections),
                  PredictCaptures(dataset, solution, errors->RmsPx().value_or(0)), num_threads, observer);
  if (!again) return std::nullopt;
  return AsCaptureDetections(std::move(*again));
}

// The drifts that the views are corrected for, with the poses of their bodies.
struct KnownDrifts {
  std::vector<Drift> drifts = {};
  HandEye hand_eye = {};
};

// A calibration that is not assessed yet, with the data and options that it ended with.
struct Calibrated {
  PairCalibration calibration;
  PairDataset dataset;             // The data set has the joints that were recovered.
  PairCalibrationOptions options;  // The final refinement used these.
  std::optional<ArmSetup> arm;
  std::optional<Finding> of_smooth_errors;
  KnownDrifts known;  // The views were corrected for these.
};

void Correct(const PairDataset& dataset, const KnownDrifts& known, std::vector<View>* views) {
  for (View& view : *views) {
    for (const Drift& drift : known.drifts) {
      view.camera_mount_from_target_mount = WithoutDrift(
          view.camera_mount_from_target_mount, drift, RemainingShare(drift, view.capture, dataset.captures.size()),
          known.hand_eye.camera_mount_from_camera, known.hand_eye.target_mount_from_target);
    }
  }
}

// Calibrates from the detections of the captures that are not in `left_out`, with the drifts that are known; the target
// may be detected again.
Outcome<Calibrated> CalibrateCaptures(const PairDataset& dataset, const PairRunOptions& options,
                                      const std::set<size_t>& left_out, const KnownDrifts& known,
                                      std::vector<CaptureDetection>* detections, RunObserver* observer) {
  const auto views_of = [&](const std::vector<CaptureDetection>& seen) {
    std::vector<View> views = ViewsOf(dataset, seen);
    std::erase_if(views, [&](const View& view) { return left_out.contains(view.capture); });
    Correct(dataset, known, &views);
    return views;
  };
  EndIfCancelled(observer);
  Calibrated calibrated;
  calibrated.dataset = dataset;
  calibrated.known = known;
  calibrated.options = OptionsOf(dataset, options, detections->front().width_px, detections->front().height_px);
  Outcome<PairCalibration> calibration = CalibratePair(views_of(*detections), calibrated.options);
  if (!calibration) return calibration.failure();
  if (std::optional<std::vector<CaptureDetection>> again =
          DetectCapturesAgain(dataset, *detections, *calibration, options.num_threads, observer)) {
    EndIfCancelled(observer);
    Outcome<PairCalibration> second = CalibratePair(views_of(*again), calibrated.options);
    if (second && second->refined && IsAtLeastAsGood(*second, *calibration)) {
      calibration = std::move(second);
      *detections = std::move(*again);
    }
  }
  const bool needs_arm = options.kinematics != Kinematics::kNone || options.joint_noise;
  if (calibration->refined) {
    EndIfCancelled(observer);
    if (dataset.robot && needs_arm) calibrated.arm = SetUpArm(dataset, options.kinematics);
    calibrated.of_smooth_errors = CalibrateWithRobotErrors(options, calibrated.arm ? &*calibrated.arm : nullptr,
                                                           &calibrated.dataset, &calibrated.options, &*calibration);
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

UsedCaptures UsedBy(const Calibrated& calibrated) {
  const CalibrationProblem of_captures = AsProblem(calibrated.calibration, calibrated.options);
  const JudgedProblem& judged = of_captures.model.judged;
  UsedCaptures used{WithoutRejected(Without(of_captures.model.problem, judged.left_out), judged.solution),
                    judged.solution,
                    {{}, calibrated.dataset.captures.size()}};
  for (const View& view : of_captures.views) used.times.places.push_back(view.capture);
  return used;
}

// Returns all captures as they were detected, with the readings that the calibration chose.
DetectedCaptures DetectedBy(const Calibrated& calibrated, const std::vector<CaptureDetection>& detections) {
  const CalibrationProblem of_captures = AsProblem(calibrated.calibration, calibrated.options);
  std::map<size_t, View> views;
  // The reading of a target with a symmetry is known of captures that were calibrated only.
  if (calibrated.options.symmetries.size() == 1) {
    for (View& view : ViewsOf(calibrated.dataset, detections)) views[view.capture] = std::move(view);
  }
  for (const View& view : of_captures.views) views[view.capture] = view;
  PairProblem problem{calibrated.calibration.refined->camera, {}, calibrated.dataset.setup, calibrated.options.shape};
  DetectedCaptures detected{{}, {{}, calibrated.dataset.captures.size()}};
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
std::optional<Calibrated> CalibrateCorrected(const PairDataset& dataset, const PairRunOptions& options,
                                             const std::set<size_t>& left_out, KnownDrifts known,
                                             std::vector<CaptureDetection>* detections, RunObserver* observer) {
  // Captures at one pose are told by that of the robot: with the corrections they are at several.
  const bool is_at_revisits = known.drifts.front().evidence == DriftEvidence::kRevisits;
  std::optional<Calibrated> with_drifts;
  const int num_rounds = is_at_revisits ? 1 : 2;
  for (int round = 0; round < num_rounds; ++round) {
    EndIfCancelled(observer);
    Outcome<Calibrated> next = CalibrateCaptures(dataset, options, left_out, known, detections, observer);
    if (!next || !next->calibration.refined) return with_drifts;
    if (is_at_revisits) return std::move(*next);
    const UsedCaptures used = UsedBy(*next);
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
DriftSearch SearchDrift(const Calibrated& calibrated, const PairRunOptions& options,
                        const std::vector<CaptureDetection>& detections, std::vector<Drift>* drifts) {
  const UsedCaptures used = UsedBy(calibrated);
  DriftSearch search;
  if (options.drift.is_tested) {
    search = FindDrift(used.problem, used.solution, used.times, DetectedBy(calibrated, detections));
    if (search.found) drifts->push_back(*search.found);
    return search;
  }
  std::vector<Drift> wanted;
  for (const DriftBody& body : options.drift.wanted) wanted.emplace_back().body = body;
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
Outcome<Calibrated> CalibrateWithoutMotions(const PairDataset& dataset, const PairRunOptions& options,
                                            std::vector<CaptureDetection>* detections, std::vector<Finding>* motions,
                                            RunObserver* observer) {
  std::set<size_t> left_out;
  std::vector<UnusedView> unused;
  Outcome<Calibrated> calibrated = CalibrateCaptures(dataset, options, left_out, {}, detections, observer);
  std::optional<Finding> unseen;
  std::vector<Drift> drifts;
  if (calibrated && calibrated->calibration.refined) {
    EndIfCancelled(observer);
    unseen = SearchDrift(*calibrated, options, *detections, &drifts).unseen;
    // A knock that is clear by itself leaves out the captures on one side of it.
    const bool is_step = !drifts.empty() && drifts.front().form == DriftForm::kStep;
    const bool is_clear_knock =
        is_step && options.bundle.loss != LossKind::kNone && FindMotion(*calibrated, options.num_threads).has_value();
    if (is_clear_knock) drifts.clear();
    std::optional<Calibrated> corrected;
    if (!drifts.empty()) {
      corrected = CalibrateCorrected(dataset, options, left_out, {drifts, calibrated->calibration.refined->hand_eye},
                                     detections, observer);
    }
    if (corrected) calibrated = std::move(*corrected);
    if (!options.drift.wanted.empty() && drifts.empty()) {
      unseen = Finding{Grade::kDoubtful, FindingCode("drift_unseen"), {}, {{"reason", "undetermined"}}};
    }
  }
  for (int motion = 0; motion < kMostMotions; ++motion) {
    if (!calibrated || !calibrated->calibration.refined || options.bundle.loss == LossKind::kNone) break;
    EndIfCancelled(observer);
    const std::optional<LeftOutByMotion> found = FindMotion(*calibrated, options.num_threads);
    if (!found) break;
    std::set<size_t> without = left_out;
    without.insert(found->captures.begin(), found->captures.end());
    Outcome<Calibrated> rest = CalibrateCaptures(dataset, options, without, calibrated->known, detections, observer);
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
    motions->push_back(DescribeDrift(HandEyeProblem(dataset.setup, Camera(), TargetShape()), drift,
                                     dataset.captures[drift.capture].name, is_corrected));
  }
  if (unseen && motions->empty()) motions->push_back(std::move(*unseen));
  std::vector<UnusedView>& all = calibrated->calibration.unused;
  all.insert(all.end(), unused.begin(), unused.end());
  return calibrated;
}

Outcome<PairOutput> RunOnImages(PairDataset dataset, const PairRunOptions& options, RunObserver* observer) {
  PairOutput output;
  std::vector<CaptureDetection>& detections = output.detections;

  const Stopwatch detect_watch;
  CheckCamerasByHeader(AsDataset(dataset));
  detections = DetectCaptures(dataset, options.detect, options.num_threads, observer);
  FitCameraToImages(detections, &dataset);
  if (options.earlier) {
    std::vector<TargetDetection> read = AsTargetDetections(std::move(detections));
    ReadAsEarlier(*options.earlier, AsDataset(dataset), &read);
    detections = AsCaptureDetections(std::move(read));
  }
  Timing timing;
  timing.detect_s = detect_watch.Seconds();
  const LeftOutCaptures left_out = LeaveOutSharedImages(&dataset, &detections);
  const size_t num_seen = ViewsOf(dataset, detections).size();
  if (observer != nullptr) {
    observer->OnDetected(left_out, static_cast<int>(num_seen), static_cast<int>(detections.size()));
  }
  if (detections.empty()) return Failure{FailureCode("all_left_out"), {}, {{"notes", Join(left_out.notes, "; ")}}};
  if (num_seen == 0) {
    return Failure{FailureCode("nothing_detected"),
                   {{"images", static_cast<double>(detections.size())}},
                   {{"image", dataset.captures[0].name}, {"why", detections.front().detection.reason}}};
  }

  const Stopwatch solve_watch;
  std::vector<Finding> motions;
  Outcome<Calibrated> calibrated = CalibrateWithoutMotions(dataset, options, &detections, &motions, observer);
  if (!calibrated) return calibrated.failure();
  PairCalibration& calibration = output.calibration;
  calibration = std::move(calibrated->calibration);
  output.dataset = std::move(calibrated->dataset);
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
    Calibrated of_output = *calibrated;
    of_output.calibration = calibration;
    of_output.dataset = output.dataset;
    const UsedCaptures used = UsedBy(of_output);
    for (Eigen::VectorXd& change : ChangesByDrifts(used.problem, used.solution, used.times, calibrated->known.drifts)) {
      advice.changes.push_back(std::move(change));
    }
  }
  output.result = Assess(output.dataset, options, detections, calibration, advice, calibrated->options, observer);
  const PairSolution& assessed = *output.result.estimates.back().solution;
  calibration.refined->covariance = assessed.covariance;
  calibration.refined->covariance_repeatable = assessed.covariance_repeatable;
  std::vector<Finding>& observations = output.result.observations;
  for (Finding& motion : motions) observations.push_back(std::move(motion));
  if (dataset.robot) {
    AddRobot(output.dataset, calibrated->arm,
             SummariseArm(output.dataset, options.kinematics, calibrated->arm, calibration), calibration,
             &output.result);
  }
  if (calibrated->of_smooth_errors) observations.push_back(std::move(*calibrated->of_smooth_errors));
  output.result.timing = timing;
  InsertLeftOut(left_out, &output.result.images);
  return output;
}

}  // namespace

Outcome<RunOutput> Run(const PairDataset& dataset, const PairRunOptions& options_in, RunObserver* observer) {
  const Stopwatch total;
  CheckDataset(dataset, options_in.earlier.has_value());
  try {
    PairDataset used = dataset;
    PairRunOptions options = options_in;
    if (options.earlier) BuildOn(*options.earlier, &used, &options);
    LeftOutCaptures left_out;
    if (options.kinematics != Kinematics::kNone || options.joint_noise) left_out = LeaveOutWrongJoints(&used);
    Outcome<PairOutput> output = used.target_poses.empty() ? RunOnImages(std::move(used), options, observer)
                                                           : RunOnPoses(std::move(used), options, observer);
    if (!output) return output.failure();
    InsertLeftOut(left_out, &output->result.images);
    output->result.verdict = JudgeRun(output->result);
    output->result.timing.total_s = total.Seconds();
    return AsRunOutput(*std::move(output));
  } catch (const Cancelled&) {
    return Failure{FailureCode(kCancelled)};
  }
}

}  // namespace heba
