#include "solvers/initial/target_pose.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "heba/base/levenberg_marquardt.h"
#include "heba/base/units.h"
#include "heba/evaluation/metrics.h"
#include "heba/geometry/homography.h"
#include "heba/kernels/small_matrix.h"
#include "solvers/residuals/view_reduction.h"

namespace heba {
namespace {

// Returns the rotation by the smallest angle that maps z to `direction`.
Eigen::Matrix3d RotationFromZ(const Eigen::Vector3d& direction) {
  return RotationOnto(Eigen::Vector3d::UnitZ(), direction).toRotationMatrix();
}

// Returns the two rotations of a plane whose homography to normalised image coordinates is `h`; the origin of the
// plane must be near the points. The method and notation are those of Collins and Bartoli 2014, section 4: v is the
// image of the origin, J the Jacobian of the plane-to-image map there, gamma the reciprocal of the origin's depth.
std::vector<Eigen::Matrix3d> PlaneRotations(Eigen::Matrix3d h) {
  h /= h(2, 2);
  const Eigen::Vector2d v = h.topRightCorner<2, 1>();
  const Eigen::Matrix2d j = h.topLeftCorner<2, 2>() - v * h.bottomLeftCorner<1, 2>();
  const Eigen::Matrix3d r_v = RotationFromZ(Eigen::Vector3d(v.x(), v.y(), 1.0).normalized());
  Eigen::Matrix<double, 2, 3> projection;
  projection << 1, 0, -v.x(), 0, 1, -v.y();
  const Eigen::Matrix2d b = projection * r_v.leftCols<2>();
  const Eigen::Matrix2d a = b.inverse() * j;
  // The largest singular value of a 2 x 2 matrix.
  const double half_sum = 0.5 * a.squaredNorm();
  const double determinant = a.determinant();
  const double gamma = std::sqrt(half_sum + std::sqrt(std::max(0.0, half_sum * half_sum - determinant * determinant)));
  if (!(gamma > 0) || !std::isfinite(gamma)) return {};
  const Eigen::Matrix2d r22 = a / gamma;
  const Eigen::Matrix2d gram = Eigen::Matrix2d::Identity() - r22.transpose() * r22;
  double r31 = std::sqrt(std::max(0.0, gram(0, 0)));
  double r32 = std::sqrt(std::max(0.0, gram(1, 1)));
  if (gram(0, 1) < 0) r32 = -r32;
  std::vector<Eigen::Matrix3d> rotations;
  for (const double sign : {1.0, -1.0}) {
    Eigen::Vector3d first(r22(0, 0), r22(1, 0), sign * r31);
    Eigen::Vector3d second(r22(0, 1), r22(1, 1), sign * r32);
    Eigen::Matrix3d rotation;
    rotation << first, second, first.cross(second);
    rotations.push_back(r_v * NearestRotation(rotation));
  }
  return rotations;
}

// Returns the translation that moves the points to their rays, by linear least squares; `normalised` are x / z and y
// / z.
Eigen::Vector3d TranslationOnRays(const Eigen::Matrix3d& rotation, const Points3& points, const Points2& normalised) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    Eigen::Matrix<double, 2, 3> projection;
    projection << 1, 0, -normalised(0, i), 0, 1, -normalised(1, i);
    normal += projection.transpose() * projection;
    right -= projection.transpose() * (projection * (rotation * points.col(i)));
  }
  return SolveSymmetric(normal, right);
}

// Returns the inverse, or nothing if the information is singular up to round-off.
std::optional<Matrix6> CovarianceOf(const Matrix6& information) {
  if ((information.diagonal().array() <= 0).any()) return std::nullopt;
  // Scaled before factorisation because metres and radians are mixed.
  const Tangent6 scale = information.diagonal().cwiseSqrt().cwiseInverse();
  const Matrix6 scaled = scale.asDiagonal() * information * scale.asDiagonal();
  const auto root = Cholesky(scaled);
  if (!root) return std::nullopt;
  const Matrix6 inverse_root = InverseOfLower(root->lower());
  // The trace of the inverse is at most six times its largest eigenvalue.
  constexpr double kOpen = 1e-12;
  if (!(inverse_root.squaredNorm() < 1 / kOpen)) return std::nullopt;
  const Matrix6 inverse_scaled = inverse_root * scale.asDiagonal();
  return Matrix6(inverse_scaled.transpose().lazyProduct(inverse_scaled));
}

// A pose and the normal equations of the view there.
struct PoseInView {
  Rigid3d camera_from_target;
  Matrix6 normal;
  Tangent6 gradient;
  double cost = 0;
};

// Computes the normal equations of a view for its pose only.
class PoseReducer {
 public:
  PoseReducer(const Camera& camera, const Observations& observations)
      : camera_(camera),
        observations_(observations),
        reducer_(camera.Model(), FreeParameters(camera.params.size(), false), 1.0, LossOf(LossKind::kNone)) {}

  std::optional<PoseInView> At(const Rigid3d& camera_from_target) const {
    ViewNormalEquations products;
    if (!reducer_.Multiply(camera_.params.data(), camera_from_target, observations_, nullptr, &products)) {
      return std::nullopt;
    }
    return PoseInView{camera_from_target, products.matrix.topLeftCorner<6, 6>(), products.matrix.col(6).head<6>(),
                      products.matrix(6, 6)};
  }

 private:
  const Camera& camera_;
  const Observations& observations_;
  ViewReducer reducer_;
};

// Refines the six parameters of the pose until a step decreases the cost by less than the fraction `small_drop`.
PoseInView Refined(const PoseReducer& reducer, PoseInView here, double small_drop) {
  LevenbergMarquardtOptions options;
  options.initial_damping = 1e-6;
  options.most_damping = 1e4;
  options.small_drop = small_drop;
  const auto try_step = [&](const PoseInView& from, const Tangent6& step) {
    return reducer.At(Rigid3d(ExpRotation(step.tail<3>()), step.head<3>()) * from.camera_from_target);
  };
  MinimiseSquares(options, try_step, &here);
  return here;
}

double RmsPxOf(const Camera& camera, const Observations& observations, const Rigid3d& camera_from_target) {
  const std::optional<SquaredErrors> errors = ViewErrors(camera, camera_from_target, observations);
  CHECK(errors.has_value());
  return *errors->RmsPx();
}

// Returns the two solutions for a plane, or none in the cases listed at EstimateTargetPose.
std::vector<PoseInView> StartPoses(const PoseReducer& reducer, const Camera& camera, const Observations& observations) {
  const int n = observations.size();
  if (n < 4) return {};
  // The rays are rotated such that their mean is along z, so that x / z and y / z remain small for fisheye lenses,
  // too.
  Eigen::Matrix3Xd rays(3, n);
  for (int i = 0; i < n; ++i) {
    const std::optional<Eigen::Vector3d> ray = UnprojectPixel(camera, observations.pixels.col(i));
    if (!ray) return {};
    rays.col(i) = *ray;
  }
  const Eigen::Vector3d mean_ray = rays.rowwise().mean();
  if (mean_ray.norm() < 1e-3) return {};
  const Eigen::Matrix3d camera_from_rotated = RotationFromZ(mean_ray.normalized());
  const Eigen::Matrix3Xd rotated = camera_from_rotated.transpose() * rays;
  if ((rotated.row(2).array() < 0.05).any()) return {};
  Points2 normalised(2, n);
  normalised.row(0) = rotated.row(0).cwiseQuotient(rotated.row(2));
  normalised.row(1) = rotated.row(1).cwiseQuotient(rotated.row(2));

  // The origin of the plane is moved to the centre of the points, where the homography is most accurate.
  const Eigen::Vector3d centre = observations.points_in_target.rowwise().mean();
  const Points3 centred = observations.points_in_target.colwise() - centre;
  if (!(centred.row(2).cwiseAbs().maxCoeff() <= 0.1 * centred.topRows<2>().cwiseAbs().maxCoeff())) return {};
  const std::optional<Eigen::Matrix3d> homography = LinearHomography(centred.topRows<2>(), normalised);
  if (!homography || std::abs((*homography)(2, 2)) < 1e-12) return {};

  std::vector<PoseInView> poses;
  for (const Eigen::Matrix3d& rotation : PlaneRotations(*homography)) {
    const Rigid3d rotated_from_centred(rotation, TranslationOnRays(rotation, centred, normalised));
    const Rigid3d pose = Rigid3d(camera_from_rotated, Eigen::Vector3d::Zero()) * rotated_from_centred *
                         Rigid3d(Eigen::Quaterniond::Identity(), -centre);
    if (!pose.translation.allFinite() || !pose.rotation.coeffs().allFinite()) continue;
    std::optional<PoseInView> in_view = reducer.At(pose);
    if (in_view) poses.push_back(std::move(*in_view));
  }
  return poses;
}

}  // namespace

std::vector<TargetPose> EstimateTargetPose(const Camera& camera, const Observations& observations) {
  constexpr double kExact = 1e-10;
  const PoseReducer reducer(camera, observations);
  std::vector<TargetPose> poses;
  for (PoseInView& start : StartPoses(reducer, camera, observations)) {
    const PoseInView refined = Refined(reducer, std::move(start), kExact);
    const Rigid3d& pose = refined.camera_from_target;
    const bool known = std::any_of(poses.begin(), poses.end(), [&](const TargetPose& other) {
      return AngleRad(other.camera_from_target, pose) < DegToRad(0.05);
    });
    if (known) continue;
    poses.push_back({pose, RmsPxOf(camera, observations, pose), CovarianceOf(refined.normal)});
  }
  std::sort(poses.begin(), poses.end(), [](const TargetPose& a, const TargetPose& b) { return a.rms_px < b.rms_px; });
  return poses;
}

std::optional<TargetPose> EstimateRoughPose(const Camera& camera, const Observations& observations) {
  constexpr double kRough = 1e-3;
  const PoseReducer reducer(camera, observations);
  std::vector<PoseInView> poses = StartPoses(reducer, camera, observations);
  if (poses.empty()) return std::nullopt;
  const auto by_cost = [](const PoseInView& a, const PoseInView& b) { return a.cost < b.cost; };
  std::sort(poses.begin(), poses.end(), by_cost);
  // An initial guess whose cost is this factor larger will not lead to the better minimum.
  constexpr double kFarWorse = 10;
  if (poses.size() > 1 && poses[1].cost > kFarWorse * poses[0].cost) poses.resize(1);
  for (PoseInView& pose : poses) pose = Refined(reducer, std::move(pose), kRough);
  const Rigid3d& best = std::min_element(poses.begin(), poses.end(), by_cost)->camera_from_target;
  return TargetPose{best, RmsPxOf(camera, observations, best)};
}

}  // namespace heba
