#include "heba/target_location.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "heba/data/prediction.h"
#include "solvers/initial/target_pose.h"

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
  return SeenPose{poses.front(), -normal.topLeftCorner<6, 6>().ldlt().solve(normal.block(0, 6, 6, num_params))};
}

// Returns the derivative of a point in the camera frame by the solution's unknowns, from its derivatives by a motion
// of the camera frame and by the camera's parameters.
Eigen::MatrixXd ByUnknowns(const Solution& solution, const Eigen::Matrix<double, 3, 6>& by_motion,
                           const Eigen::MatrixXd& by_params) {
  const Covariance& covariance = solution.covariance;
  Eigen::MatrixXd by_unknowns = Eigen::MatrixXd::Zero(3, covariance.matrix.cols());
  by_unknowns.middleCols<6>(covariance.layout.Block(kHandEyeBlock).first) = by_motion;
  const UnknownBlock camera = covariance.layout.Block(kCameraBlock);
  for (Eigen::Index i = camera.first; i < camera.end(); ++i) {
    by_unknowns.col(i) = by_params.col(covariance.layout[i].index);
  }
  return by_unknowns;
}

// Returns the variances of a motion of the gripper in its own frame; zero if the camera is stationary or the robot
// exact.
Tangent6 RobotVariances(Setup setup, const Solution& solution) {
  Tangent6 variances = Tangent6::Zero();
  if (setup != Setup::kEyeInHand || !solution.robot_noise) return variances;
  const double t = solution.robot_noise->translation_m;
  const double r = solution.robot_noise->rotation_rad;
  variances << Eigen::Vector3d::Constant(t * t), Eigen::Vector3d::Constant(r * r);
  return variances;
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

PositionCovariance CovarianceInBase(Setup setup, const Solution& solution, const PositionSensitivity& place,
                                    const Rigid3d& base_from_camera_mount) {
  const Rigid3d& camera_mount_from_camera = solution.hand_eye.camera_mount_from_camera;
  const Eigen::Matrix3d mount = base_from_camera_mount.RotationMatrix();
  const Eigen::Matrix3d rotation = mount * camera_mount_from_camera.RotationMatrix();
  PositionCovariance covariance;
  const double variance_px2 = solution.pixel_sigma_px * solution.pixel_sigma_px;
  covariance.by_image_m2 = variance_px2 * rotation * place.by_image_at_1px_m2 * rotation.transpose();
  // The intrinsics that locate the point are those of the calibration, so their errors are correlated with the
  // hand-eye pose.
  const Eigen::MatrixXd by_unknowns =
      rotation * ByUnknowns(solution, place.with_camera * PointByMotion(place.in_camera), place.by_params);
  covariance.by_calibration_m2 = by_unknowns * solution.covariance.matrix * by_unknowns.transpose();
  const Eigen::Matrix<double, 3, 6> by_gripper = rotation * place.with_camera * rotation.transpose() * mount *
                                                 PointByMotion(camera_mount_from_camera * place.in_camera);
  covariance.by_robot_m2 = by_gripper * RobotVariances(setup, solution).asDiagonal() * by_gripper.transpose();
  return covariance;
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
                                    const Rigid3d& base_from_camera_mount) {
  const Observations shaped = ApplyShape(observations, solution.shape);
  const Outcome<SeenPose> seen = LocatePose(solution, shaped);
  if (!seen) return Failure{seen.reason()};
  const TargetPose& pose = seen->pose;
  PositionSensitivity middle;
  middle.in_camera = pose.camera_from_target * shaped.points_in_target.rowwise().mean();
  const Eigen::Matrix<double, 3, 6> by_motion = PointByMotion(middle.in_camera);
  middle.by_image_at_1px_m2 = by_motion * *pose.covariance_at_1px * by_motion.transpose();
  middle.by_params = by_motion * seen->by_params;
  LocatedTarget located;
  located.base_from_target =
      base_from_camera_mount * solution.hand_eye.camera_mount_from_camera * pose.camera_from_target;
  located.rms_px = pose.rms_px;
  located.covariance = CovarianceInBase(setup, solution, middle, base_from_camera_mount);
  return located;
}

Outcome<std::vector<LocatedTarget>> LocateSymmetricTarget(Setup setup, const Solution& solution,
                                                          const Observations& observations,
                                                          const std::vector<Rigid3d>& symmetries,
                                                          const Rigid3d& base_from_camera_mount) {
  std::vector<LocatedTarget> possible;
  for (const Rigid3d& symmetry : symmetries) {
    // The target as manufactured need not have exactly the symmetries of its design (its scale acts about its origin),
    // so each reading order is located by itself.
    Observations reading = observations;
    for (Eigen::Index i = 0; i < reading.size(); ++i) {
      const Eigen::Vector3d designed = observations.points_in_target.col(i);
      reading.points_in_target.col(i) = symmetry * designed;
    }
    Outcome<LocatedTarget> located = LocateTarget(setup, solution, reading, base_from_camera_mount);
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

std::optional<size_t> FindMeantPose(const std::vector<LocatedTarget>& possible, const Rigid3d& rough) {
  std::vector<std::pair<double, size_t>> by_angle;
  for (size_t i = 0; i < possible.size(); ++i) {
    by_angle.emplace_back(AngleRad(possible[i].base_from_target, rough), i);
  }
  if (by_angle.empty()) return std::nullopt;
  std::sort(by_angle.begin(), by_angle.end());
  if (by_angle.size() > 1 && by_angle[1].first - by_angle[0].first < kMinRotationGapRad) return std::nullopt;
  return by_angle[0].second;
}

Outcome<LocatedPoint> LocatePixel(Setup setup, const Solution& solution, const Eigen::Vector2d& pixel,
                                  const Plane& plane, const Rigid3d& base_from_camera_mount) {
  const Rigid3d base_from_camera = base_from_camera_mount * solution.hand_eye.camera_mount_from_camera;
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
  return LocatedPoint{base_from_camera * place.in_camera,
                      CovarianceInBase(setup, solution, place, base_from_camera_mount)};
}

Outcome<LocatedPoint> LocatePixelOnTarget(Setup setup, const Solution& solution, const Eigen::Vector2d& pixel,
                                          const Observations& observations, const Rigid3d& base_from_camera_mount) {
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
  return LocatedPoint{base_from_camera_mount * solution.hand_eye.camera_mount_from_camera * place.in_camera,
                      CovarianceInBase(setup, solution, place, base_from_camera_mount)};
}

}  // namespace heba
