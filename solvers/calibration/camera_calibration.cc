#include "heba/camera_calibration.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "heba/base/distributions.h"
#include "heba/base/factorisation.h"
#include "heba/base/failure_code.h"
#include "heba/base/parallel.h"
#include "heba/bundle_adjustment.h"
#include "heba/camera/camera_model.h"
#include "heba/evaluation/metrics.h"
#include "solvers/calibration/camera_choice.h"
#include "solvers/initial/intrinsics.h"
#include "solvers/initial/target_pose.h"
#include "solvers/initial/usable_views.h"
#include "solvers/residuals/inliers.h"
#include "solvers/residuals/loss.h"

namespace heba {
namespace {

constexpr const char* kPolynomials[] = {"pinhole", "brown4", "brown5", "rational8"};

// A model of the lens, refined with the poses of the views.
struct Fitted {
  PairSolution solution;
  bool is_bent = false;
  std::vector<View> views;  // The list has the views that were used, with their first poses as mounts.
};

// Returns the views with the pose that each shows by itself in place of a robot's; without those that show none.
std::vector<View> WithPosesSeen(const std::vector<View>& views, const Camera& camera) {
  std::vector<View> posed;
  for (const View& view : views) {
    if (view.observations.size() < kMinPosePoints) continue;
    const std::vector<TargetPose> poses = EstimateTargetPose(camera, view.observations);
    if (poses.empty()) continue;
    posed.push_back(view);
    posed.back().camera_mount_from_target_mount = poses.front().camera_from_target;
    posed.back().effect = nullptr;
    posed.back().gripper_by_joints = Matrix6X(6, 0);
  }
  return posed;
}

// Refines camera, poses and shape. The poses are those of a robot about which next to nothing is known, so that each
// view keeps a pose of its own.
Outcome<PairSolution> Refine(const std::vector<View>& posed, const Camera& camera, const TargetShape& shape,
                             bool is_bent, const CameraCalibrationOptions& options) {
  BundleOptions bundle;
  bundle.loss = options.loss;
  bundle.num_threads = options.num_threads;
  bundle.robot = BundleOptions::Robot::kGivenNoise;
  // Some hundred times what an image leaves open.
  constexpr double kShareOfDistance = 0.05;
  std::vector<Rigid3d> camera_from_target;
  for (const View& view : posed) camera_from_target.push_back(view.camera_mount_from_target_mount);
  bundle.robot_noise = {kShareOfDistance * WorkingDistance(camera_from_target), kShareOfDistance, 0};
  if (is_bent) bundle.free_shape = {TargetShapeGroup::kBend, TargetShapeGroup::kTwist};
  return RefineHandEye({camera, posed, Setup::kEyeToHand, shape}, HandEye(), bundle);
}

// Returns camera_from_target of a view of a solution.
Rigid3d PoseOf(const View& view, const PairSolution& solution, size_t index) {
  const Rigid3d correction = solution.views[index].correction.value_or(Rigid3d());
  return CameraFromTarget(solution.hand_eye, view.camera_mount_from_target_mount * correction);
}

// Returns the squared residuals of a view's points.
std::vector<double> SquaresOf(const Fitted& fitted, size_t index) {
  std::vector<double> squares;
  const View& view = fitted.views[index];
  const std::optional<Points2> residuals = Residuals(fitted.solution.camera, PoseOf(view, fitted.solution, index),
                                                     ApplyShape(view.observations, fitted.solution.shape));
  for (Eigen::Index i = 0; residuals && i < residuals->cols(); ++i) squares.push_back(residuals->col(i).squaredNorm());
  // A point that a lens does not see counts as far off.
  constexpr double kHiddenPx2 = 1e4;
  if (!residuals) squares.assign(static_cast<size_t>(view.observations.size()), kHiddenPx2);
  return squares;
}

// Returns the log-likelihood of each view by Huber's loss, up to a constant.
std::vector<double> LogLikelihoods(const Fitted& fitted, double sigma_px) {
  const Loss& huber = LossOf(LossKind::kHuber);
  std::vector<double> sums;
  for (size_t v = 0; v < fitted.views.size(); ++v) {
    double& sum = sums.emplace_back(0);
    for (const double square : SquaresOf(fitted, v)) sum -= 0.5 * huber.rho(square / (sigma_px * sigma_px));
  }
  return sums;
}

double SumOf(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum;
}

Outcome<Fitted> FittedWith(const std::vector<View>& views, const std::string& model,
                           const CameraCalibrationOptions& options) {
  const Outcome<Camera> start = EstimateIntrinsics(views, model, options.width_px, options.height_px);
  if (!start) return start.failure();
  Fitted fitted;
  fitted.views = WithPosesSeen(views, *start);
  Outcome<PairSolution> flat = Refine(fitted.views, *start, options.shape, false, options);
  if (!flat) return flat.failure();
  fitted.solution = std::move(*flat);
  if (!options.choose_bend) return fitted;
  const Outcome<PairSolution> bent = Refine(fitted.views, fitted.solution.camera, options.shape, true, options);
  if (!bent) return fitted;
  Fitted other = fitted;
  other.solution = *bent;
  other.is_bent = true;
  constexpr double kBendRejected = 1e-3;
  const double gain =
      SumOf(LogLikelihoods(other, bent->pixel_sigma_px)) - SumOf(LogLikelihoods(fitted, bent->pixel_sigma_px));
  constexpr int kNumParams = NumParamsOf(TargetShapeGroup::kBend) + NumParamsOf(TargetShapeGroup::kTwist);
  if (FisherTail(std::max(0.0, gain), kNumParams, bent->covariance_dof) < kBendRejected) return other;
  return fitted;
}

// Returns the errors of the points of a view that were used; nothing if one cannot be projected.
std::optional<SquaredErrors> ErrorsOf(const Fitted& fitted, size_t index) {
  const View& view = fitted.views[index];
  const Observations points = WithoutPoints(view.observations, fitted.solution.views[index].rejected_ids);
  return ViewErrors(fitted.solution.camera, PoseOf(view, fitted.solution, index),
                    ApplyShape(points, fitted.solution.shape));
}

double RmsPx(const Fitted& fitted) {
  SquaredErrors sum;
  for (size_t v = 0; v < fitted.views.size(); ++v) {
    const std::optional<SquaredErrors> errors = ErrorsOf(fitted, v);
    if (errors) sum.Add(*errors);
  }
  return sum.RmsPx().value_or(0);
}

// Returns the RMS of the points of held-out views about the best pose of the target that the camera without them shows.
std::optional<double> HoldOutPx(const Fitted& fitted, const CameraCalibrationOptions& options) {
  const int folds = std::min(options.folds, static_cast<int>(fitted.views.size()));
  if (folds < 2) return std::nullopt;
  SquaredErrors sum;
  for (int fold = 0; fold < folds; ++fold) {
    std::vector<View> used;
    std::vector<size_t> held_out;
    for (size_t v = 0; v < fitted.views.size(); ++v) {
      if (static_cast<int>(v) % folds == fold) {
        held_out.push_back(v);
      } else {
        used.push_back(fitted.views[v]);
      }
    }
    const Outcome<PairSolution> solution =
        Refine(used, fitted.solution.camera, fitted.solution.shape, fitted.is_bent, options);
    if (!solution) return std::nullopt;
    for (const size_t v : held_out) {
      const Observations points = ApplyShape(
          WithoutPoints(fitted.views[v].observations, fitted.solution.views[v].rejected_ids), solution->shape);
      const std::vector<TargetPose> poses = EstimateTargetPose(solution->camera, points);
      if (poses.empty()) continue;
      const std::optional<SquaredErrors> errors =
          ViewErrors(solution->camera, poses.front().camera_from_target, points);
      if (errors) sum.Add(*errors);
    }
  }
  return sum.RmsPx();
}

// Returns the place of the model to take. `likelihoods` are the LogLikelihoods of each model.
std::optional<size_t> Choose(const std::vector<std::string>& models, const std::vector<std::optional<Fitted>>& fitted,
                             const std::vector<std::vector<double>>& likelihoods) {
  const auto place_of = [&](const std::string& model) {
    return static_cast<size_t>(std::find(models.begin(), models.end(), model) - models.begin());
  };
  std::optional<size_t> chosen;
  std::vector<size_t> ladder;
  for (const char* model : kPolynomials) {
    const size_t place = place_of(model);
    if (place < models.size() && fitted[place]) ladder.push_back(place);
  }
  for (size_t i = 0; i < ladder.size() && !chosen; ++i) {
    const Fitted& smaller = *fitted[ladder[i]];
    bool is_rejected = i + 1 < ladder.size() && !WhyNotBesideLarger(smaller.solution.camera).empty();
    for (size_t k = i + 1; k < ladder.size(); ++k) {
      const Fitted& larger = *fitted[ladder[k]];
      std::vector<double> gains = likelihoods[ladder[k]];
      const std::vector<double>& of_smaller = likelihoods[ladder[i]];
      if (gains.size() != of_smaller.size()) continue;
      for (size_t v = 0; v < gains.size(); ++v) gains[v] -= of_smaller[v];
      const double more = NumMoreParams(smaller.solution.camera, larger.solution.camera);
      is_rejected = is_rejected || CompareLenses(gains, more, smaller.solution.covariance_dof).RejectsSmaller();
    }
    if (!is_rejected) chosen = ladder[i];
  }
  const auto bic = [&](size_t place) {
    double num_points = 0;
    for (const View& view : fitted[place]->views) num_points += view.observations.size();
    return static_cast<double>(fitted[place]->solution.camera.params.size()) * std::log(std::max(2.0, num_points)) -
           2 * SumOf(likelihoods[place]);
  };
  constexpr double kDecisive = 10;
  for (size_t i = 0; i < models.size(); ++i) {
    if (!fitted[i] || std::find(ladder.begin(), ladder.end(), i) != ladder.end()) continue;
    if (chosen && fitted[i]->views.size() != fitted[*chosen]->views.size()) continue;
    if (!chosen || bic(i) < bic(*chosen) - kDecisive) chosen = i;
  }
  return chosen;
}

// Returns the covariance of the parameters of the camera, which were all free.
Eigen::MatrixXd CovarianceOf(const PairSolution& solution) {
  const UnknownBlock block = solution.covariance.layout.Block(kCameraBlock);
  return solution.covariance.matrix.block(block.first, block.first, block.size, block.size);
}

std::vector<CameraViewOutcome> OutcomesOf(const std::vector<View>& views, const Fitted& fitted) {
  std::vector<CameraViewOutcome> outcomes;
  for (const View& view : views) {
    CameraViewOutcome& outcome = outcomes.emplace_back();
    outcome.name = view.name;
    outcome.capture = view.capture;
    for (size_t v = 0; v < fitted.views.size(); ++v) {
      if (fitted.views[v].capture != view.capture) continue;
      outcome.num_rejected = static_cast<int>(fitted.solution.views[v].rejected_ids.size());
      outcome.used = outcome.num_rejected < view.observations.size();
      outcome.camera_from_target = PoseOf(fitted.views[v], fitted.solution, v);
      const std::optional<SquaredErrors> errors = ErrorsOf(fitted, v);
      if (errors) outcome.rms_px = errors->RmsPx().value_or(0);
    }
  }
  return outcomes;
}

}  // namespace

Outcome<CameraCalibration> CalibrateCamera(const std::vector<View>& views, const CameraCalibrationOptions& options) {
  const std::vector<std::string> models = CameraModelNames();
  std::vector<std::optional<Fitted>> fitted(models.size());
  CameraCalibration calibration;
  calibration.lenses.resize(models.size());
  CameraCalibrationOptions of_one = options;
  of_one.num_threads = 1;
  ParallelFor(static_cast<int>(models.size()), options.num_threads, [&](int index) {
    const auto i = static_cast<size_t>(index);
    LensFit& lens = calibration.lenses[i];
    lens.model = models[i];
    Outcome<Fitted> fit = FittedWith(views, models[i], of_one);
    if (!fit) {
      // The target takes the place of a robot here.
      const bool is_still = fit.failure().code == "no_rotation" || fit.failure().code == "one_axis";
      lens.reason = is_still ? Failure(FailureCode("few_tilts")) : fit.failure();
      return;
    }
    lens.camera = fit->solution.camera;
    lens.rms_px = RmsPx(*fit);
    lens.is_bent = fit->is_bent;
    lens.holdout_rms_px = HoldOutPx(*fit, of_one);
    fitted[i] = std::move(*fit);
  });
  double sigma_px = std::numeric_limits<double>::infinity();
  for (const std::optional<Fitted>& fit : fitted) {
    if (fit) sigma_px = std::min(sigma_px, fit->solution.pixel_sigma_px);
  }
  constexpr double kLeastSigmaPx = 1e-6;  // Images without noise have this sigma.
  sigma_px = std::max(sigma_px, kLeastSigmaPx);
  std::vector<std::vector<double>> likelihoods;
  for (const std::optional<Fitted>& fit : fitted) {
    likelihoods.push_back(fit ? LogLikelihoods(*fit, sigma_px) : std::vector<double>());
  }
  std::optional<size_t> chosen = Choose(models, fitted, likelihoods);
  if (!options.model.empty()) {
    const auto stated = static_cast<size_t>(std::find(models.begin(), models.end(), options.model) - models.begin());
    if (!fitted[stated]) return calibration.lenses[stated].reason;
    chosen = stated;
  }
  if (!chosen) return calibration.lenses.front().reason;
  double largest = -std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < models.size(); ++i) {
    if (!fitted[i]) continue;
    calibration.lenses[i].log_likelihood = SumOf(likelihoods[i]);
    largest = std::max(largest, calibration.lenses[i].log_likelihood);
  }
  for (LensFit& lens : calibration.lenses) lens.log_likelihood -= lens.camera ? largest : 0;
  const Fitted& best = *fitted[*chosen];
  calibration.chosen = *chosen;
  calibration.camera = best.solution.camera;
  calibration.covariance = CovarianceOf(best.solution);
  calibration.covariance_dof = best.solution.covariance_dof;
  calibration.shape = best.solution.shape;
  calibration.pixel_sigma_px = best.solution.pixel_sigma_px;
  calibration.views = OutcomesOf(views, best);
  return calibration;
}

std::vector<double> ProjectionSigmasPx(const CameraCalibration& calibration, int columns, int rows) {
  const Camera& camera = calibration.camera;
  const auto num_params = static_cast<Eigen::Index>(camera.params.size());
  struct Place {
    bool has_ray = false;
    Eigen::MatrixXd by_params;            // 2 x n.
    Eigen::Matrix<double, 2, 3> by_turn;  // By a rotation of the camera.
  };
  std::vector<Place> places;
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::MatrixXd coupling = Eigen::MatrixXd::Zero(3, num_params);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      Place& place = places.emplace_back();
      const Eigen::Vector2d pixel((column + 0.5) * camera.width_px / columns - 0.5,
                                  (row + 0.5) * camera.height_px / rows - 0.5);
      const std::optional<Eigen::Vector3d> ray = UnprojectPixel(camera, pixel);
      if (!ray) continue;
      place.by_params.resize(2, num_params);
      place.has_ray = true;
      for (Eigen::Index i = 0; i < num_params && place.has_ray; ++i) {
        Camera other = camera;
        double& param = other.params[static_cast<size_t>(i)];
        const double step = 1e-6 * std::max(1e-2, std::abs(param));
        param += step;
        const std::optional<Eigen::Vector2d> moved = ProjectPoint(other, *ray);
        place.has_ray = moved.has_value();
        if (moved) place.by_params.col(i) = (*moved - pixel) / step;
      }
      for (int axis = 0; axis < 3 && place.has_ray; ++axis) {
        constexpr double kStep = 1e-6;
        const std::optional<Eigen::Vector2d> moved =
            ProjectPoint(camera, *ray + kStep * Eigen::Vector3d::Unit(axis).cross(*ray));
        place.has_ray = moved.has_value();
        if (moved) place.by_turn.col(axis) = (*moved - pixel) / kStep;
      }
      if (!place.has_ray) continue;
      normal += place.by_turn.transpose() * place.by_turn;
      coupling += place.by_turn.transpose() * place.by_params;
    }
  }
  const Eigen::MatrixXd turn_by_params = SolveSymmetric(normal, coupling);
  std::vector<double> sigmas_px;
  for (const Place& place : places) {
    if (!place.has_ray) {
      sigmas_px.push_back(std::numeric_limits<double>::infinity());
      continue;
    }
    const Eigen::MatrixXd by_params = place.by_params - place.by_turn * turn_by_params;
    sigmas_px.push_back(std::sqrt(0.5 * (by_params * calibration.covariance * by_params.transpose()).trace()));
  }
  return sigmas_px;
}

}  // namespace heba
