#include "tools/run/pose_run.h"

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/pair_calibration.h"
#include "solvers/calibration/capture_rejection.h"
#include "solvers/calibration/time_offset.h"
#include "solvers/initial/pose_consistency.h"
#include "solvers/refine/pose_refinement.h"
#include "tools/run/arm_setup.h"
#include "tools/run/captures.h"
#include "tools/run/pair_result.h"
#include "tools/run/robot_errors.h"
#include "tools/run/time_offset.h"

namespace heba {
namespace {

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
  std::vector<PosePair> pairs;
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    View view = ViewOf(dataset, i, {});
    pairs.push_back({view.camera_mount_from_target_mount, dataset.target_poses[i], view.role, std::nullopt});
    pairs.back().joints = std::move(view.joints);
  }
  return CalibratePoses(std::move(pairs), PoseOptions(dataset, run));
}

Dataset WithoutWrong(Dataset dataset, const RunOptions& run) {
  const bool leaves_out = run.calibration.adjustment.loss != LossKind::kNone;
  return leaves_out ? WithoutWrongPoses(std::move(dataset)) : dataset;
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
    at.rest = EstimateTimeOffset(LinearisePairs(SetupOf(dataset), at.calibration.pairs, chain),
                                 Eigen::VectorXd::Zero(6), chain.covariance.matrix, VelocitiesAt(at.dataset, offset_s));
    return at;
  };
  return SettleOffset(FindTimeOffset(dataset, PosesInImages(dataset, {})), calibrate_at);
}

}  // namespace

Outcome<RunOutput> RunOnPoses(const Dataset& given, const RunOptions& run, RunObserver* observer) {
  const bool has_offset = given.stream && run.estimates_time_offset;
  PosesAtOffset at_offset;
  if (has_offset) {
    at_offset = CalibratePosesOfStream(given, run);
  } else {
    at_offset.dataset = WithoutWrong(given, run);
    at_offset.calibration = CalibrateTargetPoses(at_offset.dataset, run);
  }
  const Dataset& dataset = at_offset.dataset;
  PairCalibration& calibration = at_offset.calibration;
  if (!calibration.chain) return calibration.chain.failure();
  PoseCalibrationOptions options = PoseOptions(dataset, run);
  const bool has_arm = !dataset.arms.empty() && dataset.arms.front();
  std::optional<ArmSetup> arm;
  if (has_arm && run.kinematics != Kinematics::kNone) {
    ArmOfPairs of_pairs = SetUpArmOfPairs(dataset, run, SetUpArm(dataset, 0, run.kinematics), options, calibration);
    arm = std::move(of_pairs.arm);
    options = std::move(of_pairs.options);
    calibration = CalibratePoses(std::move(of_pairs.pairs), options);
    if (!calibration.chain) return calibration.chain.failure();
  }
  // The errors of an arm come after the poses in the covariance.
  if (at_offset.rest) {
    Eigen::VectorXd change = Eigen::VectorXd::Zero(calibration.chain->covariance.matrix.cols());
    change.head(at_offset.rest->change_of_estimate.size()) = at_offset.rest->change_of_estimate;
    calibration.chain->covariance = WithChanges(std::move(calibration.chain->covariance), {change});
  }
  if (observer != nullptr) observer->OnCalibrated(calibration);
  RunOutput output;
  output.result = AssessPoses(dataset, run, calibration, options);
  if (has_arm) {
    ArmSummaries summary = SummariseOnlyArm(dataset, run.kinematics, arm, calibration);
    output.result.arms = std::move(summary.arms);
    std::vector<Finding>& observations = output.result.observations;
    observations.insert(observations.end(), summary.findings.begin(), summary.findings.end());
  }
  if (has_offset) output.result = WithTimeOffset(std::move(output.result), at_offset.offset_s, at_offset.rest);
  output.calibration.refined = calibration.refined.failure();
  output.calibration.pairs.push_back(AsPair(std::move(calibration)));
  output.dataset = std::move(at_offset.dataset);
  return output;
}

}  // namespace heba
