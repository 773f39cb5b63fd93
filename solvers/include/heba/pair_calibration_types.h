// The options of the calibration of one camera, one target and one arm, and what comes out.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "heba/adjustment_options.h"
#include "heba/base/error.h"
#include "heba/data/pair_solution.h"
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
  Failure reason = {};  // Why it was not a candidate; empty if it was.
};

// The seed that stands for the closed form with the lowest reprojection RMS over all captures.
inline constexpr const char* kBestSeed = "best";

struct PairCalibrationOptions {
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
  // Whether smooth errors that the captures show beside those of an arm are part of the covariance (Advise).
  bool has_smooth_remainder = true;
};

struct MethodResult {
  std::string method;
  Outcome<HandEye> hand_eye = {};
  // RMS over all used views; not set if the method failed or if a point has no image under its result.
  std::optional<double> reprojection_rms_px;
};

struct PairCalibration {
  Camera camera;  // Given or estimated; used by the closed forms.
  bool camera_was_given = false;
  // The options of the final refinement: PairCalibrationOptions::bundle with the chosen model.
  BundleOptions bundle;
  std::vector<CameraAlternative> camera_alternatives;  // Empty if the camera model was given.
  // Why the captures do not determine the camera that the options ask for, so that a smaller model was estimated or
  // intrinsics were held; empty if they do.
  Failure reduced_camera;
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
  Outcome<PairSolution> chain = {};
  std::string seed;  // The start that led to the refined result: a method, or one of solvers/calibration/multi_start.h.
  Outcome<PairSolution> refined = {};
};

struct Advice {
  std::vector<Finding> findings;
  // Each change is that of the estimate, in the layout of its covariance, if held parts that contradict the captures
  // were free (WithChanges).
  std::vector<Eigen::VectorXd> changes;
};

}  // namespace heba
