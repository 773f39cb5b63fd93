#include "solvers/initial/intrinsics.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <ceres/solver.h>
#include <Eigen/LU>

#include "heba/base/factorisation.h"
#include "heba/base/failure_code.h"
#include "heba/base/median.h"
#include "heba/evaluation/metrics.h"
#include "heba/geometry/homography.h"
#include "heba/geometry/pose_block.h"
#include "solvers/initial/target_pose.h"
#include "solvers/refine/captures_cost.h"
#include "solvers/refine/reprojection_problem.h"
#include "solvers/residuals/noise_scale.h"

namespace heba {
namespace {

// A camera without focal length and principal point, at which the estimation starts.
struct InitialLens {
  std::string model;
  int width_px;
  int height_px;
  std::vector<double> distortion;
};

// Returns the camera that near its optical axis images as a pinhole camera with these parameters does.
Camera MakeCamera(const InitialLens& lens, double fx, double fy, double cx, double cy) {
  Camera camera{lens.model, lens.width_px, lens.height_px, {fx, fy, cx, cy}};
  camera.params.insert(camera.params.end(), lens.distortion.begin(), lens.distortion.end());
  const double magnification = AxialFocalLength(camera, 0) / fx;
  camera.params[0] = fx / magnification;
  camera.params[1] = fy / magnification;
  return camera;
}

// Solves Zhang's linear equations h_1^T B h_2 = 0, h_1^T B h_1 = h_2^T B h_2 for B = K^-T K^-1 without skew, on
// pixels relative to the image centre and divided by half the image width. With `centred` the principal point is held
// at the image centre.
std::optional<Camera> ZhangClosedForm(const std::vector<Eigen::Matrix3d>& homographies, const InitialLens& lens,
                                      bool centred) {
  const double scale = 0.5 * lens.width_px;
  const double centre_x = 0.5 * (lens.width_px - 1);
  const double centre_y = 0.5 * (lens.height_px - 1);
  Eigen::Matrix3d normalisation;
  normalisation << 1 / scale, 0, -centre_x / scale, 0, 1 / scale, -centre_y / scale, 0, 0, 1;
  // The unknowns are B11, B22, B13, B23, B33.
  using Vector5 = Eigen::Matrix<double, 5, 1>;
  Eigen::Matrix<double, 5, 5> normal = Eigen::Matrix<double, 5, 5>::Zero();
  for (const Eigen::Matrix3d& homography : homographies) {
    Eigen::Matrix3d h = normalisation * homography;
    h /= h.norm();
    const auto row = [&](int i, int j) {
      Vector5 v;
      v << h(0, i) * h(0, j), h(1, i) * h(1, j), h(0, i) * h(2, j) + h(2, i) * h(0, j),
          h(1, i) * h(2, j) + h(2, i) * h(1, j), h(2, i) * h(2, j);
      return v;
    };
    const Vector5 orthogonal = row(0, 1);
    const Vector5 equal = row(0, 0) - row(1, 1);
    normal += orthogonal * orthogonal.transpose() + equal * equal.transpose();
  }
  Vector5 b;
  if (centred) {
    Eigen::Matrix3d small;
    const int keep[3] = {0, 1, 4};
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) small(i, j) = normal(keep[i], keep[j]);
    }
    const Eigen::Vector3d null_vector = EigenOfSymmetric(small).vectors.col(0);
    b << null_vector[0], null_vector[1], 0, 0, null_vector[2];
  } else {
    b = EigenOfSymmetric(normal).vectors.col(0);
  }
  if (b[0] < 0) b = -b;
  const double cx = -b[2] / b[0];
  const double cy = -b[3] / b[1];
  const double lambda = b[4] - b[2] * b[2] / b[0] - b[3] * b[3] / b[1];
  if (!(b[0] > 0) || !(b[1] > 0) || !(lambda > 0)) return std::nullopt;
  const double fx = std::sqrt(lambda / b[0]) * scale;
  const double fy = std::sqrt(lambda / b[1]) * scale;
  if (!std::isfinite(fx) || !std::isfinite(fy) || std::abs(cx) > 1 || std::abs(cy) > 1) return std::nullopt;
  return MakeCamera(lens, fx, fy, cx * scale + centre_x, cy * scale + centre_y);
}

struct PosedView {
  const View* view;
  Rigid3d camera_from_target;
};

// Views with the rough poses of their targets, which are refined jointly later.
struct RoughPoses {
  std::vector<PosedView> posed;
  double median_rms_px = 0;
};

// Returns nothing if fewer than three views have a pose.
std::optional<RoughPoses> PoseViews(const Camera& camera, const std::vector<const View*>& views) {
  RoughPoses rough;
  std::vector<double> rms;
  for (const View* view : views) {
    const std::optional<TargetPose> pose = EstimateRoughPose(camera, view->observations);
    if (!pose) continue;
    rough.posed.push_back({view, pose->camera_from_target});
    rms.push_back(pose->rms_px);
  }
  if (rough.posed.size() < 3) return std::nullopt;
  rough.median_rms_px = Median(std::move(rms));
  return rough;
}

std::vector<double> SquaredDistances(const Camera& camera, const std::vector<PosedView>& posed) {
  std::vector<double> distances;
  for (const PosedView& entry : posed) {
    const std::optional<Points2> residuals = Residuals(camera, entry.camera_from_target, entry.view->observations);
    CHECK(residuals.has_value());
    for (Eigen::Index i = 0; i < residuals->cols(); ++i) distances.push_back(residuals->col(i).squaredNorm());
  }
  return distances;
}

// A camera, and the poses of the targets in its views.
struct PosedCamera {
  Camera camera;
  std::vector<PosedView> posed;
};

// Refines the camera and one pose per view jointly until the relative change of the cost is below `tolerance`.
// Returns nothing if Ceres cannot use the result.
std::optional<PosedCamera> RefineTogether(PosedCamera start, const FreeParameters& free, const Loss& loss,
                                          double tolerance) {
  auto& [camera, posed] = start;
  const CameraModel& model = camera.Model();
  const double sigma_px = SigmaFromMedian(SquaredDistances(camera, posed));
  CapturesCostOptions options;
  options.pixel_sigma_px = sigma_px;
  options.loss = &loss;
  LoopProblem loops;
  loops.layout.AddCamera(kCameraBlock, model, free);
  loops.layout.AddTarget(kTargetBlock, {});
  loops.cameras = {&model};
  loops.targets = {TargetShape()};
  for (const PosedView& entry : posed) {
    loops.captures.push_back(
        {{{&entry.view->observations, KinematicLoop({OwnFactor(0)})}}, {{entry.camera_from_target, std::nullopt}}});
  }
  LoopUnknowns unknowns(loops.layout, {{}, {}, {camera.params}, loops.targets});
  CapturesCost cost(std::move(loops), options);
  ceres::Solver::Options solver_options = ReprojectionSolverOptions(100);
  solver_options.function_tolerance = tolerance;
  const ceres::Solver::Summary summary = SolveCaptures(solver_options, &cost, &unknowns);
  if (!summary.IsSolutionUsable()) return std::nullopt;
  camera.params = unknowns.Values().cameras.front();
  const std::vector<std::vector<Rigid3d>> poses = cost.EliminatedPoses();
  for (size_t i = 0; i < poses.size(); ++i) posed[i].camera_from_target = poses[i].front();
  return start;
}

// Returns the best of the closed-form solutions and the guesses of the focal length: with it most views have a pose,
// and their median RMS error is smallest.
std::optional<Camera> FirstGuess(const std::vector<const View*>& usable,
                                 const std::vector<Eigen::Matrix3d>& homographies, const InitialLens& lens) {
  std::vector<Camera> candidates;
  for (const bool centred : {false, true}) {
    const std::optional<Camera> zhang = ZhangClosedForm(homographies, lens, centred);
    if (zhang) candidates.push_back(*zhang);
  }
  for (const double ratio : {0.35, 0.6, 1.0, 1.6, 3.0}) {
    candidates.push_back(MakeCamera(lens, ratio * lens.width_px, ratio * lens.width_px, 0.5 * (lens.width_px - 1),
                                    0.5 * (lens.height_px - 1)));
  }
  // Some of the views suffice. They are selected over all degrees of perspective, which distinguishes focal lengths.
  constexpr size_t kMaxTelling = 12;
  std::vector<std::pair<double, size_t>> order;
  for (size_t i = 0; i < homographies.size(); ++i) {
    const Points3& points = usable[i]->observations.points_in_target;
    const double extent_m = (points.rowwise().maxCoeff() - points.rowwise().minCoeff()).maxCoeff();
    order.emplace_back(-extent_m * (homographies[i].row(2).head<2>() / homographies[i](2, 2)).norm(), i);
  }
  std::sort(order.begin(), order.end());
  std::vector<const View*> telling;
  const size_t stride = (usable.size() + kMaxTelling - 1) / kMaxTelling;
  for (size_t k = 0; k < order.size(); k += stride) telling.push_back(usable[order[k].second]);
  std::optional<Camera> camera;
  double best_rms_px = 0;
  size_t best_count = 0;
  for (const Camera& candidate : candidates) {
    const std::optional<RoughPoses> rough = PoseViews(candidate, telling);
    if (!rough) continue;
    const size_t count = rough->posed.size();
    if (camera && (count < best_count || (count == best_count && rough->median_rms_px >= best_rms_px))) continue;
    camera = candidate;
    best_rms_px = rough->median_rms_px;
    best_count = count;
  }
  if (!camera && telling.size() < usable.size()) {
    // None of the selected views has a pose.
    for (const Camera& candidate : candidates) {
      if (PoseViews(candidate, usable)) return candidate;
    }
  }
  return camera;
}

// An estimated camera, with the scale of its residuals.
struct EstimatedCamera {
  Camera camera;
  double sigma_px = 0;  // From the median.
};

// Refines camera and poses in stages, each with more free parameters than the one before.
Outcome<EstimatedCamera> RefineInStages(const Camera& camera, const std::vector<const View*>& usable,
                                        const std::vector<FreeParameters>& stages) {
  std::optional<RoughPoses> rough = PoseViews(camera, usable);
  if (!rough) return Failure{FailureCode("no_camera")};
  std::optional<PosedCamera> refined = PosedCamera{camera, std::move(rough->posed)};
  const Loss& loss = LossOf(LossKind::kHuber);
  // Errors that an intermediate stage leaves are corrected by the next one.
  constexpr double kPassing = 1e-3;
  constexpr double kLast = 1e-10;
  for (size_t i = 0; i < stages.size(); ++i) {
    refined = RefineTogether(*std::move(refined), stages[i], loss, i + 1 < stages.size() ? kPassing : kLast);
    if (!refined) return Failure{FailureCode("intrinsics_failed")};
    const std::string faults = CheckCamera(refined->camera);
    if (!faults.empty()) return Failure{FailureCode("implausible_camera"), {}, {{"faults", faults}}};
  }
  const double sigma_px = SigmaFromMedian(SquaredDistances(refined->camera, refined->posed));
  return EstimatedCamera{std::move(refined->camera), sigma_px};
}

}  // namespace

Outcome<Camera> EstimateIntrinsics(const std::vector<View>& views, const std::string& model_name, int width_px,
                                   int height_px, const std::optional<Camera>& start) {
  std::vector<const View*> usable;
  std::vector<Eigen::Matrix3d> homographies;
  int num_points = 0;
  for (const View& view : views) {
    if (view.observations.size() < 4) continue;
    const std::optional<Eigen::Matrix3d> homography =
        LinearHomography(view.observations.points_in_target.topRows<2>(), view.observations.pixels);
    if (!homography) continue;
    usable.push_back(&view);
    homographies.push_back(*homography);
    num_points += view.observations.size();
  }
  if (usable.size() < 3) {
    return Failure{FailureCode("few_captures_of_camera"), {{"captures", static_cast<double>(usable.size())}}};
  }
  // A point has two coordinates, a view has six unknowns; the distortion is estimated if at least three times the
  // number of camera parameters remains. Otherwise the distortion of `start` would remain, whatever these views show.
  const CameraModel& model = *FindCameraModel(model_name);
  const int num_params = NumParams(model);
  const bool has_distortion = 2 * num_points - 6 * static_cast<int>(usable.size()) >= 3 * num_params;
  std::vector<Camera> starts;
  const bool has_start = start && has_distortion;
  if (has_start) {
    starts.push_back(*start);
  } else {
    std::vector<std::vector<double>> distortions = model.facts().initial_distortions;
    if (distortions.empty()) distortions.emplace_back(model.facts().distortion_names.size(), 0.0);
    for (std::vector<double>& distortion : distortions) {
      const std::optional<Camera> guess =
          FirstGuess(usable, homographies, {model_name, width_px, height_px, std::move(distortion)});
      if (guess) starts.push_back(*guess);
    }
  }

  // The parameters that every view determines come first, then all: distortion from a few points would diverge from a
  // rough initial guess.
  const FreeParameters linear = FreeOf(model, {ParameterGroup::kFocal, ParameterGroup::kPrincipalPoint});
  FreeParameters all(static_cast<size_t>(num_params), true);
  std::vector<FreeParameters> stages;
  if (!has_start) stages = {FreeOf(model, {ParameterGroup::kFocal}), linear};
  if (has_distortion) {
    // Sixth-order terms come last: they are known ten times less accurately than the lower ones.
    FreeParameters low_order = all;
    for (size_t i = 8; i < low_order.size(); ++i) low_order[i] = false;
    if (!has_start) stages.push_back(low_order);
    stages.push_back(all);
    stages.push_back(all);
  }
  Outcome<EstimatedCamera> best = Failure{FailureCode("no_camera")};
  for (const Camera& camera : starts) {
    Outcome<EstimatedCamera> estimated = RefineInStages(camera, usable, stages);
    if (!best || (estimated && estimated->sigma_px < best->sigma_px)) best = std::move(estimated);
  }
  if (!best) return best.failure();
  return best->camera;
}

}  // namespace heba
