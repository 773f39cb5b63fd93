#include "heba/run.h"

#include <algorithm>
#include <chrono>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/evaluation/verdict.h"
#include "heba/robot/arm_errors.h"
#include "solvers/calibration/model_choice.h"
#include "tools/run/arm_setup.h"
#include "tools/run/assessment.h"
#include "tools/run/captures.h"
#include "tools/run/digest.h"
#include "tools/run/duplicate_images.h"
#include "tools/run/second_detection.h"

namespace heba {
namespace {

class Stopwatch {
 public:
  double Seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// Returns whether a calibration from more points is no worse: it uses at least as many views, and its residuals are at
// most 5 % larger than those of the first.
bool IsAtLeastAsGood(const Calibration& second, const Calibration& first) {
  constexpr double kMaxRise = 1.05;
  return second.views.size() >= first.views.size() &&
         second.refined->pixel_sigma_px <= kMaxRise * first.refined->pixel_sigma_px;
}

// Throws InputError if the data set is incomplete.
void CheckDataset(const Dataset& dataset) {
  const auto check_count = [&](size_t count, const std::string& what) {
    if (count == 0 || count == dataset.captures.size()) return;
    throw InputError("the data set has " + std::to_string(dataset.captures.size()) + " captures, but " +
                     std::to_string(count) + " " + what);
  };
  if (dataset.captures.empty()) throw InputError("the data set has no captures");
  check_count(dataset.given_detections.size(), "detections");
  check_count(dataset.target_poses.size(), "poses of the target");
  if (!dataset.target && dataset.target_poses.empty()) throw InputError("the data set has no target");
}

// Adds the arm, and what is to be said of it, to a result.
void AddRobot(RobotSummary robot, RunResult* result) {
  for (Finding& finding : FindingsOf(robot)) result->observations.push_back(std::move(finding));
  result->robot = std::move(robot);
}

// Sets the effects of the arm's errors on the pairs, and the errors among which is chosen.
void SetUpPairs(const Dataset& dataset, const RunOptions& run, ArmSetup* arm, PoseCalibrationOptions* options,
                Calibration* calibration) {
  if (!arm->reason.empty()) return;
  const auto errors_of = [&](ArmErrorModel model) {
    return std::make_shared<const SharedEffects>(ArmErrors(dataset.robot->arm, model));
  };
  std::vector<std::vector<std::shared_ptr<const PoseEffect>>> effects;
  for (const ArmBranch& branch : arm->branches) effects.push_back(EffectsOf(dataset, *arm, branch));
  size_t best = 0;
  if (effects.size() > 1) {
    const std::optional<size_t> found = MostLikelyPoseEffects(
        dataset.setup, calibration->pairs, calibration->chain->hand_eye, errors_of(ArmErrorModel::kGeometry), effects);
    if (!found) {
      arm->reason = "no configuration of the arm explains the captures";
      return;
    }
    best = *found;
  }
  arm->branches = {arm->branches[best]};
  for (size_t i = 0; i < calibration->pairs.size(); ++i) calibration->pairs[i].effect = effects[best][i];
  options->effects = {errors_of(ArmErrorModel::kOffsets)};
  if (run.kinematics != Kinematics::kOffsets) options->effects.push_back(errors_of(ArmErrorModel::kGeometry));
  options->must_have_effects = run.kinematics != Kinematics::kAuto;
}

// Calibrates from poses of the target that others estimated, with the evaluation that is possible without images.
Outcome<RunOutput> RunOnPoses(const Dataset& dataset, const RunOptions& run, RunObserver* observer) {
  RunOutput output;
  output.dataset = dataset;
  Calibration& calibration = output.calibration;
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    const Rigid3d mount = CameraMountFromTargetMount(dataset.setup, dataset.captures[i].base_from_gripper);
    calibration.pairs.push_back({mount, dataset.target_poses[i], dataset.captures[i].role, std::nullopt});
  }
  PoseCalibrationOptions options;
  options.methods = run.methods;
  options.seed = run.seed;
  options.setup = dataset.setup;
  CalibratePoses(options, &calibration);
  if (!calibration.chain) return Failure{calibration.chain.reason()};
  std::optional<ArmSetup> arm;
  if (dataset.robot && run.kinematics != Kinematics::kNone) {
    arm = SetUpArm(dataset);
    options.has_robot_noise = true;
    SetUpPairs(dataset, run, &*arm, &options, &calibration);
    CalibratePoses(options, &calibration);
    if (!calibration.chain) return Failure{calibration.chain.reason()};
  }
  // The same limits as for bundle adjustment, which rejects a result that is known to 10 cm or 6 deg only.
  constexpr double kWorthlessMm = 100;
  constexpr double kWorthlessDeg = 6;
  const std::optional<BoardScatter> scatter = ComputeBoardScatter(calibration.pairs, calibration.chain->hand_eye);
  if (scatter && (scatter->translation_rms_mm > kWorthlessMm || scatter->rotation_rms_deg > kWorthlessDeg)) {
    return Failure{"the target scatters by " + Significant(scatter->translation_rms_mm, 2) + " mm and " +
                   Significant(scatter->rotation_rms_deg, 2) + " deg, but should be stationary"};
  }
  if (observer != nullptr) observer->OnCalibrated(calibration);
  output.result = AssessPoses(dataset, run, calibration, options);
  if (dataset.robot) AddRobot(SummariseArm(dataset, run.kinematics, arm, calibration), &output.result);
  return output;
}

// Returns the reason why the target was detected in no image.
std::string NothingDetected(const Dataset& dataset, const std::vector<CaptureDetection>& detections) {
  const std::string first = detections.front().detection.reason;
  return "the target was not detected in any of the " + std::to_string(detections.size()) + " images" +
         (first.empty() ? "" : " (" + dataset.captures[0].name + ": " + first + ")") +
         "; is it the target that the config names?";
}

// Calibrates again with other options, which may choose among effects. If that fails, or if no effects are chosen,
// returns the reason and keeps the calibration and its options.
std::optional<std::string> Recalibrate(const std::vector<View>& views, CalibrationOptions with_effects,
                                       CalibrationOptions* options, Calibration* calibration) {
  Outcome<Calibration> again = Calibrate(views, with_effects);
  if (!again || !again->refined) {
    return "the refinement with the arm's errors failed: " + (again ? again->refined.reason() : again.reason());
  }
  if (!with_effects.choose.effects.empty() && again->bundle.effects == nullptr) return WhyDeclined(*again);
  *calibration = std::move(*again);
  *options = std::move(with_effects);
  return std::nullopt;
}

// Returns which branch of the arm explains the captures best; nothing if none does.
std::optional<size_t> MostLikelyBranch(const Dataset& dataset, const ArmSetup& arm, const CalibrationOptions& options,
                                       const Calibration& calibration) {
  if (arm.branches.size() == 1) return 0;
  std::vector<std::vector<std::shared_ptr<const PoseEffect>>> effects;
  for (const ArmBranch& branch : arm.branches) effects.push_back(EffectsOf(dataset, arm, branch));
  BundleOptions bundle = calibration.bundle;
  bundle.effects = std::make_shared<const SharedEffects>(ArmErrors(dataset.robot->arm, ArmErrorModel::kGeometry));
  bundle.target_scale_sigma = kPrintScaleSigma;
  return MostLikelyEffects({calibration.camera, calibration.views, options.setup, options.shape}, *calibration.refined,
                           bundle, effects);
}

// Calibrates again, with the errors of the arm and the noise of its joints among what is estimated. `calibration` is
// that without them, and is kept if they cannot be estimated. `options` become those of the calibration that is kept.
void CalibrateWithArm(const std::vector<CaptureDetection>& detections, const RunOptions& run, ArmSetup* arm,
                      Dataset* dataset, CalibrationOptions* options, Calibration* calibration) {
  if (!arm->reason.empty()) return;
  const std::optional<size_t> branch = MostLikelyBranch(*dataset, *arm, *options, *calibration);
  if (!branch) {
    arm->reason = "no configuration of the arm explains the captures";
    return;
  }
  arm->branches = {arm->branches[*branch]};
  CalibrationOptions with_arm = *options;
  if (run.kinematics != Kinematics::kNone) with_arm.bundle.target_scale_sigma = kPrintScaleSigma;
  const auto errors_of = [&](ArmErrorModel model) {
    return std::make_shared<const SharedEffects>(ArmErrors(dataset->robot->arm, model));
  };
  if (run.kinematics == Kinematics::kAuto) {
    with_arm.choose.effects = {errors_of(ArmErrorModel::kOffsets), errors_of(ArmErrorModel::kGeometry)};
  } else if (run.kinematics != Kinematics::kNone) {
    with_arm.bundle.effects =
        errors_of(run.kinematics == Kinematics::kOffsets ? ArmErrorModel::kOffsets : ArmErrorModel::kGeometry);
  }
  const std::vector<std::shared_ptr<const PoseEffect>> effects = EffectsOf(*dataset, *arm, arm->branches.front());
  for (size_t i = 0; i < dataset->captures.size(); ++i) {
    Capture& capture = dataset->captures[i];
    if (run.kinematics != Kinematics::kNone) capture.effect = effects[i];
    // Servo errors are those of joints: beside the errors of an arm, white noise alone misjudges what the captures say.
    capture.gripper_by_joints =
        GripperByJoints(dataset->robot->arm, arm->branches.front().joints[i], arm->tip_from_gripper);
  }
  const std::optional<std::string> why_not = Recalibrate(ViewsOf(*dataset, detections), with_arm, options, calibration);
  if (!why_not) return;
  arm->reason = *why_not;
  for (Capture& capture : dataset->captures) {
    capture.effect = nullptr;
    capture.gripper_by_joints.resize(6, 0);
  }
}

// Calibrates again, with errors of the robot's poses that vary smoothly with the pose among what is estimated. Changes
// nothing if the captures show no error of the robot. Returns a finding if such errors are part of the calibration.
std::optional<Finding> CalibrateWithSmoothErrors(const std::vector<CaptureDetection>& detections, const RunOptions& run,
                                                 Dataset* dataset, CalibrationOptions* options,
                                                 Calibration* calibration) {
  const bool has_noise =
      calibration->refined->robot_noise && calibration->bundle.robot == BundleOptions::Robot::kEstimatedNoise;
  if (run.smooth == SmoothPoseErrors::kNone || !has_noise || calibration->bundle.robot_noise_prior) return std::nullopt;
  const RobotNoise before = *calibration->refined->robot_noise;
  const std::optional<SmoothErrors> errors =
      MostLikelySmoothErrors({calibration->camera, calibration->views, options->setup, options->shape},
                             *calibration->refined, calibration->bundle);
  if (!errors) return std::nullopt;
  CalibrationOptions with_errors = *options;
  const auto effects = std::make_shared<const SharedEffects>(errors->effects());
  if (run.smooth == SmoothPoseErrors::kAuto) {
    with_errors.choose.effects = {effects};
  } else {
    with_errors.bundle.effects = effects;
  }
  for (Capture& capture : dataset->captures) capture.effect = errors->EffectAt(capture.base_from_gripper);
  const std::optional<std::string> why_not =
      Recalibrate(ViewsOf(*dataset, detections), with_errors, options, calibration);
  const std::optional<RobotNoise> smooth = calibration->refined->smooth_noise;
  if (!why_not && smooth) {
    const RobotNoise& after = *calibration->refined->robot_noise;
    return Finding{Grade::kGood,
                   FindingCode("smooth_errors"),
                   {{"smooth_mm", 1000 * smooth->translation_m},
                    {"smooth_deg", RadToDeg(smooth->rotation_rad)},
                    {"length_mm", 1000 * errors->lengths().translation_m},
                    {"length_deg", RadToDeg(errors->lengths().rotation_rad)},
                    {"before_mm", 1000 * before.translation_m},
                    {"before_deg", RadToDeg(before.rotation_rad)},
                    {"after_mm", 1000 * after.translation_m},
                    {"after_deg", RadToDeg(after.rotation_rad)}}};
  }
  for (Capture& capture : dataset->captures) capture.effect = nullptr;
  return std::nullopt;
}

Outcome<RunOutput> RunOnImages(const Dataset& dataset_in, const RunOptions& options, RunObserver* observer) {
  RunOutput output;
  Dataset& dataset = output.dataset;
  dataset = dataset_in;
  std::vector<CaptureDetection>& detections = output.detections;

  const Stopwatch detect_watch;
  CheckCameraByHeader(dataset);
  const DetectFunction detect =
      options.detect ? options.detect
                     : [&](const std::filesystem::path& image, const std::optional<ImageSize>& expected) {
                         return DetectWithDigest(*dataset.target, image, expected);
                       };
  detections = DetectCaptures(dataset, detect, options.num_threads, observer);
  FitCameraToImages(detections.front(), &dataset);
  Timing timing;
  timing.detect_s = detect_watch.Seconds();
  const LeftOutCaptures left_out = LeaveOutSharedImages(&dataset, &detections);
  const std::vector<View> views = ViewsOf(dataset, detections);
  if (observer != nullptr) {
    observer->OnDetected(left_out, static_cast<int>(views.size()), static_cast<int>(detections.size()));
  }
  if (detections.empty()) return Failure{Join(left_out.notes, "; ")};
  if (views.empty()) return Failure{NothingDetected(dataset, detections)};

  EndIfCancelled(observer);
  const Stopwatch solve_watch;
  const CalibrationOptions calibration_options =
      OptionsOf(dataset, options, detections.front().width_px, detections.front().height_px);
  Outcome<Calibration> calibration = Calibrate(views, calibration_options);
  if (!calibration) return Failure{calibration.reason()};
  if (calibration->refined) {
    std::optional<std::vector<CaptureDetection>> again =
        DetectAgain(dataset, detections, *calibration, options.num_threads, observer);
    if (again) {
      EndIfCancelled(observer);
      Outcome<Calibration> second = Calibrate(ViewsOf(dataset, *again), calibration_options);
      if (second && second->refined && IsAtLeastAsGood(*second, *calibration)) {
        calibration = std::move(second);
        detections = std::move(*again);
      }
    }
  }
  std::optional<ArmSetup> arm;
  CalibrationOptions final_options = calibration_options;
  const bool needs_arm = options.kinematics != Kinematics::kNone || options.joint_noise;
  if (dataset.robot && needs_arm && calibration->refined) {
    EndIfCancelled(observer);
    arm = SetUpArm(dataset);
    CalibrateWithArm(detections, options, &*arm, &dataset, &final_options, &*calibration);
  }
  const bool has_arm = arm && arm->reason.empty();
  std::optional<Finding> of_smooth_errors;
  if (!has_arm && calibration->refined) {
    EndIfCancelled(observer);
    of_smooth_errors = CalibrateWithSmoothErrors(detections, options, &dataset, &final_options, &*calibration);
  }
  if (observer != nullptr) observer->OnCalibrated(*calibration);
  if (!calibration->refined) return Failure{calibration->refined.reason()};
  timing.refine_s = calibration->refined->convergence.seconds;
  timing.seed_s = solve_watch.Seconds() - timing.refine_s;
  output.calibration = std::move(*calibration);
  output.result = Assess(dataset, options, detections, output.calibration, final_options, observer);
  if (dataset.robot) AddRobot(SummariseArm(dataset, options.kinematics, arm, output.calibration), &output.result);
  if (of_smooth_errors) output.result.observations.push_back(std::move(*of_smooth_errors));
  output.result.timing = timing;
  InsertLeftOut(left_out, &output.result.captures);
  return output;
}

}  // namespace

Outcome<RunOutput> Run(const Dataset& dataset, const RunOptions& options, RunObserver* observer) {
  const Stopwatch total;
  CheckDataset(dataset);
  try {
    Outcome<RunOutput> output =
        dataset.target_poses.empty() ? RunOnImages(dataset, options, observer) : RunOnPoses(dataset, options, observer);
    if (!output) return output;
    output->result.verdict = JudgeRun(output->result);
    output->result.timing.total_s = total.Seconds();
    return output;
  } catch (const Cancelled&) {
    return Failure{kCancelled};
  }
}

CaptureDetection DetectWithDigest(const Target& target, const std::filesystem::path& image,
                                  const std::optional<ImageSize>& expected) {
  const std::string digest = DigestOfFile(image);
  CaptureDetection detection = DetectCapture(target, image, expected);
  detection.image_digest = digest;
  return detection;
}

}  // namespace heba
