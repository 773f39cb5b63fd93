#include "solvers/calibration.h"

#include <algorithm>
#include <cmath>
#include <mutex>

#include "heba/base/error.h"
#include "heba/base/parallel.h"
#include "heba/base/text.h"
#include "solvers/hand_eye_method.h"
#include "solvers/intrinsics_seed.h"
#include "solvers/pose_selection.h"
#include "solvers/target_pose.h"

namespace heba {
namespace {

constexpr int kMinPoints = 4;

// Views with a pose of their own; the others go to `unused`.
void PoseViews(const std::vector<View>& views, const Camera& camera, std::vector<View>* posed,
               std::vector<std::vector<TargetPose>>* poses, std::vector<UnusedView>* unused) {
  std::vector<double> rms;
  for (const View& view : views) {
    if (view.observations.size() < kMinPoints) {
      unused->push_back({view.name, std::to_string(view.observations.size()) + " points, 4 are needed for a pose"});
      continue;
    }
    std::vector<TargetPose> found = EstimateTargetPose(camera, view.observations);
    if (found.empty()) {
      unused->push_back({view.name, "no pose of the target explains its points"});
      continue;
    }
    rms.push_back(found.front().rms_px);
    posed->push_back(view);
    poses->push_back(std::move(found));
  }
  if (rms.size() < 3) return;
  // A view whose points do not lie on one plane, when those of the others do, was read wrongly.
  std::vector<double> sorted = rms;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2), sorted.end());
  const double median = sorted[sorted.size() / 2];
  const double limit_px = std::max(3.0, 8.0 * median);
  std::vector<View> kept_views;
  std::vector<std::vector<TargetPose>> kept_poses;
  for (size_t i = 0; i < posed->size(); ++i) {
    if (rms[i] > limit_px) {
      unused->push_back({(*posed)[i].name, "its points do not fit the target (" + Significant(rms[i], 2) +
                                               " px rms, half of the captures are below " + Significant(median, 2) +
                                               "): probably read wrongly"});
      continue;
    }
    kept_views.push_back(std::move((*posed)[i]));
    kept_poses.push_back(std::move((*poses)[i]));
  }
  *posed = std::move(kept_views);
  *poses = std::move(kept_poses);
}

// Views with too few points for a pose of their own can still refine what the others found: in the chain each point
// counts. Those that agree with the refinement join it; it stays as it was if the larger one fails.
void AddFewPointViews(const std::vector<View>& views, const CalibrationOptions& options, Calibration* calibration) {
  // A board that can be read in several orders needs a pose to say in which it was.
  if (options.symmetries.size() > 1) return;
  const Solution& solution = *calibration->refined;
  const std::optional<SquaredErrors> used = ReprojectionErrors(solution.hand_eye, solution.camera, calibration->views);
  if (!used || !used->RmsPx()) return;
  constexpr double kMaxRatio = 3;
  std::vector<View> joined = calibration->views;
  std::vector<UnusedView> unused;
  for (const UnusedView& entry : calibration->unused) {
    const auto view =
        std::find_if(views.begin(), views.end(), [&](const View& candidate) { return candidate.name == entry.name; });
    CHECK(view != views.end());
    const int num_points = view->observations.size();
    if (num_points == 0 || num_points >= kMinPoints) {
      unused.push_back(entry);
      continue;
    }
    const std::optional<SquaredErrors> errors = ViewErrors(
        solution.camera, CameraFromTarget(solution.hand_eye, view->camera_mount_from_target_mount), view->observations);
    if (errors && *errors->RmsPx() <= kMaxRatio * *used->RmsPx()) {
      joined.push_back(*view);
    } else {
      unused.push_back({entry.name, std::to_string(num_points) + " points, too few for a pose, and not where the "
                                                                 "other captures say"});
    }
  }
  if (joined.size() == calibration->views.size()) {
    calibration->unused = std::move(unused);
    return;
  }
  Outcome<Solution> refined =
      RefineHandEye({solution.camera, joined, options.setup}, solution.hand_eye, options.bundle);
  if (!refined) return;
  calibration->refined = std::move(refined);
  calibration->views = std::move(joined);
  calibration->unused = std::move(unused);
}

MethodResult RunMethod(const HandEyeMethod& method, const Calibration& calibration) {
  MethodResult result;
  result.method = method.name;
  result.hand_eye = method.solve(calibration.pairs);
  if (result.hand_eye) {
    const std::optional<SquaredErrors> errors =
        ReprojectionErrors(*result.hand_eye, calibration.camera, calibration.views);
    if (errors) result.reprojection_rms_px = errors->RmsPx();
  }
  return result;
}

const MethodResult* FindResult(const std::vector<MethodResult>& results, const std::string& name) {
  const auto found =
      std::find_if(results.begin(), results.end(), [&](const MethodResult& r) { return r.method == name; });
  return found == results.end() ? nullptr : &*found;
}

}  // namespace

Outcome<Calibration> Calibrate(const std::vector<View>& views, const CalibrationOptions& options) {
  Calibration calibration;
  calibration.camera_was_given = options.camera.has_value();
  if (options.camera) {
    calibration.camera = *options.camera;
  } else {
    Outcome<Camera> camera = EstimateIntrinsics(views, options.camera_model, options.width_px, options.height_px);
    if (!camera) return Failure{camera.reason()};
    calibration.camera = *camera;
  }
  std::vector<std::vector<TargetPose>> poses;
  PoseViews(views, calibration.camera, &calibration.views, &poses, &calibration.unused);
  const ChosenPoses chosen = ChoosePoses(calibration.camera, calibration.views, poses, options.symmetries);
  calibration.pairs = chosen.pairs;
  for (size_t i = 0; i < calibration.views.size(); ++i) {
    const Rigid3d& symmetry = options.symmetries[static_cast<size_t>(chosen.symmetry[i])];
    Points3& points = calibration.views[i].observations.points_in_target;
    points = ((symmetry.RotationMatrix() * points).colwise() + symmetry.translation).eval();
  }

  // Every method runs, if only to be a seed; those asked for are reported.
  std::vector<MethodResult> results;
  for (const HandEyeMethod& method : HandEyeMethods()) results.push_back(RunMethod(method, calibration));
  const MethodResult* seed = nullptr;
  if (options.seed == kBestSeed) {
    for (const MethodResult& result : results) {
      if (!result.reprojection_rms_px) continue;
      if (seed == nullptr || *result.reprojection_rms_px < *seed->reprojection_rms_px) seed = &result;
    }
  } else {
    seed = FindResult(results, options.seed);
    CHECK(seed != nullptr) << options.seed;
  }
  for (const std::string& name : options.methods) {
    const MethodResult* result = FindResult(results, name);
    CHECK(result != nullptr) << name;
    calibration.methods.push_back(*result);
  }
  if (seed != nullptr && seed->hand_eye) {
    calibration.seed = seed->method;
    calibration.refined =
        RefineHandEye({calibration.camera, calibration.views, options.setup}, *seed->hand_eye, options.bundle);
    if (calibration.refined) AddFewPointViews(views, options, &calibration);
    return calibration;
  }
  // The methods agree on why there is none where the motion is to blame.
  std::string reason = seed != nullptr ? seed->hand_eye.reason() : "";
  for (const MethodResult& result : results) {
    if (reason.empty()) reason = result.hand_eye.reason();
  }
  if (reason.empty()) reason = "every closed form puts the target behind the camera; check set-up and pose direction";
  calibration.refined = Failure{reason};
  return calibration;
}

std::vector<HoldOut> CrossValidate(const std::vector<View>& views, const CalibrationOptions& options, int num_folds,
                                   int num_threads, const std::function<void()>& progress) {
  std::vector<std::string> names = options.methods;
  names.emplace_back(kBundleMethod);
  CalibrationOptions fold_options = options;
  fold_options.symmetries = {Rigid3d()};
  // errors[fold][method]
  std::vector<std::vector<Outcome<SquaredErrors>>> errors(
      static_cast<size_t>(num_folds), std::vector<Outcome<SquaredErrors>>(names.size(), Failure{"not run"}));
  std::mutex mutex;
  ParallelFor(num_folds, num_threads, [&](int fold) {
    std::vector<View> training;
    std::vector<View> held_out;
    for (size_t i = 0; i < views.size(); ++i) {
      (static_cast<int>(i % static_cast<size_t>(num_folds)) == fold ? held_out : training).push_back(views[i]);
    }
    const Outcome<Calibration> calibration = Calibrate(training, fold_options);
    const auto predict = [&](const HandEye& hand_eye, const Camera& camera) -> Outcome<SquaredErrors> {
      const std::optional<SquaredErrors> predicted = ReprojectionErrors(hand_eye, camera, held_out);
      if (!predicted) return Failure{"a held-out target lies behind the camera"};
      return *predicted;
    };
    std::vector<Outcome<SquaredErrors>>& row = errors[static_cast<size_t>(fold)];
    for (size_t m = 0; m < names.size(); ++m) {
      if (!calibration) {
        row[m] = Failure{calibration.reason()};
      } else if (m + 1 < names.size()) {
        const Outcome<HandEye>& hand_eye = calibration->methods[m].hand_eye;
        row[m] = hand_eye ? predict(*hand_eye, calibration->camera) : Failure{hand_eye.reason()};
      } else {
        const Outcome<Solution>& refined = calibration->refined;
        row[m] = refined ? predict(refined->hand_eye, refined->camera) : Failure{refined.reason()};
      }
    }
    const std::lock_guard<std::mutex> lock(mutex);
    progress();
  });
  std::vector<HoldOut> results;
  for (size_t m = 0; m < names.size(); ++m) {
    HoldOut result{names[m], std::nullopt, ""};
    SquaredErrors total;
    for (int fold = 0; fold < num_folds; ++fold) {
      const Outcome<SquaredErrors>& fold_errors = errors[static_cast<size_t>(fold)][m];
      if (fold_errors) {
        total.Add(*fold_errors);
      } else if (result.reason.empty()) {
        result.reason = "fold " + std::to_string(fold + 1) + ": " + fold_errors.reason();
      }
    }
    if (result.reason.empty()) result.rms_px = total.RmsPx();
    results.push_back(std::move(result));
  }
  return results;
}

}  // namespace heba
