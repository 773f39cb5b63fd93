#include "heba/cross_validation.h"

#include <algorithm>
#include <cmath>
#include <mutex>

#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "heba/base/parallel.h"
#include "solvers/initial/pose_selection.h"
#include "solvers/refine/fit.h"
#include "solvers/refine/hand_eye_problem.h"
#include "solvers/refine/linearised_images.h"
#include "solvers/residuals/repeated_poses.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// The fold of a view that is never held out.
constexpr int kAlwaysTraining = -1;

// The errors that one fold adds to a method's hold-out figures.
struct HeldOutErrors {
  SquaredErrors pixels;
  double sum_m2 = 0;
  double sum_rad2 = 0;
  int num_poses = 0;
  double chi2 = 0;
  double dof = 0;
  double noise_squares = 0;  // Unit: sigmas of pixel and robot noise.
  double num_noise = 0;
  std::vector<std::pair<size_t, double>> distance_m_of_capture;
  void Add(const HeldOutErrors& other) {
    pixels.Add(other.pixels);
    sum_m2 += other.sum_m2;
    sum_rad2 += other.sum_rad2;
    num_poses += other.num_poses;
    chi2 += other.chi2;
    dof += other.dof;
    noise_squares += other.noise_squares;
    num_noise += other.num_noise;
    distance_m_of_capture.insert(distance_m_of_capture.end(), other.distance_m_of_capture.begin(),
                                 other.distance_m_of_capture.end());
  }
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

Outcome<HeldOutErrors> PredictHeldOut(const HandEye& hand_eye, const SeenViews& held_out) {
  HeldOutErrors errors;
  const std::optional<SquaredErrors> pixels = ReprojectionErrors(hand_eye, held_out.camera, held_out.views);
  if (!pixels) return Failure{"a held-out target lies behind the camera"};
  errors.pixels = *pixels;
  for (size_t i = 0; i < held_out.views.size(); ++i) {
    const View& view = held_out.views[i];
    const Rigid3d predicted = CameraFromTarget(hand_eye, view.camera_mount_from_target_mount);
    const TargetPose* const seen = NearestPose(held_out.poses[i], predicted);
    if (seen == nullptr) continue;
    // The distance is measured at the centre of the points.
    const Eigen::Vector3d middle = view.observations.points_in_target.rowwise().mean();
    const double distance_m = (predicted * middle - seen->camera_from_target * middle).norm();
    errors.sum_m2 += distance_m * distance_m;
    errors.distance_m_of_capture.emplace_back(view.capture, distance_m);
    errors.sum_rad2 += std::pow(AngleRad(predicted, seen->camera_from_target), 2);
    ++errors.num_poses;
  }
  return errors;
}

// Held-out views, linearised at an estimate, those of each robot pose in one; nothing if a point cannot be projected.
// `bundle` has what of the estimate is free.
std::optional<std::vector<LinearisedView>> LineariseHeldOut(const Solution& estimate, const BundleOptions& bundle,
                                                            heba::Setup setup, const std::vector<View>& held_out) {
  const RigSolution at = ProblemSolution(estimate);
  const RigProblem problem = WeightedAs(at, HandEyeProblem({estimate.camera, held_out, setup, estimate.shape}, bundle));
  FitState state = StateOf(at);
  state.corrections.clear();
  const std::optional<std::vector<LinearisedView>> views =
      LineariseEachCapture(problem, state, NoiseOf(at), LossOf(LossKind::kNone));
  if (!views) return std::nullopt;
  return StackGroups(*views, GroupByRobotPose(setup, held_out));
}

void AddChi2(const Solution& solution, const BundleOptions& bundle, heba::Setup setup,
             const std::vector<View>& held_out, HeldOutErrors* errors) {
  const std::optional<std::vector<LinearisedView>> views = LineariseHeldOut(solution, bundle, setup, held_out);
  if (!views) return;
  const RobotNoise robot = solution.robot_noise.value_or(RobotNoise{});
  for (const LinearisedView& view : *views) {
    const Eigen::Index rows = view.offset.size();
    const Eigen::MatrixXd covariance = MarginalCovariance(view, 1, CorrectionVariances(robot, view.by_effects.cols())) +
                                       view.by_unknowns * solution.covariance.matrix * view.by_unknowns.transpose();
    errors->chi2 += MahalanobisSquare(view.offset, covariance) + view.residual_sum_of_squares;
    errors->dof += static_cast<double>(rows + view.num_residual_dof);
  }
}

// Adds the held-out residuals of any estimate, whitened by the noise of the refinement. They are linearised at the
// estimate, with the camera that it uses.
void AddNoiseSquares(const HandEye& hand_eye, const Camera& camera, const Solution& noise, heba::Setup setup,
                     const std::vector<View>& held_out, HeldOutErrors* errors) {
  Solution at = noise;
  at.hand_eye = hand_eye;
  at.camera = camera;
  at.shared_effects = nullptr;  // A closed form knows nothing of them; the views of the refinement are corrected.
  BundleOptions held;
  held.free_intrinsics.clear();
  const std::optional<std::vector<LinearisedView>> views = LineariseHeldOut(at, held, setup, held_out);
  if (!views) return;
  const RobotNoise robot = noise.robot_noise.value_or(RobotNoise{});
  for (const LinearisedView& view : *views) {
    const Eigen::MatrixXd covariance = MarginalCovariance(view, 1, CorrectionVariances(robot, view.by_effects.cols()));
    errors->noise_squares += MahalanobisSquare(view.offset, covariance) + view.residual_sum_of_squares;
    errors->num_noise += static_cast<double>(view.offset.size() + view.num_residual_dof);
  }
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
  std::vector<std::vector<Outcome<HeldOutErrors>>> errors(
      static_cast<size_t>(num_folds), std::vector<Outcome<HeldOutErrors>>(names.size(), Failure{"not run"}));
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
    std::vector<Outcome<HeldOutErrors>>& row = errors[static_cast<size_t>(fold)];
    if (!calibration) {
      std::fill(row.begin(), row.end(), Outcome<HeldOutErrors>(Failure{calibration.reason()}));
    } else {
      const SeenViews seen(calibration->camera, held_out);
      for (size_t m = 0; m < calibration->methods.size(); ++m) {
        const Outcome<HandEye>& hand_eye = calibration->methods[m].hand_eye;
        row[m] = hand_eye ? PredictHeldOut(*hand_eye, seen) : Failure{hand_eye.reason()};
        if (row[m] && calibration->refined) {
          AddNoiseSquares(*hand_eye, calibration->camera, *calibration->refined, options.setup, held_out, &*row[m]);
        }
      }
      const Outcome<Solution>& chain = calibration->chain;
      row[names.size() - 2] = chain ? PredictHeldOut(chain->hand_eye, seen) : Failure{chain.reason()};
      const Outcome<Solution>& refined = calibration->refined;
      if (!refined) {
        row.back() = Failure{refined.reason()};
      } else {
        const std::vector<View> corrected =
            ApplyShape(CorrectedViews(options.setup, held_out, *refined), refined->shape);
        row.back() = PredictHeldOut(refined->hand_eye, SeenViews(refined->camera, corrected));
        if (row.back()) {
          AddChi2(*refined, calibration->bundle, options.setup, held_out, &*row.back());
          AddNoiseSquares(refined->hand_eye, refined->camera, *refined, options.setup, corrected, &*row.back());
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
    HeldOutErrors total;
    for (int fold = 0; fold < num_folds; ++fold) {
      const Outcome<HeldOutErrors>& fold_errors = errors[static_cast<size_t>(fold)][m];
      if (drops_failed && !errors[static_cast<size_t>(fold)].back()) continue;
      if (fold_errors) {
        total.Add(*fold_errors);
      } else if (result.reason.empty()) {
        result.reason = "fold " + std::to_string(fold + 1) + ": " + fold_errors.reason();
      }
    }
    if (result.reason.empty()) {
      result.rms_px = total.pixels.RmsPx();
      if (total.num_poses > 0) {
        result.target_m = std::sqrt(total.sum_m2 / total.num_poses);
        result.target_rad = std::sqrt(total.sum_rad2 / total.num_poses);
        result.target_m_of_capture = std::move(total.distance_m_of_capture);
      }
      if (total.dof > 0) result.chi2_per_dof = total.chi2 / total.dof;
      if (total.num_noise > 0) result.sigmas = std::sqrt(total.noise_squares / total.num_noise);
    }
    results.push_back(std::move(result));
  }
  return results;
}

}  // namespace heba
