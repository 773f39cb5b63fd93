#include "tools/bench/textbook_refinement.h"

#include <array>

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include "heba/geometry/pose_block.h"

namespace heba {
namespace {

struct PointResidual {
  Eigen::Quaterniond mount_rotation;
  Eigen::Vector3d mount_translation;
  Eigen::Vector3d point;
  Eigen::Vector2d pixel;

  template <class T>
  bool operator()(const T* hand_eye_rotation, const T* hand_eye_translation, const T* board_rotation,
                  const T* board_translation, const T* camera, T* residual) const {
    using Quaternion = Eigen::Quaternion<T>;
    using Vector = Eigen::Matrix<T, 3, 1>;
    const Vector on_mount =
        Eigen::Map<const Quaternion>(board_rotation) * point.cast<T>() + Eigen::Map<const Vector>(board_translation);
    const Vector in_mount = mount_rotation.cast<T>() * on_mount + mount_translation.cast<T>();
    const Vector in_camera = Eigen::Map<const Quaternion>(hand_eye_rotation).conjugate() *
                             Vector(in_mount - Eigen::Map<const Vector>(hand_eye_translation));
    const T x = in_camera.x() / in_camera.z();
    const T y = in_camera.y() / in_camera.z();
    const T r2 = x * x + y * y;
    const T radial = T(1) + r2 * (camera[4] + r2 * (camera[5] + r2 * camera[8]));
    const T& p1 = camera[6];
    const T& p2 = camera[7];
    residual[0] = camera[0] * (x * radial + T(2) * p1 * x * y + p2 * (r2 + T(2) * x * x)) + camera[2] - T(pixel.x());
    residual[1] = camera[1] * (y * radial + p1 * (r2 + T(2) * y * y) + T(2) * p2 * x * y) + camera[3] - T(pixel.y());
    return true;
  }
};

}  // namespace

TextbookResult RefineAsInTextbooks(const PairProblem& problem, const HandEye& start) {
  TextbookResult result;
  result.camera = problem.camera;
  PoseBlock hand_eye = ToBlock(start.camera_mount_from_camera);
  PoseBlock board = ToBlock(start.target_mount_from_target);
  double* const camera = result.camera.params.data();
  ceres::Problem ceres_problem;
  for (const View& view : problem.views) {
    for (Eigen::Index i = 0; i < view.observations.size(); ++i) {
      auto* const residual = new PointResidual{
          view.camera_mount_from_target_mount.rotation, view.camera_mount_from_target_mount.translation,
          view.observations.points_in_target.col(i), view.observations.pixels.col(i)};
      ceres_problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PointResidual, 2, 4, 3, 4, 3, 9>(residual),
                                     nullptr, hand_eye.data(), hand_eye.data() + 4, board.data(), board.data() + 4,
                                     camera);
    }
  }
  ceres_problem.SetManifold(hand_eye.data(), new ceres::EigenQuaternionManifold);
  ceres_problem.SetManifold(board.data(), new ceres::EigenQuaternionManifold);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  options.max_num_iterations = 200;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &ceres_problem, &summary);
  result.hand_eye = {FromBlock(hand_eye.data()), FromBlock(board.data())};
  result.iterations = static_cast<int>(summary.iterations.size()) - 1;
  result.seconds = summary.total_time_in_seconds;
  result.converged = summary.termination_type == ceres::CONVERGENCE;
  return result;
}

}  // namespace heba
