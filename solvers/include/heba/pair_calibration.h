// Runs the whole calibration of one camera, one target and one arm, from views to a refined result: camera (if none is
// given), target poses, closed-form methods, seed, bundle adjustment.
//
//   heba::PairCalibrationOptions options;
//   options.setup = heba::Setup::kEyeInHand;
//   options.width_px = 1280;
//   options.height_px = 960;
//   const heba::Outcome<heba::PairCalibration> calibration = heba::CalibratePair(views, options);
//   if (calibration && calibration->refined) Use(calibration->refined->hand_eye, calibration->refined->covariance);
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/pair_calibration_types.h"
#include "heba/robot_errors.h"

namespace heba {

// Calibrates from views. Captures that contradict the others (solvers/calibration/capture_rejection.h) are listed in
// PairCalibration::unused and used by no method, unless the loss is `none`, which rejects nothing. Captures without any
// point that agrees with the estimate are listed there too. The error model is chosen on the remaining captures and
// points (solvers/calibration/model_choice.h). Points and captures are then judged again under the chosen model, and a
// capture that it explains is taken back. Returns a Failure if no camera can be estimated; the Failure of a refinement
// is in PairCalibration::refined.
Outcome<PairCalibration> CalibratePair(const std::vector<View>& views, const PairCalibrationOptions& options);

// Calibrates from some of the views that a calibration used (PairCalibration::views), with the model and the intrinsics
// that it chose and the points that it used; its estimate is where the refinement starts. No capture is judged again.
// The closed forms know nothing of that calibration but the camera from which the intrinsics, if they are not given,
// are estimated. Returns a Failure if the camera cannot be estimated; the Failure of the refinement is in
// PairCalibration::refined.
Outcome<PairCalibration> CalibratePart(const PairCalibration& full, const std::vector<View>& part,
                                       const PairCalibrationOptions& options);

// Errors of the robot that are searched for after a calibration without them.
struct RobotErrors {
  ArmErrorModels
      arm;  // Its effects are those of the captures View::capture. Without models and joints: no arm is known.
  // Errors that vary smoothly with the pose, of an arm of which no others are estimated.
  SmoothPoseErrors smooth = SmoothPoseErrors::kNone;
  double robot_scale_sigma = kRobotScaleSigma;  // CalibrationOptions::robot_scale_sigma.
};

struct RobotErrorsFound {
  PairCalibration calibration;        // The given one if there are no errors.
  PairCalibrationOptions options;     // The calibration was made with these.
  std::optional<ArmErrorChoice> arm;  // Nothing if the arm is not known.
  std::optional<AddedSmoothErrors> smooth;
};

// Continues a calibration whose refinement succeeded with the search for errors of the robot
// (solvers/calibration/model_search.h). `options` are those of that calibration. The lens, the shape of the target and
// the noise of the robot are chosen again with errors of an arm, and the captures that are left out with smooth ones,
// too.
RobotErrorsFound CalibrateRobotErrors(const PairCalibration& before, const PairCalibrationOptions& options,
                                      const RobotErrors& errors);

struct PoseCalibrationOptions {
  std::vector<std::string> methods;  // Closed forms to report, by name; empty: all.
  std::string seed = kBestSeed;      // One of HandEyeMethodNames(), or kBestSeed: the smallest scatter of the target.
  Setup setup = Setup::kEyeToHand;
  // Whether the noise of the robot's poses is estimated. Otherwise the robot is exact, and the errors of the poses of
  // the target are the only ones.
  bool has_robot_noise = false;
  // The systematic errors of the robot among which is chosen, each containing those before it; needs `has_robot_noise`.
  std::vector<std::shared_ptr<const SharedEffects>> effects;
  bool must_have_effects = false;  // Whether the last of `effects` is estimated without a choice.
};

// Calibrates from poses of the target alone. Returns a calibration with these pairs, `methods`, `seed`, `chain`, the
// refinement of the poses from the seed, and `alternatives`, if a model was chosen: the simplest one that is not
// rejected against the largest by their restricted likelihoods. `refined` is a Failure that names the missing
// measurements.
PairCalibration CalibratePoses(std::vector<PosePair> pairs, const PoseCalibrationOptions& options);

// Returns the configuration of an arm in each pair, an index into ArmErrorModels::effects_of_captures: one for all, or
// one for each pair (solvers/calibration/posture_choice.h), of the largest restricted likelihood
// times prior. Each pair must have an effect in one of them. Nothing if no choice can be fitted.
std::optional<std::vector<size_t>> MostLikelyBranchesOfPairs(Setup setup, const std::vector<PosePair>& pairs,
                                                             const HandEye& start, const ArmErrorModels& arm);

// Returns a covariance with what wrong held parts do to the estimate: the square of each change, as of an error whose
// sign is not known. Captures share such an error, so that more of them do not reduce it.
Covariance WithChanges(Covariance covariance, const std::vector<Eigen::VectorXd>& changes);

// Returns the findings about a calibration whose refinement succeeded (solvers/calibration/diagnostics.h): the chosen
// model, how a given camera was used, the errors that its fixed parts hide, and which part of the result has the
// largest uncertainty. CalibratePair does not call it, because cross-validation folds and study trials need no
// findings.
Advice Advise(const PairCalibration& calibration, const PairCalibrationOptions& options);

}  // namespace heba
