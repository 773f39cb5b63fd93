// Runs the whole calibration, from views to a refined result: camera (if none is given), target poses, closed-form
// methods, seed, bundle adjustment.
//
//   heba::CalibrationOptions options;
//   options.setup = heba::Setup::kEyeInHand;
//   options.width_px = 1280;
//   options.height_px = 960;
//   const heba::Outcome<heba::Calibration> calibration = heba::Calibrate(views, options);
//   if (calibration && calibration->refined) Use(calibration->refined->hand_eye, calibration->refined->covariance);
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/bundle_adjustment.h"
#include "heba/data/solution.h"
#include "heba/evaluation/evaluation.h"
#include "heba/evaluation/finding.h"
#include "heba/evaluation/metrics.h"
#include "heba/robot_errors.h"

namespace heba {

// The parts of the model that are to be chosen; the others are given by the options.
struct AutoModel {
  bool robot_noise = false;
  bool target_shape = false;
  // The systematic errors of the robot among which is chosen, each containing those before it; none may be chosen, too.
  // If there are any, BundleOptions::effects is not used.
  std::vector<std::shared_ptr<const SharedEffects>> effects = {};
  // The cameras among which is chosen: initial guesses, each of another model, the smallest first. With fewer than two
  // the model of the problem's camera holds.
  std::vector<Camera> lenses = {};
};

// One of the camera models that were compared (solvers/calibration/model_choice.h).
struct CameraAlternative {
  std::string model;
  double log_likelihood = 0;  // Up to a constant common to all models.
  int dof = 0;                // Number of camera parameters.
  // The probability, if this model is right, of the gain in likelihood of a larger model: the smallest over the larger
  // models. Not set for the largest.
  std::optional<double> p;
  std::string reason = {};  // Why it was not a candidate, in one clause; empty if it was.
};

// The seed that stands for the closed form with the lowest reprojection RMS over all captures.
inline constexpr const char* kBestSeed = "best";

struct CalibrationOptions {
  std::vector<std::string> methods;  // Closed forms to report, by name; empty: all.
  std::string seed = kBestSeed;      // One of HandEyeMethodNames(), or kBestSeed.
  BundleOptions bundle;
  // The parts of the model that are chosen from the captures instead of taken from `bundle` and `camera_model`. By
  // default the parts of the error model are chosen and the camera model is not.
  AutoModel choose = {true, true};
  bool choose_camera_model = false;
  Setup setup = Setup::kEyeToHand;
  std::optional<Camera> camera;  // Estimated from the views if not given.
  // An initial guess for that estimation, close to the solution. Without it the estimation starts from a closed form.
  std::optional<Camera> camera_start;
  std::string camera_model = "brown5";
  int width_px = 0;
  int height_px = 0;
  // The target as designed (DesignedShape). A shape without a size is replaced by that of the views' points.
  TargetShape shape;
  // The motions that map the target to itself, the identity first.
  std::vector<Rigid3d> symmetries = {Rigid3d()};
};

struct MethodResult {
  std::string method;
  Outcome<HandEye> hand_eye = Failure{"not run"};
  // RMS over all used views; not set if the method failed or if a point has no image under its result.
  std::optional<double> reprojection_rms_px;
};

struct Calibration {
  Camera camera;  // Given or estimated; used by the closed forms.
  bool camera_was_given = false;
  // The options of the final refinement: CalibrationOptions::bundle with the chosen model.
  BundleOptions bundle;
  std::vector<CameraAlternative> camera_alternatives;  // Empty if the camera model was given.
  // Why the captures do not determine the camera that the options ask for, so that a smaller model was estimated or
  // intrinsics were held; empty if they do.
  std::string reduced_camera;
  std::vector<ModelAlternative> alternatives;  // The candidate error models; empty if there was only one.
  // Number of captures that fail their test, but were kept: JudgedCaptures::num_kept_against_test.
  int num_kept_against_test = 0;
  // The views that were used, with their points in the reading order that was chosen among the target's symmetries.
  // Pair i belongs to view i: the first views have a pose of their own and a pair. Views of fewer than four points
  // come last and are used by the refinement only.
  std::vector<View> views;
  std::vector<PosePair> pairs;
  std::vector<UnusedView> unused;
  std::vector<View> left_out;  // The views of `unused` that contradict the others.
  // The views that the refinement took points from, as they were before, so that another model can judge the points
  // again.
  std::vector<View> with_rejected;
  std::vector<MethodResult> methods;
  Outcome<Solution> chain = Failure{"not run"};
  std::string seed;  // The start that led to the refined result: a method, or one of solvers/calibration/multi_start.h.
  Outcome<Solution> refined = Failure{"not run"};
};

// Calibrates from views. Captures that contradict the others (solvers/calibration/capture_rejection.h) are listed in
// Calibration::unused and used by no method, unless the loss is `none`, which rejects nothing. Captures without any
// point that agrees with the estimate are listed there too. The error model is chosen on the remaining captures and
// points (solvers/calibration/model_choice.h). Points and captures are then judged again under the chosen model, and a
// capture that it explains is taken back. Returns a Failure if no camera can be estimated; the Failure of a refinement
// is in Calibration::refined.
Outcome<Calibration> Calibrate(const std::vector<View>& views, const CalibrationOptions& options);

// Errors of the robot that are searched for after a calibration without them.
struct RobotErrors {
  RigArmErrors arm;  // Its effects are those of the captures View::capture. Without models and joints: no arm is known.
  // Errors that vary smoothly with the pose, of an arm of which no others are estimated.
  SmoothPoseErrors smooth = SmoothPoseErrors::kNone;
};

struct RobotErrorsFound {
  Calibration calibration;          // The given one if there are no errors.
  CalibrationOptions options;       // The calibration was made with these.
  std::optional<RigArmChoice> arm;  // Nothing if the arm is not known.
  std::optional<RigSmoothErrors> smooth;
};

// Continues a calibration whose refinement succeeded with the search for errors of the robot
// (solvers/calibration/model_search.h). `options` are those of that calibration. The lens, the shape of the target, the
// noise of the robot and the captures that are left out are chosen again with them.
RobotErrorsFound CalibrateRobotErrors(const Calibration& before, const CalibrationOptions& options,
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

// Calibrates from poses of the target alone (`pairs`): sets `methods`, `seed`, `chain`, the refinement of the poses
// from the seed, and `alternatives`, if a model was chosen: the simplest one that is not rejected against the largest
// by their restricted likelihoods. `refined` becomes a Failure that names the missing measurements.
void CalibratePoses(const PoseCalibrationOptions& options, Calibration* calibration);

// Returns which of several possible effects of the pairs, such as those of the configurations of an arm, explains them
// best: the index of the largest restricted likelihood. Nothing if none can be fitted.
std::optional<size_t> MostLikelyPoseEffects(
    Setup setup, const std::vector<PosePair>& pairs, const HandEye& start,
    const std::shared_ptr<const SharedEffects>& effects,
    const std::vector<std::vector<std::shared_ptr<const PoseEffect>>>& effects_of_pairs);

// Adds to a covariance what wrong held parts do to the estimate: the square of each change, as of an error whose sign
// is not known. Captures share such an error, so that more of them do not reduce it.
void AddChanges(const std::vector<Eigen::VectorXd>& changes, Covariance* covariance);

struct Advice {
  std::vector<Finding> findings;
  // Each change is that of the estimate, in the layout of its covariance, if held parts that contradict the captures
  // were free (AddChanges).
  std::vector<Eigen::VectorXd> changes;
};

// Returns the findings about a calibration whose refinement succeeded (solvers/calibration/diagnostics.h): the chosen
// model, how a given camera was used, the errors that its fixed parts hide, and which part of the result has the
// largest uncertainty. Calibrate does not call it, because cross-validation folds and study trials need no findings.
Advice Advise(const Calibration& calibration, const CalibrationOptions& options);

// Returns the influence of each used view on a calibration whose refinement succeeded
// (solvers/calibration/influence.h).
std::vector<std::optional<CaptureMove>> MoveWithoutEachView(const Calibration& calibration,
                                                            const CalibrationOptions& options);

}  // namespace heba
