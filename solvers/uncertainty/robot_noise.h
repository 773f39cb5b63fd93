// The robot poses as observations: how their noise enters the model, and what it leaves of the information.
//
// Capture i sees the target from
//   camera_from_target = camera_from_camera_mount * M_i * Exp(xi_i) * target_mount_from_target   (eye-to-hand)
//   camera_from_target = camera_from_camera_mount * Exp(-xi_i) * M_i * target_mount_from_target  (eye-in-hand)
// with M_i = camera_mount_from_target_mount as reported by the robot and xi_i its error, expressed in the gripper's
// frame. Equations (1) to (3), (10) and (12) of docs/estimation.md.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heba/data/pair_solution.h"
#include "heba/data/solution.h"
#include "heba/kernels/small_matrix.h"
#include "solvers/uncertainty/linearisation.h"
#include "solvers/uncertainty/variance_components.h"

namespace heba {

// Returns camera_from_target with a capture's correction, gripper_from_corrected_gripper.
Rigid3d CameraFromTarget(Setup setup, const HandEye& hand_eye, const Rigid3d& camera_mount_from_target_mount,
                         const Rigid3d& correction);

// Returns the correction for which the function above returns `camera_from_target`.
Rigid3d CorrectionFor(Setup setup, const HandEye& hand_eye, const Rigid3d& camera_mount_from_target_mount,
                      const Rigid3d& camera_from_target);

// Returns the variances of the columns of LinearisedView::by_effects that are a robot's correction: m^2 and rad^2 of
// its tangent, and those of the joints (rad^2) in the columns after them.
Eigen::VectorXd CorrectionVariances(const RobotNoise& noise, Eigen::Index num_columns = 6);

// Returns the noise of an arm at another pose than those of the captures: its smooth errors, which are not known there,
// are noise, too. It is zero for an exact arm.
RobotNoise NoiseElsewhere(const Solution& solution, size_t robot);

// The sigmas of industrial arms: 95 % of them lie between these bounds.
inline constexpr double kIndustrialArmM[] = {0.05e-3, 1e-3};
inline constexpr double kIndustrialArmDeg[] = {0.005, 0.1};
// Returns the prior for industrial arms, which has these bounds.
RobotNoisePrior IndustrialArmPrior();

// The groups of the variances of pixels and corrections, in this order. That of the joints exists if their noise is
// modelled.
enum CorrectionGroup : int { kPixelGroup, kTranslationGroup, kRotationGroup, kJointGroup };
// Returns these groups: the variance of the pixels in the views' unit, those of the robot, which of them are free, the
// robot's prior (null if there is none), and the number of noisy joints.
std::vector<VarianceGroup> CorrectionGroups(double pixel_variance, const RobotNoise& robot, bool pixel_is_free,
                                            bool robot_is_free, const RobotNoisePrior* prior = nullptr,
                                            Eigen::Index num_joints = 0);
// Returns the place of the first group of effects that captures share; the number of groups if there is none.
size_t FirstEffectGroup(const std::vector<VarianceGroup>& groups);
// Appends the groups of the free effects (null if there are none), with these standard deviations. `block` is that of
// the effects in the layout. `avoid_zero`: VarianceGroup::avoids_zero.
std::vector<VarianceGroup> WithEffectGroups(std::vector<VarianceGroup> groups, const UnknownBlock& block,
                                            const SharedEffects* effects, const std::vector<double>& sigmas,
                                            bool are_free, bool avoid_zero);
// Raises the variances of those groups of effects that `smaller` lacks to their least ones
// (EffectGroup::least_sigma), and holds these. `first` is the place of the first group of the effects. Returns false,
// and changes nothing, if there is no such group.
bool RaiseToLeast(const SharedEffects& effects, const SharedEffects& smaller, size_t first,
                  std::vector<VarianceGroup>* groups);
// Returns the robot's sigmas among the variances of these groups.
RobotNoise RobotNoiseOf(const std::vector<VarianceGroup>& groups, const VarianceComponents& variances);

// Returns the covariance of a view's rows, marginalised over its effects: p I + G Q G^T, where p is in the views' unit
// and Q is diagonal.
Eigen::MatrixXd MarginalCovariance(const LinearisedView& view, double pixel_variance,
                                   const Eigen::VectorXd& effect_variances);
// Returns by_unknowns and, as the last column, the offset, both whitened with this covariance.
RowMajorMatrix WhitenedRows(const LinearisedView& view, double pixel_variance, const Eigen::VectorXd& effect_variances);

// Returns the normal matrix of the unknowns, marginalised over the effects: sum J^T (p I + G Q G^T)^-1 J, where p is
// `pixel_variance` in the views' unit.
Eigen::MatrixXd MarginalInformation(const std::vector<LinearisedView>& views, const Eigen::VectorXd& effect_variances,
                                    double pixel_variance);

// Returns the probability that a vector with this covariance, estimated with `dof` degrees of freedom, is at least as
// large as `vector` (Fisher's F over the directions whose variance is not below `nothing`), or 1 if there is no such
// direction. Vector and covariance must be in coordinates of similar magnitude.
double PValueOf(const Tangent6& vector, const Matrix6& covariance, double nothing, double dof);

}  // namespace heba
