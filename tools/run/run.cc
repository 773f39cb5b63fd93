#include "heba/run.h"

#include <algorithm>

#include "heba/base/stopwatch.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/evaluation/verdict.h"
#include "heba/robot/arm_errors.h"
#include "solvers/calibration/model_choice.h"
#include "tools/run/arm_assessment.h"
#include "tools/run/arm_setup.h"
#include "tools/run/assessment.h"
#include "tools/run/captures.h"
#include "tools/run/digest.h"
#include "tools/run/duplicate_images.h"
#include "tools/run/robot_errors.h"
#include "tools/run/second_detection.h"

namespace heba {
namespace {

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
void AddRobot(const Dataset& dataset, const std::optional<ArmSetup>& setup, RobotSummary robot,
              const Calibration& calibration, RunResult* result) {
  for (Finding& finding : FindingsOf(robot, dataset, calibration)) result->observations.push_back(std::move(finding));
  if (setup) {
    std::optional<Finding> singular = FindSingularCaptures(dataset, *setup, robot.is_estimated);
    if (singular) result->observations.push_back(std::move(*singular));
  }
  result->robot = std::move(robot);
}

// Calibrates from poses of the target that others estimated, with the evaluation that is possible without images.
Outcome<RunOutput> RunOnPoses(const Dataset& dataset, const RunOptions& run, RunObserver* observer) {
  RunOutput output;
  output.dataset = dataset;
  Calibration& calibration = output.calibration;
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
  if (!calibration.chain) return Failure{calibration.chain.reason()};
  std::optional<ArmSetup> arm;
  if (dataset.robot && run.kinematics != Kinematics::kNone) {
    arm = SetUpArm(dataset);
    options.has_robot_noise = true;
    SetEffectsOfPairs(dataset, run, &*arm, &options, &calibration);
    CalibratePoses(options, &calibration);
    if (!calibration.chain) return Failure{calibration.chain.reason()};
  }
  if (observer != nullptr) observer->OnCalibrated(calibration);
  output.result = AssessPoses(dataset, run, calibration, options);
  if (dataset.robot) {
    AddRobot(dataset, arm, SummariseArm(dataset, run.kinematics, arm, calibration), calibration, &output.result);
  }
  return output;
}

// Returns the reason why the target was detected in no image.
std::string NothingDetected(const Dataset& dataset, const std::vector<CaptureDetection>& detections) {
  const std::string first = detections.front().detection.reason;
  return "the target was not detected in any of the " + std::to_string(detections.size()) + " images" +
         (first.empty() ? "" : " (" + dataset.captures[0].name + ": " + first + ")") +
         "; is it the target that the config names?";
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
    CalibrateWithArm(options, &*arm, &dataset, &final_options, &*calibration);
  }
  const bool has_arm = arm && arm->reason.empty();
  std::optional<Finding> of_smooth_errors;
  if (!has_arm && calibration->refined) {
    EndIfCancelled(observer);
    of_smooth_errors = CalibrateWithSmoothErrors(options, &dataset, &final_options, &*calibration);
  }
  if (observer != nullptr) observer->OnCalibrated(*calibration);
  if (!calibration->refined) return Failure{calibration->refined.reason()};
  timing.refine_s = calibration->refined->convergence.seconds;
  timing.seed_s = solve_watch.Seconds() - timing.refine_s;
  output.calibration = std::move(*calibration);
  output.result = Assess(dataset, options, detections, output.calibration, final_options, observer);
  if (dataset.robot) {
    AddRobot(dataset, arm, SummariseArm(dataset, options.kinematics, arm, output.calibration), output.calibration,
             &output.result);
  }
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
