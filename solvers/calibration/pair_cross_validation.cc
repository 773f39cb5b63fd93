#include "heba/pair_cross_validation.h"

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
  SumOfSquares chi2;   // By all sources of error.
  SumOfSquares noise;  // By the noise of the refinement alone.
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
    fold.errors.AddImage(held_out.camera, CameraFromTarget(hand_eye, view.camera_mount_from_target_mount),
                         view.observations, held_out.poses[i], view.capture);
  }
  if (fold.errors.has_hidden) return Failure{FailureCode("hidden_held_out")};
  return fold;
}

// Returns the squares of held-out views at an estimate; `bundle` has what of it is free.
SumOfSquares SquaresOfViews(const PairSolution& estimate, const BundleOptions& bundle, heba::Setup setup,
                            const std::vector<View>& held_out, bool has_covariance) {
  return SquaresOf(HandEyeProblem({estimate.camera, held_out, setup, estimate.shape}, bundle),
                   ProblemSolution(estimate), has_covariance);
}

// Returns the squares at any estimate by the noise of the refinement. They are linearised at the estimate, with the
// camera that it uses.
SumOfSquares NoiseSquares(const HandEye& hand_eye, const Camera& camera, const PairSolution& noise, heba::Setup setup,
                          const std::vector<View>& held_out) {
  PairSolution at = noise;
  at.hand_eye = hand_eye;
  at.camera = camera;
  at.shared_effects = nullptr;  // A closed form knows nothing of them; the views of the refinement are corrected.
  BundleOptions held;
  held.free_intrinsics.clear();
  return SquaresOfViews(at, held, setup, held_out, false);
}

// Returns the fold that holds out each view.
std::vector<int> FoldsOf(heba::Setup setup, const std::vector<View>& views, int num_folds) {
  // Captures at the same robot pose are held out together, because they share its error.
  std::vector<int> fold_of(views.size(), kAlwaysTraining);
  int num_held_out = 0;
  for (const std::vector<size_t>& group : GroupByRobotPose(setup, views)) {
    // The two-step method needs these captures, so every fold is trained on them.
    const bool is_needed = std::any_of(group.begin(), group.end(), [&](size_t i) {
      const CaptureRole role = views[i].role;
      return role == CaptureRole::kHome || role == CaptureRole::kTranslateX || role == CaptureRole::kTranslateY;
    });
    if (is_needed) continue;
    for (const size_t i : group) fold_of[i] = num_held_out % num_folds;
    ++num_held_out;
  }
  return fold_of;
}

// Returns the errors of the refinement, which corrects held-out views by the errors that captures share.
Outcome<FoldErrors> PredictByRefinement(const PairCalibration& calibration, heba::Setup setup,
                                        const std::vector<View>& held_out) {
  const Outcome<PairSolution>& refined = calibration.refined;
  if (!refined) return refined.failure();
  const std::vector<View> corrected = ApplyShape(CorrectedViews(setup, held_out, *refined), refined->shape);
  Outcome<FoldErrors> errors = PredictHeldOut(refined->hand_eye, SeenViews(refined->camera, corrected));
  if (errors) {
    errors->chi2 = SquaresOfViews(*refined, calibration.bundle, setup, held_out, true);
    errors->noise = NoiseSquares(refined->hand_eye, refined->camera, *refined, setup, corrected);
  }
  return errors;
}

// Returns the errors on held-out views of all methods, the chain and the refinement, in this order, from a calibration
// of the others.
std::vector<Outcome<FoldErrors>> PredictFold(const PairCalibration& full, const std::vector<View>& training,
                                             const std::vector<View>& held_out, const PairCalibrationOptions& options) {
  const Outcome<PairCalibration> calibration = CalibratePart(full, training, options);
  std::vector<Outcome<FoldErrors>> row(options.methods.size() + 2);
  if (!calibration) {
    std::fill(row.begin(), row.end(), Outcome<FoldErrors>(calibration.failure()));
    return row;
  }
  const SeenViews seen(calibration->camera, held_out);
  for (size_t m = 0; m < calibration->methods.size(); ++m) {
    const Outcome<HandEye>& hand_eye = calibration->methods[m].hand_eye;
    row[m] = hand_eye ? PredictHeldOut(*hand_eye, seen) : hand_eye.failure();
    if (row[m] && calibration->refined) {
      row[m]->noise = NoiseSquares(*hand_eye, calibration->camera, *calibration->refined, options.setup, held_out);
    }
  }
  const Outcome<PairSolution>& chain = calibration->chain;
  row[row.size() - 2] = chain ? PredictHeldOut(chain->hand_eye, seen) : chain.failure();
  row.back() = PredictByRefinement(*calibration, options.setup, held_out);
  return row;
}

// Returns the hold-out of a method, the m-th in each of the `folds`. Folds on which the refinement failed are left out
// if `drops_failed`.
HoldOut SumOfFolds(const std::string& name, const std::vector<std::vector<Outcome<FoldErrors>>>& folds, size_t m,
                   bool drops_failed) {
  HoldOut result;
  result.method = name;
  FoldErrors total;
  for (size_t fold = 0; fold < folds.size(); ++fold) {
    const Outcome<FoldErrors>& of_fold = folds[fold][m];
    if (drops_failed && !folds[fold].back()) continue;
    if (of_fold) {
      total.errors.Add(of_fold->errors);
      total.chi2.Add(of_fold->chi2);
      total.noise.Add(of_fold->noise);
    } else if (result.reason.empty()) {
      result.reason = {FailureCode("of_fold"), {{"fold", static_cast<int>(fold) + 1}}, {}, {of_fold.failure()}};
    }
  }
  if (!result.reason.empty()) return result;
  result.rms_px = total.errors.pixels.RmsPx();
  result.target_m = total.errors.RmsDistanceM();
  result.target_rad = total.errors.RmsAngleRad();
  result.target_m_of_capture = std::move(total.errors.distance_m_of_capture);
  result.chi2_per_dof = total.chi2.Mean();
  if (const std::optional<double> squares = total.noise.Mean()) result.sigmas = std::sqrt(*squares);
  return result;
}

}  // namespace

std::vector<HoldOut> CrossValidate(const PairCalibration& full, const PairCalibrationOptions& options, int num_folds,
                                   int num_threads, const std::function<void()>& progress) {
  CHECK(!options.methods.empty());
  const std::vector<int> fold_of = FoldsOf(options.setup, full.views, num_folds);
  std::vector<std::vector<Outcome<FoldErrors>>> folds(static_cast<size_t>(num_folds));
  std::mutex mutex;
  ParallelFor(num_folds, num_threads, [&](int fold) {
    std::vector<View> training;
    std::vector<View> held_out;
    for (size_t i = 0; i < full.views.size(); ++i) {
      (fold_of[i] == fold ? held_out : training).push_back(full.views[i]);
    }
    folds[static_cast<size_t>(fold)] = PredictFold(full, training, held_out, options);
    const std::lock_guard<std::mutex> lock(mutex);
    progress();
  });
  // A few folds that the refinement cannot fit leave the hold-out to the others, for all methods alike.
  const auto num_failed =
      std::count_if(folds.begin(), folds.end(), [](const auto& of_fold) { return !of_fold.back(); });
  const bool drops_failed = 2 * num_failed < num_folds;
  std::vector<std::string> names = options.methods;
  names.emplace_back(kChainMethod);
  names.emplace_back(kBundleMethod);
  std::vector<HoldOut> results;
  for (size_t m = 0; m < names.size(); ++m) results.push_back(SumOfFolds(names[m], folds, m, drops_failed));
  return results;
}

}  // namespace heba
