#include "solvers/uncertainty/robot_noise.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "heba/base/distributions.h"
#include "heba/base/error.h"
#include "heba/kernels/small_matrix.h"
#include "heba/kernels/stacked_rows.h"
#include "solvers/residuals/noise_scale.h"
#include "solvers/residuals/view_reduction.h"

namespace heba {
namespace {

// Returns p I + G Q G^T, where G is the first `rows` rows of the view's by_correction.
Eigen::MatrixXd CovarianceOfRows(const LinearisedView& view, Eigen::Index rows, double pixel_variance,
                                 double translation_m2, double rotation_rad2) {
  Tangent6 sigmas;
  sigmas << Eigen::Vector3d::Constant(std::sqrt(translation_m2)), Eigen::Vector3d::Constant(std::sqrt(rotation_rad2));
  const RowMajorMatrix by_sigmas = view.by_correction.topRows(rows) * sigmas.asDiagonal();
  Eigen::MatrixXd covariance = by_sigmas.lazyProduct(by_sigmas.transpose());
  covariance.diagonal().array() += pixel_variance;
  return covariance;
}

}  // namespace

Rigid3d CameraFromTarget(Setup setup, const HandEye& hand_eye, const Rigid3d& camera_mount_from_target_mount,
                         const Rigid3d& correction) {
  const Rigid3d corrected = setup == Setup::kEyeToHand ? camera_mount_from_target_mount * correction
                                                       : Inverse(correction) * camera_mount_from_target_mount;
  return CameraFromTarget(hand_eye, corrected);
}

Rigid3d CorrectionFor(Setup setup, const HandEye& hand_eye, const Rigid3d& camera_mount_from_target_mount,
                      const Rigid3d& camera_from_target) {
  const Rigid3d corrected =
      hand_eye.camera_mount_from_camera * camera_from_target * Inverse(hand_eye.target_mount_from_target);
  return Inverse(BaseFromGripper(setup, camera_mount_from_target_mount)) * BaseFromGripper(setup, corrected);
}

Matrix6 LeftFromCorrection(Setup setup, const HandEye& hand_eye, const Rigid3d& camera_mount_from_target_mount,
                           const Rigid3d& correction) {
  const Rigid3d camera_from_camera_mount = Inverse(hand_eye.camera_mount_from_camera);
  if (setup == Setup::kEyeInHand) return -Adjoint(camera_from_camera_mount);
  return Adjoint(camera_from_camera_mount * camera_mount_from_target_mount * correction);
}

CorrectionPrior CorrectionPriorAt(const Rigid3d& correction, const RobotNoise& noise) {
  CorrectionPrior prior;
  const Tangent6 tangent = LocalCoordinates(Rigid3d(), correction);
  prior.residual.head<3>() = tangent.head<3>() / noise.translation_m;
  prior.residual.tail<3>() = tangent.tail<3>() / noise.rotation_rad;
  prior.by_tangent.topLeftCorner<3, 3>() = correction.RotationMatrix() / noise.translation_m;
  // The inverse right Jacobian of the rotation vector to second order; corrections are small.
  const Eigen::Matrix3d skew = Skew(tangent.tail<3>());
  prior.by_tangent.bottomRightCorner<3, 3>() =
      (Eigen::Matrix3d::Identity() + 0.5 * skew + skew * skew / 12) / noise.rotation_rad;
  return prior;
}

std::optional<std::vector<LinearisedView>> LineariseViews(const Problem& problem, const HandEye& hand_eye,
                                                          const std::vector<Rigid3d>& corrections,
                                                          const FreeParameters& free, double pixel_sigma_px,
                                                          const Loss& loss) {
  const CameraModel& model = problem.camera.Model();
  const Eigen::Index num_unknowns = 12 + NumFree(free);
  const ViewReducer reducer(model, free, pixel_sigma_px, loss);
  std::vector<LinearisedView> result;
  for (size_t v = 0; v < problem.views.size(); ++v) {
    const View& view = problem.views[v];
    const Rigid3d correction = corrections.empty() ? Rigid3d() : corrections[v];
    const Rigid3d& mount = view.camera_mount_from_target_mount;
    const Rigid3d camera_from_target = CameraFromTarget(problem.setup, hand_eye, mount, correction);
    SquareRootInformation reduction;
    if (!reducer.Reduce(problem.camera.params.data(), camera_from_target, view.observations,
                        HasShape(free, model) ? &problem.shape : nullptr, &reduction)) {
      return std::nullopt;
    }
    LinearisedView linear;
    const Eigen::Index columns = reduction.factor.cols() - 1;
    Eigen::Index rows = reduction.factor.rows();
    Eigen::Index num_rows_with_correction = rows;
    if (2 * view.observations.size() > rows) {
      // The factor is square: its last row contains only the residual that no unknown can explain.
      rows = columns;
      num_rows_with_correction = 6;
      linear.residual_sum_of_squares = reduction.factor(columns, columns) * reduction.factor(columns, columns);
      linear.num_residual_dof = 2 * view.observations.size() - static_cast<int>(columns);
    }
    linear.num_rows_without_correction = rows - num_rows_with_correction;
    const auto by_pose = reduction.factor.topLeftCorner(num_rows_with_correction, 6);
    linear.by_unknowns.setZero(rows, num_unknowns);
    // by_unknowns is the negated derivative of the residual, which is -by_pose with respect to the hand-eye pose.
    linear.by_unknowns.topLeftCorner(num_rows_with_correction, 6) = by_pose;
    linear.by_unknowns.block(0, 6, num_rows_with_correction, 6) = -by_pose.lazyProduct(Adjoint(camera_from_target));
    linear.by_unknowns.rightCols(num_unknowns - 12) = -reduction.factor.block(0, 6, rows, num_unknowns - 12);
    linear.by_correction.setZero(rows, 6);
    linear.by_correction.topRows(num_rows_with_correction) =
        -by_pose.lazyProduct(LeftFromCorrection(problem.setup, hand_eye, mount, correction));
    // The residual as it would be without the correction.
    linear.offset = reduction.factor.col(columns).head(rows) +
                    linear.by_correction.lazyProduct(LocalCoordinates(Rigid3d(), correction));
    result.push_back(std::move(linear));
  }
  return result;
}

std::optional<std::vector<LinearisedView>> LineariseViewsAt(const Problem& problem, const Solution& solution,
                                                            const std::vector<Rigid3d>& corrections,
                                                            const FreeParameters& free, const Loss& loss) {
  Problem weighted{solution.camera, problem.views, problem.setup, solution.shape};
  if (solution.unmodelled_sigma_px) WeightByCovariance(*solution.unmodelled_sigma_px, &weighted.views);
  return LineariseViews(weighted, solution.hand_eye, corrections, free, solution.pixel_sigma_px, loss);
}

Eigen::MatrixXd MarginalCovariance(const LinearisedView& view, double pixel_variance, double translation_m2,
                                   double rotation_rad2) {
  return CovarianceOfRows(view, view.offset.size(), pixel_variance, translation_m2, rotation_rad2);
}

RowMajorMatrix WhitenedRows(const LinearisedView& view, double pixel_variance, double translation_m2,
                            double rotation_rad2) {
  const Eigen::Index n = view.by_unknowns.cols();
  const Eigen::Index num_rows_with_correction = view.offset.size() - view.num_rows_without_correction;
  RowMajorMatrix correction_dependent(num_rows_with_correction, n + 1);
  correction_dependent << view.by_unknowns.topRows(num_rows_with_correction),
      view.offset.head(num_rows_with_correction);
  const Eigen::LLT<Eigen::MatrixXd> root(
      CovarianceOfRows(view, num_rows_with_correction, pixel_variance, translation_m2, rotation_rad2));
  CHECK(root.info() == Eigen::Success);
  SolveLowerInPlace(root.matrixLLT(), &correction_dependent);
  const double root_weight = 1 / std::sqrt(pixel_variance);
  RowMajorMatrix whitened(view.offset.size(), n + 1);
  whitened.topRows(num_rows_with_correction) = correction_dependent;
  whitened.bottomLeftCorner(view.num_rows_without_correction, n) =
      root_weight * view.by_unknowns.bottomRows(view.num_rows_without_correction);
  whitened.bottomRightCorner(view.num_rows_without_correction, 1) =
      root_weight * view.offset.tail(view.num_rows_without_correction);
  return whitened;
}

double ChanceOf(const Tangent6& vector, const Matrix6& covariance, double nothing, double dof) {
  const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(covariance);
  const Tangent6 along = eigen.eigenvectors().transpose() * vector;
  double statistic = 0;
  int rank = 0;
  for (int i = 0; i < 6; ++i) {
    if (eigen.eigenvalues()[i] < nothing) continue;
    statistic += along[i] * along[i] / eigen.eigenvalues()[i];
    ++rank;
  }
  return rank == 0 ? 1 : FisherTail(statistic / rank, rank, dof);
}

Eigen::MatrixXd MarginalInformation(const std::vector<LinearisedView>& views, const RobotNoise& noise,
                                    double pixel_variance) {
  const Eigen::Index n = views.front().by_unknowns.cols();
  StackedRows stacked(static_cast<int>(n));
  for (const LinearisedView& view : views) {
    stacked.Next<Eigen::Dynamic>(view.offset.size()) =
        WhitenedRows(view, pixel_variance, noise.translation_m * noise.translation_m,
                     noise.rotation_rad * noise.rotation_rad)
            .leftCols(n);
  }
  return stacked.Products();
}

}  // namespace heba
