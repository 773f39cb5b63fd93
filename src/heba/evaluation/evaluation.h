// The parts of a result: the accuracy of every method, on the captures that it was given and on held-out captures, the
// models that were compared, and the arms.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "heba/data/pair_solution.h"
#include "heba/evaluation/finding.h"
#include "heba/evaluation/metrics.h"
#include "heba/evaluation/requirement.h"
#include "heba/robot/arm.h"
#include "heba/robot/rigid_equivalent.h"

namespace heba {

// The error figures of one estimate. Figures that do not exist are empty.
struct Errors {
  std::optional<double> reprojection_rms_px;
  std::optional<double> holdout_rms_px;
  // Difference between the predicted pose of the target and its pose estimated from the image alone, root mean square
  // over the held-out captures.
  std::optional<double> holdout_target_mm;
  std::optional<double> holdout_target_deg;
  // Likewise of the captures that the estimate left out because they contradict the others. They are not part of the
  // held-out ones.
  std::optional<double> left_out_rms_px = {};
  std::optional<double> left_out_target_mm = {};
  // For refinements: held-out chi-square per degree of freedom, in the metric of all modelled noise.
  std::optional<double> holdout_chi2;
  // Held-out residuals in sigmas of the refinement's noise (pixels and robot), root mean square. All methods are
  // compared on the same captures with the same sigmas.
  std::optional<double> holdout_sigmas;
  // The probability that an estimate that is no better than the refined one predicts the target in the held-out
  // captures so much better: Student's paired test of the logarithms of the distances. Not written to files.
  std::optional<double> holdout_better_p;
  std::optional<double> axxb_mean_mm;
  std::optional<BoardScatter> board_scatter;
  std::optional<TruthErrors> truth;
};

// Names of the refinements: `chain` minimises the errors of the captures' poses (solvers/refine/pose_refinement.h),
// `bundle` the reprojection error.
inline constexpr const char* kChainMethod = "chain";
inline constexpr const char* kBundleMethod = "bundle";

enum class EstimateKind { kClosedForm, kRefined };
inline constexpr std::array<std::string_view, 2> kEstimateKindNames = {"closed_form", "refined"};
inline std::string_view EstimateKindName(EstimateKind kind) { return kEstimateKindNames[static_cast<size_t>(kind)]; }

// The estimate of one method.
struct Estimate {
  std::string method;
  EstimateKind kind = EstimateKind::kClosedForm;
  bool ok = false;
  Failure reason;    // Set if not ok.
  HandEye hand_eye;  // Meaningful if ok.
  Camera camera;
  Errors errors;
  std::optional<PairSolution> solution;  // Set for refinements.
};

struct Timing {
  double detect_s = 0;
  double seed_s = 0;
  double refine_s = 0;
  double total_s = 0;
};

// The effect of the refined calibration on a grasp, evaluated for the target at the capture of median distance.
struct WorkingPoint {
  Eigen::Vector3d in_camera_m = Eigen::Vector3d::Zero();  // Middle of the target.
  // Covariance of the position of a target that is seen there, by the calibration alone, along the camera's axes: in
  // the frame of the camera's mount or, if the errors of the arm that carries the camera are estimated, in the base.
  // The errors of the hand-eye pose, of the intrinsics and of the arm are correlated and partly cancel
  // (heba/target_location.h).
  Eigen::Matrix3d covariance_m2 = Eigen::Matrix3d::Zero();
};

// One of the error models, or of the lenses, that were compared (solvers/calibration/model_choice.h).
struct ModelEntry {
  std::string name;
  double log_likelihood = 0;
  int dof = 0;
  std::optional<double> p;
  std::optional<double> odds = {};  // ModelAlternative::odds.
  Failure reason = {};              // Why it was not a candidate; empty if it was.
};

// The error model that the refinement uses.
struct ModelSummary {
  std::string robot_noise;                // One of none, estimated, given.
  std::vector<std::string> target_shape;  // Freed groups: scale, bend.
  std::string camera;                     // Name of the camera model.
  std::vector<ModelEntry> alternatives;   // Empty if there was no choice to make.
};

// The kinematics of the arm, as far as they were estimated.
struct RobotSummary {
  Arm nominal;
  Rigid3d tip_from_gripper;
  bool has_recorded_joints = false;
  std::string configuration;  // The one of all captures; empty if there are several.
  bool is_estimated = false;
  std::string errors_name;                          // SharedEffects::name of the estimated errors.
  Failure reason;                                   // The reason why they were not estimated.
  Eigen::VectorXd errors;                           // One per parameter (ArmParamPlace); zero if not estimated.
  std::vector<std::optional<double>> error_sigmas;  // One for each; nothing if the parameter was held.
  // The errors of a geometry that stands for these, if the joints yield; results of earlier versions have none.
  std::optional<RigidEquivalent> rigid;
  // Parameters that nothing distinguishes from something else, and what this is.
  std::vector<std::pair<std::string, std::string>> undetermined;
  // The robot's noise without and with the estimated kinematics, if it was estimated.
  std::optional<RobotNoise> noise_before;
  std::optional<RobotNoise> noise_after;
};

// The deviation of one point of a target from the shape that was estimated.
struct PointDeviation {
  size_t target = 0;
  int id = 0;
  Eigen::Vector3d designed_m = Eigen::Vector3d::Zero();   // In the target.
  Eigen::Vector3d deviation_m = Eigen::Vector3d::Zero();  // By the residuals of all images.
  // The probability of such residuals if the point has no deviation, for all points that were tested.
  double p_value = 1;
};

using FigureOf = std::optional<double> (*)(const Errors&);
inline std::optional<double> HoldOutPx(const Errors& errors) { return errors.holdout_rms_px; }
inline std::optional<double> HoldOutMm(const Errors& errors) { return errors.holdout_target_mm; }
inline std::optional<double> HoldOutSigmas(const Errors& errors) { return errors.holdout_sigmas; }

}  // namespace heba
