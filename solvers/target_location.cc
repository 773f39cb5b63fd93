#include "solvers/target_location.h"

#include <algorithm>

#include <Eigen/Cholesky>

#include "heba/data/prediction.h"
#include "solvers/target_pose.h"

namespace heba {
Outcome<LocatedTarget> LocateTarget(Setup setup, const Solution& solution, const Observations& observations,
                                    const Rigid3d& base_from_camera_mount) {
  const Observations shaped = Shaped(observations, solution.shape);
  const std::vector<TargetPose> poses = EstimateTargetPose(solution.camera, shaped);
  if (poses.empty() || !poses.front().covariance_at_1px) {
    return Failure{"the " + std::to_string(observations.size()) +
                   " points that were seen do not tell the target's pose"};
  }
  const TargetPose& pose = poses.front();
  const Rigid3d base_from_camera = base_from_camera_mount * solution.hand_eye.camera_mount_from_camera;
  LocatedTarget located;
  located.base_from_target = base_from_camera * pose.camera_from_target;
  located.rms_px = pose.rms_px;

  const Eigen::Vector3d in_camera = pose.camera_from_target * shaped.points_in_target.rowwise().mean();
  const Eigen::Matrix<double, 3, 6> by_motion = PointByMotion(in_camera);
  const Eigen::Matrix3d rotation = base_from_camera.RotationMatrix();
  const double variance_px2 = solution.pixel_sigma_px * solution.pixel_sigma_px;
  located.by_picture_m2 =
      variance_px2 * rotation * by_motion * *pose.covariance_at_1px * by_motion.transpose() * rotation.transpose();

  // The intrinsics are wrong by what they are for the calibration as well, and the pose seen by them is wrong with
  // them.
  Points2 pixels;
  ProjectionJacobian jacobian;
  if (!Predict(solution.camera.Model(), solution.camera.params.data(), pose.camera_from_target, shaped, &pixels,
               &jacobian)) {
    return Failure{"the target has no image where it was found"};
  }
  const Eigen::MatrixXd all_u = jacobian.u.transpose();
  const Eigen::MatrixXd all_v = jacobian.v.transpose();
  const Eigen::MatrixXd normal =
      all_u.transpose() * all_u + all_v.transpose() * all_v;  // By the pose's six and the camera's parameters.
  const Eigen::Index num_params = normal.cols() - 6;
  const Eigen::MatrixXd pose_by_params = -normal.topLeftCorner<6, 6>().ldlt().solve(normal.block(0, 6, 6, num_params));
  const Covariance& covariance = solution.covariance;
  Eigen::MatrixXd by_unknowns = Eigen::MatrixXd::Zero(3, covariance.matrix.cols());
  by_unknowns.leftCols<6>() = by_motion;
  const std::vector<std::string>& names = solution.camera.Model().param_names();
  for (size_t k = 0; k < names.size(); ++k) {
    const auto found = std::find(covariance.names.begin(), covariance.names.end(), "camera." + names[k]);
    if (found == covariance.names.end()) continue;
    by_unknowns.col(found - covariance.names.begin()) = by_motion * pose_by_params.col(static_cast<Eigen::Index>(k));
  }
  located.by_calibration_m2 =
      rotation * by_unknowns * covariance.matrix * by_unknowns.transpose() * rotation.transpose();

  if (setup == Setup::kEyeInHand && solution.robot_noise) {
    const Eigen::Vector3d in_gripper = solution.hand_eye.camera_mount_from_camera * in_camera;
    const double t = solution.robot_noise->translation_m;
    const double r = solution.robot_noise->rotation_rad;
    Tangent6 variances;
    variances << Eigen::Vector3d::Constant(t * t), Eigen::Vector3d::Constant(r * r);
    const Eigen::Matrix<double, 3, 6> by_gripper = base_from_camera_mount.RotationMatrix() * PointByMotion(in_gripper);
    located.by_robot_m2 = by_gripper * variances.asDiagonal() * by_gripper.transpose();
  }
  return located;
}

}  // namespace heba
