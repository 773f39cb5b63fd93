// The robot's poses as observations: how their noise enters, and how large it is.
//
// Capture i sees the target from
//   camera_from_target = camera_from_camera_mount * M_i * Exp(xi_i) * target_mount_from_target   (eye-to-hand)
//   camera_from_target = camera_from_camera_mount * Exp(-xi_i) * M_i * target_mount_from_target  (eye-in-hand)
// with M_i = camera_mount_from_target_mount as the robot says and xi_i, in the gripper's frame, what it was wrong by.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heba/data/solution.h"
#include "heba/kernels/small_matrix.h"
#include "solvers/uncertainty/information.h"

namespace heba {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

// camera_from_target with a capture's correction, gripper_from_corrected_gripper.
Rigid3d CameraFromTarget(Setup setup, const HandEye& hand_eye, const Rigid3d& camera_mount_from_target_mount,
                         const Rigid3d& correction);

// The correction with which the function above gives `camera_from_target`.
Rigid3d CorrectionFor(Setup setup, const HandEye& hand_eye, const Rigid3d& camera_mount_from_target_mount,
                      const Rigid3d& camera_from_target);

// d (left perturbation of camera_from_target) / d (tangent of the correction).
Matrix6 LeftFromCorrection(Setup setup, const HandEye& hand_eye, const Rigid3d& camera_mount_from_target_mount,
                           const Rigid3d& correction);

// What the robot says of a capture's correction, that it is zero give or take `noise`: six whitened residuals, and
// their derivatives by the correction's tangent.
struct CorrectionPrior {
  Tangent6 residual = Tangent6::Zero();
  Matrix6 by_tangent = Matrix6::Zero();
};
CorrectionPrior CorrectionPriorAt(const Rigid3d& correction, const RobotNoise& noise);

// One capture, linearised: what it measured is offset = by_unknowns * step + by_correction * xi + noise, where noise
// has unit variance (pixel sigma and loss applied).
struct LinearisedView {
  Eigen::MatrixXd by_unknowns;                             // Columns as Information::names.
  Eigen::Matrix<double, Eigen::Dynamic, 6> by_correction;  // By xi: m, rad.
  Eigen::VectorXd offset;
  // The last so many rows have nothing that a correction moves.
  Eigen::Index num_rows_without_correction = 0;
  // What the rows above leave of the pixels: so many more independent residuals with this sum of squares.
  double residual_sum_of_squares = 0;
  int num_residual_dof = 0;
};

// `corrections` is empty if there are none. Nothing if a point has no image.
std::optional<std::vector<LinearisedView>> LineariseViews(const Problem& problem, const HandEye& hand_eye,
                                                          const std::vector<Rigid3d>& corrections,
                                                          const FreeParameters& free, double pixel_sigma_px,
                                                          const Loss& loss);

// The same of the problem's views at a solution, which has the camera, the target's shape and the points' weights.
std::optional<std::vector<LinearisedView>> LineariseViewsAt(const Problem& problem, const Solution& solution,
                                                            const std::vector<Rigid3d>& corrections,
                                                            const FreeParameters& free, const Loss& loss);

// The covariance of what a view measured when its correction is averaged over: p I + G Q G^T, p in the views' unit.
Eigen::MatrixXd MarginalCovariance(const LinearisedView& view, double pixel_variance, double translation_m2,
                                   double rotation_rad2);
// That covariance's inverse root times the view's rows by the unknowns and, as the last column, the offset.
RowMajorMatrix WhitenedRows(const LinearisedView& view, double pixel_variance, double translation_m2,
                            double rotation_rad2);

// The unknowns' normal matrix when the corrections are averaged over: sum J^T (p I + G Q G^T)^-1 J, where p is
// `pixel_variance` in the views' unit.
Eigen::MatrixXd MarginalInformation(const std::vector<LinearisedView>& views, const RobotNoise& noise,
                                    double pixel_variance);

// Of a vector as large or larger by chance, if it has this covariance with `dof` degrees of freedom, both in
// coordinates of like size: by Fisher's F over the directions whose variance is not below `nothing`; 1 if there is
// none.
double ChanceOf(const Tangent6& vector, const Matrix6& covariance, double nothing, double dof);

}  // namespace heba
