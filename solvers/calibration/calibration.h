// The whole estimation, from views to a refined result: camera (if none is given), target poses, closed forms, seed,
// bundle adjustment.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/data/solution.h"
#include "heba/evaluation/evaluation.h"
#include "heba/evaluation/finding.h"
#include "heba/evaluation/metrics.h"
#include "solvers/calibration/camera_choice.h"
#include "solvers/calibration/model_choice.h"
#include "solvers/initial/usable_views.h"
#include "solvers/refine/bundle_adjustment.h"

namespace heba {

// The seed that means "whichever closed form has the lowest reprojection RMS over all captures".
inline constexpr const char* kBestSeed = "best";

struct CalibrationOptions {
  std::vector<std::string> methods;  // Closed forms to report, by name; empty: all that the motion suits.
  std::string seed = kBestSeed;      // One of HandEyeMethodNames(), or kBestSeed.
  BundleOptions bundle;
  // The parts of the model that the captures choose, instead of the options above and below; by default, all.
  AutoModel choose = {true, true};
  bool choose_camera_model = false;
  Setup setup = Setup::kEyeToHand;
  std::optional<Camera> camera;  // Nothing: estimated from the views.
  // Where that begins: a camera that is nearly right. Nothing: from scratch.
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
  // Over all used views; nothing if the method failed or hides a point.
  std::optional<double> reprojection_rms_px;
};

struct Calibration {
  Camera camera;  // Given or estimated; the closed forms use it.
  bool camera_was_given = false;
  // The options that the refinement was made with: CalibrationOptions::bundle with the chosen model in it.
  BundleOptions bundle;
  std::vector<CameraAlternative> camera_alternatives;  // Empty if the camera model was given.
  std::vector<ModelAlternative> alternatives;          // The models of the errors; empty if there was one.
  // So many captures fail their test, but were kept: JudgedCaptures::num_kept_against_test.
  int num_kept_against_test = 0;
  // The views that were used, their points in the order that the chain decided on, and of each that has a pose of its
  // own, the first of them, its pair of poses. Views of fewer than four points come last: only the refinement uses
  // them.
  std::vector<View> views;
  std::vector<PosePair> pairs;
  std::vector<UnusedView> unused;
  std::vector<MethodResult> methods;
  Outcome<Solution> chain = Failure{"not run"};
  std::string seed;  // The start that led to the refined result: a method, or one of solvers/calibration/multi_start.h.
  Outcome<Solution> refined = Failure{"not run"};
};

// Captures that contradict the others (solvers/calibration/capture_rejection.h) are named in Calibration::unused and
// serve no method, unless the loss is `none`, which leaves out nothing; so are captures of which no point agrees with
// the estimate. The model of the errors is chosen on the captures and points that are left
// (solvers/calibration/model_choice.h); both are judged again under the chosen model, and a capture that it explains
// comes back. A Failure if there is no camera to be had; a refinement that failed is in Calibration::refined.
Outcome<Calibration> Calibrate(const std::vector<View>& views, const CalibrationOptions& options);

// The part of it that needs poses of the target alone (`pairs`): fills in the methods (those named, or all that the
// motion suits) and the refinement of the poses from the seed. `refined` says what it would take.
void CalibratePoses(const std::vector<std::string>& methods, const std::string& seed, Calibration* calibration);

// Returns the findings about a calibration whose refinement did not fail (solvers/calibration/diagnostics.h): the
// chosen model, how a given camera was used, what the held parts of the model hide, what is known worst. Calibrate does
// not call it: folds and trials have no use for findings.
std::vector<Finding> Advise(const Calibration& calibration, const CalibrationOptions& options);

// For each used view of a calibration whose refinement did not fail (solvers/uncertainty/influence.h).
std::vector<std::optional<CaptureMove>> MoveWithoutEachView(const Calibration& calibration,
                                                            const CalibrationOptions& options);

}  // namespace heba
