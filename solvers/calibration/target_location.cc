#include "heba/target_location.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/LU>

#include "heba/base/factorisation.h"
#include "heba/data/prediction.h"
#include "solvers/initial/target_pose.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// The pose of a target in an image, with its derivative (a left perturbation) by the camera's parameters.
struct SeenPose {
  TargetPose pose;
  Eigen::MatrixXd by_params;
};

Outcome<SeenPose> LocatePose(const Solution& solution, const Observations& shaped) {
  const std::vector<TargetPose> poses = EstimateTargetPose(solution.camera, shaped);
  if (poses.empty() || !poses.front().covariance_at_1px) {
    return Failure{"the " + std::to_string(shaped.size()) + " visible points do not determine the target's pose"};
  }
  Points2 pixels;
  ProjectionJacobian jacobian;
  if (!Predict(solution.camera.Model(), solution.camera.params.data(), poses.front().camera_from_target, shaped,
               &pixels, &jacobian)) {
    return Failure{"the target cannot be projected at its estimated pose"};
  }
  const Eigen::MatrixXd all_u = jacobian.u.transpose();
  const Eigen::MatrixXd all_v = jacobian.v.transpose();
  const Eigen::MatrixXd normal =
      // Normal matrix of the six pose and the camera's parameters.
      all_u.transpose() * all_u + all_v.transpose() * all_v;
  const Eigen::Index num_params = normal.cols() - 6;
  return SeenPose{poses.front(), -SolveSymmetric(normal.topLeftCorner<6, 6>(), normal.block(0, 6, 6, num_params))};
}

using Matrix6 = Eigen::Matrix<double, 6, 6>;

// Returns the derivatives by the solution's unknowns from those by all parameters of the camera.
Eigen::MatrixXd ByUnknowns(const Solution& solution, const Eigen::MatrixXd& by_params) {
  const Covariance& covariance = solution.covariance;
  Eigen::MatrixXd by_unknowns = Eigen::MatrixXd::Zero(by_params.rows(), covariance.matrix.cols());
  const UnknownBlock camera = covariance.layout.Block(kCameraBlock);
  for (Eigen::Index i = camera.first; i < camera.end(); ++i) {
    by_unknowns.col(i) = by_params.col(covariance.layout[i].index);
  }
  return by_unknowns;
}

// Returns the covariance of a motion, along and about the base's axes, that the noise of a robot pose causes, with that
// of its joints if they are known; zero if the robot is exact. Smooth errors that were not corrected are noise, too.
Matrix6 NoiseOfRobot(const Solution& solution, const StatedPose& stated, const Rigid3d& base_from_gripper) {
  if (!solution.robot_noise) return Matrix6::Zero();
  Matrix6 covariance = CorrectionVariances(*solution.robot_noise).asDiagonal();
  const double joint_rad = solution.robot_noise->joint_rad;
  covariance += joint_rad * joint_rad * stated.gripper_by_joints * stated.gripper_by_joints.transpose();
  const bool is_corrected = solution.shared_effects != nullptr && stated.effect != nullptr;
  if (solution.smooth_noise && !is_corrected) covariance.diagonal() += CorrectionVariances(*solution.smooth_noise);
  const Matrix6 adjoint = Adjoint(base_from_gripper);
  return adjoint * covariance * adjoint.transpose();
}

// The pose of the camera, and its uncertainty without the image's.
struct PlacedCamera {
  Rigid3d base_from_camera;
  MotionUncertainty motion;
};

PlacedCamera PlaceCamera(Setup setup, const Solution& solution, const StatedPose& camera_mount) {
  const CorrectedPose mount = Correct(solution, camera_mount);
  PlacedCamera placed{mount.base_from_mount * solution.hand_eye.camera_mount_from_camera, {}};
  MotionUncertainty& motion = placed.motion;
  motion.by_unknowns = Adjoint(mount.base_from_mount) * mount.by_unknowns;
  motion.by_unknowns.middleCols<6>(solution.covariance.layout.Block(kHandEyeBlock).first) +=
      Adjoint(placed.base_from_camera);
  if (setup == Setup::kEyeInHand) motion.by_robot = NoiseOfRobot(solution, camera_mount, mount.base_from_mount);
  return placed;
}

// Returns the covariance of a point that moves with the frame.
PositionCovariance CovarianceOfPoint(const Solution& solution, const MotionUncertainty& motion,
                                     const Eigen::Vector3d& in_base) {
  const Eigen::Matrix<double, 3, 6> by_motion = PointByMotion(in_base);
  const Eigen::MatrixXd by_unknowns = by_motion * motion.by_unknowns;
  return {by_unknowns * solution.covariance.matrix * by_unknowns.transpose(),
          by_motion * motion.by_image * by_motion.transpose(), by_motion * motion.by_robot * by_motion.transpose()};
}

// A point in the camera frame and its derivatives.
struct PositionSensitivity {
  Eigen::Vector3d in_camera = Eigen::Vector3d::Zero();
  // Covariance due to pixel noise of 1 px in the image.
  Eigen::Matrix3d by_image_at_1px_m2 = Eigen::Matrix3d::Zero();
  Eigen::MatrixXd by_params;  // Derivative by the camera's parameters.
  // Derivative of the point in the base by the camera's translation: the identity, or the projector along the ray if
  // the point lies on a plane that is fixed in the base.
  Eigen::Matrix3d with_camera = Eigen::Matrix3d::Identity();
};

// Returns the covariance with zeros for variances that only rounding made negative: along the normal of a plane that
// stands still, a position has no variance.
Eigen::Matrix3d WithoutRounding(Eigen::Matrix3d covariance) {
  constexpr double kRounding = 1e-12;
  const double least = -kRounding * covariance.trace();
  for (Eigen::Index i = 0; i < 3; ++i) {
    if (covariance(i, i) < 0 && covariance(i, i) >= least) covariance(i, i) = 0;
  }
  return covariance;
}

LocatedPoint PointInBase(Setup setup, const Solution& solution, const PositionSensitivity& place,
                         const StatedPose& camera_mount) {
  const PlacedCamera camera = PlaceCamera(setup, solution, camera_mount);
  const Eigen::Matrix3d rotation = camera.base_from_camera.RotationMatrix();
  LocatedPoint point;
  point.in_base = camera.base_from_camera * place.in_camera;
  const Eigen::Matrix<double, 3, 6> by_camera =
      rotation * place.with_camera * rotation.transpose() * PointByMotion(point.in_base);
  // The intrinsics that locate the point are those of the calibration, so their errors are correlated with the
  // hand-eye pose.
  const Eigen::MatrixXd by_unknowns =
      by_camera * camera.motion.by_unknowns + rotation * ByUnknowns(solution, place.by_params);
  const double variance_px2 = solution.pixel_sigma_px * solution.pixel_sigma_px;
  point.covariance.by_image_m2 =
      WithoutRounding(variance_px2 * rotation * place.by_image_at_1px_m2 * rotation.transpose());
  point.covariance.by_calibration_m2 =
      WithoutRounding(by_unknowns * solution.covariance.matrix * by_unknowns.transpose());
  point.covariance.by_robot_m2 = WithoutRounding(by_camera * camera.motion.by_robot * by_camera.transpose());
  return point;
}

// The intersection of a ray with a plane in the camera frame, and its derivatives.
struct RayPlaneIntersection {
  Eigen::Vector3d in_camera = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, 3, 2> by_pixel;
  Eigen::Vector3d by_plane = Eigen::Vector3d::Zero();  // Derivative by a shift of the plane along its normal.
  Eigen::MatrixXd by_params;
};

Outcome<RayPlaneIntersection> IntersectRayPlane(const Camera& camera, const Eigen::Vector2d& pixel,
                                                const Eigen::Vector3d& normal, double distance_m) {
  const std::optional<Eigen::Vector3d> ray = UnprojectPixel(camera, pixel);
  if (!ray) return Failure{"no ray belongs to this pixel"};
  constexpr double kGrazing = 1e-3;
  const double slope = normal.dot(*ray);
  const double range_m = distance_m / slope;
  if (std::abs(slope) < kGrazing || !(range_m > 0)) return Failure{"its ray does not meet the plane"};
  RayPlaneIntersection meeting;
  meeting.in_camera = range_m * *ray;
  Points3 point(3, 1);
  point = meeting.in_camera;
  Points2 image;
  ProjectionJacobian jacobian;
  if (!camera.Model().Project(camera.params.data(), point, &image, &jacobian)) {
    return Failure{"its ray does not meet the plane in front of the camera"};
  }
  // The point stays on its ray and on the plane: its two pixel coordinates and its distance along the normal determine
  // it.
  Eigen::Matrix3d left;
  left.row(0) = jacobian.u.topRows<3>().transpose();
  left.row(1) = jacobian.v.topRows<3>().transpose();
  left.row(2) = normal.transpose();
  const Eigen::Matrix3d inverse = left.inverse();
  meeting.by_pixel = inverse.leftCols<2>();
  meeting.by_plane = inverse.col(2);
  const Eigen::Index num_params = jacobian.u.rows() - 3;
  meeting.by_params = -meeting.by_pixel.col(0) * jacobian.u.bottomRows(num_params).transpose() -
                      meeting.by_pixel.col(1) * jacobian.v.bottomRows(num_params).transpose();
  return meeting;
}

}  // namespace

Outcome<LocatedTarget> LocateTarget(Setup setup, const Solution& solution, const Observations& observations,
                                    const StatedPose& camera_mount) {
  const Observations shaped = ApplyShape(observations, solution.shape);
  const Outcome<SeenPose> seen = LocatePose(solution, shaped);
  if (!seen) return Failure{seen.reason()};
  const TargetPose& pose = seen->pose;
  PlacedCamera camera = PlaceCamera(setup, solution, camera_mount);
  LocatedTarget located;
  located.base_from_target = camera.base_from_camera * pose.camera_from_target;
  located.rms_px = pose.rms_px;
  located.motion = std::move(camera.motion);
  // The intrinsics that locate the target are those of the calibration, so their errors are correlated with the
  // hand-eye pose.
  const Matrix6 adjoint = Adjoint(camera.base_from_camera);
  located.motion.by_unknowns += adjoint * ByUnknowns(solution, seen->by_params);
  const double variance_px2 = solution.pixel_sigma_px * solution.pixel_sigma_px;
  located.motion.by_image = variance_px2 * adjoint * *pose.covariance_at_1px * adjoint.transpose();
  const Eigen::Vector3d middle = shaped.points_in_target.rowwise().mean();
  located.covariance = CovarianceOfPoint(solution, located.motion, located.base_from_target * middle);
  return located;
}

PositionCovariance CovarianceOfReach(const Solution& solution, const LocatedTarget& located, const StatedPose& command,
                                     const Eigen::Vector3d& point_in_gripper, const Eigen::Vector3d& point_in_target) {
  const CorrectedPose gripper = Correct(solution, command);
  const Eigen::Matrix<double, 3, 6> by_gripper = PointByMotion(gripper.base_from_mount * point_in_gripper);
  const Eigen::Matrix<double, 3, 6> by_target = PointByMotion(located.base_from_target * point_in_target);
  const Eigen::MatrixXd by_unknowns =
      by_gripper * Adjoint(gripper.base_from_mount) * gripper.by_unknowns - by_target * located.motion.by_unknowns;
  return {by_unknowns * solution.covariance.matrix * by_unknowns.transpose(),
          by_target * located.motion.by_image * by_target.transpose(),
          by_target * located.motion.by_robot * by_target.transpose() +
              by_gripper * NoiseOfRobot(solution, command, gripper.base_from_mount) * by_gripper.transpose()};
}

Outcome<std::vector<LocatedTarget>> LocateSymmetricTarget(Setup setup, const Solution& solution,
                                                          const Observations& observations,
                                                          const std::vector<Rigid3d>& symmetries,
                                                          const StatedPose& camera_mount) {
  std::vector<LocatedTarget> possible;
  for (const Rigid3d& symmetry : symmetries) {
    // The target as manufactured need not have exactly the symmetries of its design (its scale acts about its origin),
    // so each reading order is located by itself.
    Observations reading = observations;
    for (Eigen::Index i = 0; i < reading.size(); ++i) {
      const Eigen::Vector3d designed = observations.points_in_target.col(i);
      reading.points_in_target.col(i) = symmetry * designed;
    }
    Outcome<LocatedTarget> located = LocateTarget(setup, solution, reading, camera_mount);
    if (!located) return Failure{located.reason()};
    possible.push_back(std::move(*located));
  }
  const auto x_axis = [](const LocatedTarget& located) -> Eigen::Vector3d {
    return located.base_from_target.rotation * Eigen::Vector3d::UnitX();
  };
  std::sort(possible.begin(), possible.end(),
            [&](const LocatedTarget& a, const LocatedTarget& b) { return x_axis(a).x() > x_axis(b).x(); });
  return possible;
}

double LeastDistanceM(const std::vector<Rigid3d>& possible) {
  double least_m = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < possible.size(); ++i) {
    for (size_t k = 0; k < i; ++k) {
      least_m = std::min(least_m, DistanceM(possible[i], possible[k]));
    }
  }
  return std::isfinite(least_m) ? least_m : 0;
}

std::optional<size_t> FindMeantPose(const std::vector<Rigid3d>& possible, const Rigid3d& rough) {
  if (possible.size() < 2) return possible.empty() ? std::nullopt : std::optional<size_t>(0);
  std::vector<std::pair<double, size_t>> by_angle;
  std::vector<std::pair<double, size_t>> by_distance;
  for (size_t i = 0; i < possible.size(); ++i) {
    by_angle.emplace_back(AngleRad(possible[i], rough), i);
    by_distance.emplace_back(DistanceM(possible[i], rough), i);
  }
  std::sort(by_angle.begin(), by_angle.end());
  std::sort(by_distance.begin(), by_distance.end());
  const auto [angle_rad, by_rotation] = by_angle[0];
  const auto [distance_m, by_position] = by_distance[0];
  const bool is_told_by_position = distance_m < kRoughPositionShare * LeastDistanceM(possible);
  const bool is_told_by_rotation =
      angle_rad <= kMaxRoughRotationRad && by_angle[1].first - angle_rad >= kMinRotationGapRad;
  if (!is_told_by_position) return is_told_by_rotation ? std::optional(by_rotation) : std::nullopt;
  const bool is_contradicted = is_told_by_rotation && by_rotation != by_position && angle_rad <= kCloseRotationRad;
  return is_contradicted ? std::nullopt : std::optional(by_position);
}

Outcome<LocatedPoint> LocatePixel(Setup setup, const Solution& solution, const Eigen::Vector2d& pixel,
                                  const Plane& plane, const StatedPose& camera_mount) {
  const Rigid3d base_from_camera =
      Correct(solution, camera_mount).base_from_mount * solution.hand_eye.camera_mount_from_camera;
  const Eigen::Vector3d normal = base_from_camera.rotation.conjugate() * plane.normal;
  const Outcome<RayPlaneIntersection> meeting = IntersectRayPlane(
      solution.camera, pixel, normal, plane.distance_m - plane.normal.dot(base_from_camera.translation));
  if (!meeting) return Failure{meeting.reason()};
  PositionSensitivity place;
  place.in_camera = meeting->in_camera;
  place.by_image_at_1px_m2 = meeting->by_pixel * meeting->by_pixel.transpose();
  place.by_params = meeting->by_params;
  // A motion of the camera moves the point along, and the plane, which is fixed in the base, moves it back along its
  // ray.
  place.with_camera -= meeting->by_plane * normal.transpose();
  return PointInBase(setup, solution, place, camera_mount);
}

Outcome<LocatedPoint> LocatePixelOnTarget(Setup setup, const Solution& solution, const Eigen::Vector2d& pixel,
                                          const Observations& observations, const StatedPose& camera_mount) {
  const Outcome<SeenPose> seen = LocatePose(solution, ApplyShape(observations, solution.shape));
  if (!seen) return Failure{seen.reason()};
  const Rigid3d& camera_from_target = seen->pose.camera_from_target;
  const Eigen::Vector3d normal = camera_from_target.rotation * Eigen::Vector3d::UnitZ();
  const Outcome<RayPlaneIntersection> meeting =
      IntersectRayPlane(solution.camera, pixel, normal, normal.dot(camera_from_target.translation));
  if (!meeting) return Failure{meeting.reason()};
  // The plane has the pose that the image shows.
  const Eigen::Matrix<double, 3, 6> by_pose =
      meeting->by_plane * normal.transpose() * PointByMotion(meeting->in_camera);
  PositionSensitivity place;
  place.in_camera = meeting->in_camera;
  place.by_image_at_1px_m2 =
      meeting->by_pixel * meeting->by_pixel.transpose() + by_pose * *seen->pose.covariance_at_1px * by_pose.transpose();
  place.by_params = meeting->by_params + by_pose * seen->by_params;
  return PointInBase(setup, solution, place, camera_mount);
}

}  // namespace heba
