#include "solvers/calibration/camera_choice.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "heba/base/distributions.h"
#include "heba/base/failure_code.h"
#include "heba/base/units.h"
#include "heba/evaluation/metrics.h"
#include "solvers/initial/intrinsics.h"
#include "solvers/initial/target_pose.h"
#include "solvers/initial/usable_views.h"
#include "solvers/residuals/loss.h"
#include "solvers/residuals/noise_scale.h"

namespace heba {
namespace {

struct FittedCamera {
  Camera camera;
  // The squared residuals of each view's points, px^2; empty for a view that no pose explains.
  std::vector<std::vector<double>> squares_px2;
};

FittedCamera Measure(const Camera& camera, const std::vector<View>& views) {
  FittedCamera fitted{camera, {}};
  for (const View& view : views) {
    std::vector<double>& squares = fitted.squares_px2.emplace_back();
    if (view.observations.size() < kMinPosePoints) continue;
    const std::vector<TargetPose> poses = EstimateTargetPose(camera, view.observations);
    if (poses.empty()) continue;
    const std::optional<Points2> residuals = Residuals(camera, poses.front().camera_from_target, view.observations);
    for (Eigen::Index i = 0; residuals && i < residuals->cols(); ++i)
      squares.push_back(residuals->col(i).squaredNorm());
  }
  return fitted;
}

// Returns half of the sum of the Huber loss over a view's points. The points of a view that a camera does not explain
// count as 20 sigmas off.
double MinusLogLikelihood(const std::vector<double>& squares_px2, size_t num_points, double sigma_px) {
  const Loss& huber = LossOf(LossKind::kHuber);
  constexpr double kHiddenSigmas = 20;
  double sum = 0;
  for (size_t i = 0; i < num_points; ++i) {
    sum += huber.rho(squares_px2.empty() ? kHiddenSigmas * kHiddenSigmas : squares_px2[i] / (sigma_px * sigma_px));
  }
  return 0.5 * sum;
}

LensComparison Compare(const FittedCamera& smaller, const FittedCamera& larger, double sigma_px) {
  std::vector<double> gains;
  for (size_t v = 0; v < smaller.squares_px2.size(); ++v) {
    const size_t num_points = std::max(smaller.squares_px2[v].size(), larger.squares_px2[v].size());
    if (num_points == 0) continue;
    gains.push_back(MinusLogLikelihood(smaller.squares_px2[v], num_points, sigma_px) -
                    MinusLogLikelihood(larger.squares_px2[v], num_points, sigma_px));
  }
  return CompareLenses(gains, NumMoreParams(smaller.camera, larger.camera), std::numeric_limits<double>::infinity());
}

// Returns the sigma of one coordinate, from the median; the six pose parameters per view are not corrected for.
double SigmaPx(const FittedCamera& fitted) {
  std::vector<double> all;
  for (const std::vector<double>& squares : fitted.squares_px2) all.insert(all.end(), squares.begin(), squares.end());
  return SigmaFromMedian(std::move(all));
}

double LogLikelihood(const FittedCamera& fitted, const std::vector<View>& views, double sigma_px) {
  double sum = 0;
  for (size_t v = 0; v < views.size(); ++v) {
    sum -= MinusLogLikelihood(fitted.squares_px2[v], static_cast<size_t>(views[v].observations.size()), sigma_px);
  }
  return sum;
}

// Returns the largest angle between the ray of a point and the optical axis.
double LargestAngleRad(const Camera& camera, const std::vector<View>& views) {
  double largest = 0;
  for (const View& view : views) {
    for (Eigen::Index i = 0; i < view.observations.pixels.cols(); ++i) {
      const std::optional<Eigen::Vector3d> ray = UnprojectPixel(camera, view.observations.pixels.col(i));
      // There is no ray beyond the radius at which the distortion folds back: the angle counts as 90 deg.
      largest = std::max(largest, ray ? std::acos(std::clamp(ray->z(), -1.0, 1.0)) : kPi / 2);
    }
  }
  return largest;
}

}  // namespace

bool LensComparison::RejectsSmaller() const {
  constexpr double kSignificant = 0.01;
  constexpr double kSigmas = 1;
  return p < kSignificant && sigmas > kSigmas;
}

LensComparison CompareLenses(const std::vector<double>& gain_of_capture, double num_more, double dof) {
  LensComparison comparison;
  for (const double gain : gain_of_capture) comparison.gain += gain;
  const double num_captures = static_cast<double>(gain_of_capture.size());
  const double mean = comparison.gain / num_captures;
  double variance = 0;
  for (const double gain : gain_of_capture) {
    variance += (gain - mean) * (gain - mean) / std::max(1.0, num_captures - 1);
  }
  comparison.p = FisherTail(std::max(0.0, 2 * comparison.gain) / num_more, num_more, dof);
  // Each superfluous parameter gains one half on average.
  const double scatter = std::sqrt(num_captures * variance);
  comparison.sigmas = scatter > 0 ? (comparison.gain - 0.5 * num_more) / scatter : 0;
  return comparison;
}

Failure WhyNotBesideLarger(const Camera& camera) {
  const auto last_param = static_cast<int>(camera.params.size()) - 1;  // The distortion follows the other groups.
  if (GroupOf(last_param) == ParameterGroup::kDistortion) return {};
  return FailureCode("undistorted");
}

double NumMoreParams(const Camera& smaller, const Camera& larger) {
  return std::max(1.0, static_cast<double>(larger.params.size()) - static_cast<double>(smaller.params.size()));
}

std::vector<std::string> SmallerCameraModels(const std::string& model) {
  static constexpr std::array kPolynomials = {"rational8", "brown5", "brown4", "pinhole"};
  static constexpr std::array kFisheyes = {"kannala_brandt4", "double_sphere", "eucm"};
  const auto after = [&](const auto& ladder) {
    const auto place = std::find(ladder.begin(), ladder.end(), model);
    return std::vector<std::string>(place == ladder.end() ? place : place + 1, ladder.end());
  };
  const std::vector<std::string> polynomials = after(kPolynomials);
  if (!polynomials.empty() || model == kPolynomials.back()) return polynomials;
  return after(kFisheyes);
}

namespace {

// Fits a model. A larger model also starts from the optimum of the last smaller one, so its fit is never worse.
Outcome<FittedCamera> FitModel(const std::vector<View>& views, const std::string& model, int width_px, int height_px,
                               const std::vector<FittedCamera>& smaller) {
  std::optional<Camera> start;
  if (!smaller.empty()) start = ConvertCamera(smaller.back().camera, model);
  const Outcome<Camera> camera = EstimateIntrinsics(views, model, width_px, height_px);
  const Outcome<Camera> other =
      start ? EstimateIntrinsics(views, model, width_px, height_px, start) : Outcome<Camera>();
  if (!camera && !other) return camera.failure();
  std::vector<FittedCamera> found;
  if (camera) found.push_back(Measure(*camera, views));
  if (other) found.push_back(Measure(*other, views));
  const bool takes_second = found.size() == 2 && Compare(found[0], found[1], SigmaPx(found[0])).gain > 0;
  return std::move(found[takes_second ? 1 : 0]);
}

CameraAlternative AlternativeOf(const FittedCamera& fitted, const std::vector<View>& views, double sigma_px) {
  return {fitted.camera.model, LogLikelihood(fitted, views, sigma_px), static_cast<int>(fitted.camera.params.size()),
          std::nullopt};
}

// The comparison of a model with all larger ones.
struct BesideLarger {
  double least_p = 1;
  bool is_rejected = false;
};

// A model is rejected by any larger one that is better, not only by the next.
BesideLarger CompareWithLarger(const std::vector<FittedCamera>& fitted, size_t index, double sigma_px) {
  BesideLarger result;
  for (size_t k = index + 1; k < fitted.size(); ++k) {
    const LensComparison comparison = Compare(fitted[index], fitted[k], sigma_px);
    result.least_p = std::min(result.least_p, comparison.p);
    result.is_rejected = result.is_rejected || comparison.RejectsSmaller();
  }
  return result;
}

}  // namespace

Outcome<CameraChoice> ChooseCameraModel(const std::vector<View>& views, int width_px, int height_px) {
  std::vector<FittedCamera> fitted;
  Failure last;
  for (const char* model : {"pinhole", "brown4", "brown5", "rational8"}) {
    Outcome<FittedCamera> of_model = FitModel(views, model, width_px, height_px, fitted);
    if (of_model) {
      fitted.push_back(std::move(*of_model));
    } else {
      last = of_model.failure();
    }
  }
  CameraChoice choice;
  size_t chosen = 0;
  double sigma_px = 1;
  if (!fitted.empty()) {
    sigma_px = SigmaPx(fitted.back());
    for (const FittedCamera& camera : fitted) choice.alternatives.push_back(AlternativeOf(camera, views, sigma_px));
    for (size_t i = 0; i < fitted.size(); ++i) {
      BesideLarger larger = CompareWithLarger(fitted, i, sigma_px);
      if (i + 1 < fitted.size()) {
        choice.alternatives[i].p = larger.least_p;
        choice.alternatives[i].reason = WhyNotBesideLarger(fitted[i].camera);
        larger.is_rejected = larger.is_rejected || !choice.alternatives[i].reason.empty();
      }
      chosen = i;
      if (!larger.is_rejected) break;
    }
  }
  const double wide_rad = DegToRad(50.0);
  if (fitted.empty() || LargestAngleRad(fitted[chosen].camera, views) > wide_rad) {
    const Outcome<Camera> fisheye = EstimateIntrinsics(views, "kannala_brandt4", width_px, height_px);
    if (fisheye) {
      FittedCamera measured = Measure(*fisheye, views);
      if (fitted.empty()) sigma_px = SigmaPx(measured);
      choice.alternatives.push_back(AlternativeOf(measured, views, sigma_px));
      const bool is_better = fitted.empty() || Compare(fitted[chosen], measured, sigma_px).gain > 0;
      if (is_better) {
        fitted.push_back(std::move(measured));
        chosen = fitted.size() - 1;
      }
    } else if (fitted.empty()) {
      last = fisheye.failure();
    }
  }
  if (fitted.empty()) return last;
  choice.camera = fitted[chosen].camera;
  for (FittedCamera& candidate : fitted) choice.candidates.push_back(std::move(candidate.camera));
  return choice;
}

}  // namespace heba
