#include "heba/cross_validation.h"

#include <algorithm>
#include <cmath>
#include <mutex>

#include "heba/base/error.h"
#include "heba/base/failure_code.h"
#include "heba/base/parallel.h"
#include "solvers/calibration/held_out.h"
#include "solvers/refine/hand_eye_problem.h"
#include "solvers/residuals/repeated_poses.h"

namespace heba {
namespace {

// The fold of a view that is never held out.
constexpr int kAlwaysTraining = -1;

// Each fold adds this to the hold-out figures of a method.
struct FoldErrors {
  HeldOutErrors errors;
  WhitenedSquares chi2;   // By all sources of error.
  WhitenedSquares noise;  // By the noise of the refinement alone.
};

// Held-out views, with the poses that a camera sees in them.
struct SeenViews {
  const Camera& camera;
  std::vector<View> views;
  std::vector<std::vector<TargetPose>> poses;  // Candidate poses of each view, from that view alone.

  SeenViews(const Camera& by_camera, std::vector<View> held_out) : camera(by_camera), views(std::move(held_out)) {
    for (const View& view : views) poses.push_back(EstimateTargetPose(camera, view.observations));
  }
};

Outcome<FoldErrors> PredictHeldOut(const HandEye& hand_eye, const SeenViews& held_out) {
  FoldErrors fold;
  for (size_t i = 0; i < held_out.views.size(); ++i) {
    const View& view = held_out.views[i];
    AddImage(held_out.camera, CameraFromTarget(hand_eye, view.camera_mount_from_target_mount), view.observations,
             held_out.poses[i], view.capture, &fold.errors);
  }
  if (fold.errors.has_hidden) return Failure{FailureCode("hidden_held_out")};
  return fold;
}

// Returns the squares of held-out views at an estimate; `bundle` has what of it is free.
WhitenedSquares SquaresOfViews(const Solution& estimate, const BundleOptions& bundle, heba::Setup setup,
                               const std::vector<View>& held_out, bool has_covariance) {
  return SquaresOf(HandEyeProblem({estimate.camera, held_out, setup, estimate.shape}, bundle),
                   ProblemSolution(estimate), has_covariance);
}

// Returns the squares at any estimate by the noise of the refinement. They are linearised at the estimate, with the
// camera that it uses.
WhitenedSquares NoiseSquares(const HandEye& hand_eye, const Camera& camera, const Solution& noise, heba::Setup setup,
                             const std::vector<View>& held_out) {
  Solution at = noise;
  at.hand_eye = hand_eye;
  at.camera = camera;
  at.shared_effects = nullptr;  // A closed form knows nothing of them; the views of the refinement are corrected.
  BundleOptions held;
  held.free_intrinsics.clear();
  return SquaresOfViews(at, held, setup, held_out, false);
}

}  // namespace

std::vector<HoldOut> CrossValidate(const Calibration& full, const CalibrationOptions& options, int num_folds,
                                   int num_threads, const std::function<void()>& progress) {
  CHECK(!options.methods.empty());
  std::vector<std::string> names = options.methods;
  names.emplace_back(kChainMethod);
  names.emplace_back(kBundleMethod);
  CalibrationOptions fold_options = options;
  fold_options.symmetries = {Rigid3d()};
  // Folds use the model that was chosen from all captures.
  fold_options.choose = {};
  fold_options.choose_camera_model = false;
  fold_options.bundle = full.bundle;
  fold_options.bundle.num_threads = options.bundle.num_threads;
  fold_options.camera_model = full.camera.model;
  if (!options.camera) fold_options.camera_start = full.camera;
  std::vector<std::vector<Outcome<FoldErrors>>> errors(static_cast<size_t>(num_folds),
                                                       std::vector<Outcome<FoldErrors>>(names.size()));
  // Captures at the same robot pose are held out together, because they share its error.
  std::vector<int> fold_of(full.views.size(), kAlwaysTraining);
  int num_held_out = 0;
  for (const std::vector<size_t>& group : GroupByRobotPose(options.setup, full.views)) {
    // The two-step method needs these captures, so every fold is trained on them.
    const bool is_needed = std::any_of(group.begin(), group.end(), [&](size_t i) {
      const CaptureRole role = full.views[i].role;
      return role == CaptureRole::kHome || role == CaptureRole::kTranslateX || role == CaptureRole::kTranslateY;
    });
    if (is_needed) continue;
    for (const size_t i : group) fold_of[i] = num_held_out % num_folds;
    ++num_held_out;
  }
  std::mutex mutex;
  ParallelFor(num_folds, num_threads, [&](int fold) {
    std::vector<View> training;
    std::vector<View> held_out;
    for (size_t i = 0; i < full.views.size(); ++i) {
      (fold_of[i] == fold ? held_out : training).push_back(full.views[i]);
    }
    const Outcome<Calibration> calibration = Calibrate(training, fold_options);
    std::vector<Outcome<FoldErrors>>& row = errors[static_cast<size_t>(fold)];
    if (!calibration) {
      std::fill(row.begin(), row.end(), Outcome<FoldErrors>(calibration.failure()));
    } else {
      const SeenViews seen(calibration->camera, held_out);
      for (size_t m = 0; m < calibration->methods.size(); ++m) {
        const Outcome<HandEye>& hand_eye = calibration->methods[m].hand_eye;
        row[m] = hand_eye ? PredictHeldOut(*hand_eye, seen) : hand_eye.failure();
        if (row[m] && calibration->refined) {
          row[m]->noise = NoiseSquares(*hand_eye, calibration->camera, *calibration->refined, options.setup, held_out);
        }
      }
      const Outcome<Solution>& chain = calibration->chain;
      row[names.size() - 2] = chain ? PredictHeldOut(chain->hand_eye, seen) : chain.failure();
      const Outcome<Solution>& refined = calibration->refined;
      if (!refined) {
        row.back() = refined.failure();
      } else {
        const std::vector<View> corrected =
            ApplyShape(CorrectedViews(options.setup, held_out, *refined), refined->shape);
        row.back() = PredictHeldOut(refined->hand_eye, SeenViews(refined->camera, corrected));
        if (row.back()) {
          row.back()->chi2 = SquaresOfViews(*refined, calibration->bundle, options.setup, held_out, true);
          row.back()->noise = NoiseSquares(refined->hand_eye, refined->camera, *refined, options.setup, corrected);
        }
      }
    }
    const std::lock_guard<std::mutex> lock(mutex);
    progress();
  });
  // A few folds that the refinement cannot fit leave the hold-out to the others, for all methods alike.
  const auto num_failed =
      std::count_if(errors.begin(), errors.end(), [](const auto& of_fold) { return !of_fold.back(); });
  const bool drops_failed = 2 * num_failed < num_folds;
  std::vector<HoldOut> results;
  for (size_t m = 0; m < names.size(); ++m) {
    HoldOut result;
    result.method = names[m];
    FoldErrors total;
    for (int fold = 0; fold < num_folds; ++fold) {
      const Outcome<FoldErrors>& of_fold = errors[static_cast<size_t>(fold)][m];
      if (drops_failed && !errors[static_cast<size_t>(fold)].back()) continue;
      if (of_fold) {
        total.errors.Add(of_fold->errors);
        total.chi2.Add(of_fold->chi2);
        total.noise.Add(of_fold->noise);
      } else if (result.reason.empty()) {
        result.reason = {FailureCode("of_fold"), {{"fold", fold + 1}}, {}, {of_fold.failure()}};
      }
    }
    if (result.reason.empty()) {
      result.rms_px = total.errors.pixels.RmsPx();
      result.target_m = total.errors.RmsDistanceM();
      result.target_rad = total.errors.RmsAngleRad();
      result.target_m_of_capture = std::move(total.errors.distance_m_of_capture);
      result.chi2_per_dof = total.chi2.Mean();
      if (const std::optional<double> squares = total.noise.Mean()) result.sigmas = std::sqrt(*squares);
    }
    results.push_back(std::move(result));
  }
  return results;
}

}  // namespace heba
