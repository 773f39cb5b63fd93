#include "solvers/study/study_places.h"

#include <cmath>

#include "heba/base/distributions.h"
#include "heba/base/factorisation.h"
#include "solvers/residuals/loop_problem.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// The derivative of the middle of the target in the camera at a place, by the unknowns of a layout.
struct PredictedPlace {
  Eigen::Vector3d in_camera = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, 3, Eigen::Dynamic> by_unknowns;
  Eigen::Matrix<double, 3, 6> by_gripper;  // By a correction of the robot's pose.
};

PredictedPlace PredictPlace(const StudyCell& cell, const StudyPlace& place, const HandEye& hand_eye,
                            const SharedEffects* effects, const Eigen::VectorXd& values, const UnknownLayout& layout) {
  std::vector<int> indices;
  for (size_t i = 0; effects != nullptr && i < effects->effects.size(); ++i) {
    indices.push_back(effects->effects[i].index);
  }
  const bool has_effects = !indices.empty();
  const KinematicLoop loop =
      HandEyeLoop(SetupOf(cell), place.camera_mount_from_target_mount,
                  has_effects ? SelectEffects(place.effect, effects->num_all, indices) : nullptr, true);
  const std::vector<Rigid3d> poses = {hand_eye.camera_mount_from_camera, hand_eye.target_mount_from_target};
  const std::vector<Eigen::VectorXd> of_effects(has_effects ? 1 : 0, values);
  LoopDerivatives derivatives;
  const Rigid3d camera_from_target = loop.Evaluate({poses, of_effects, std::vector<Rigid3d>(1)}, &derivatives);
  PredictedPlace predicted;
  predicted.in_camera = camera_from_target * cell.targets[0].points.points_in_target.rowwise().mean();
  const Eigen::Matrix<double, 3, 6> by_motion = PointByMotion(predicted.in_camera);
  predicted.by_unknowns.setZero(3, layout.size());
  predicted.by_unknowns.middleCols<6>(layout.Block(kHandEyeBlock).first) = by_motion * derivatives.shared[0];
  predicted.by_unknowns.middleCols<6>(layout.Block(kBoardBlock).first) = by_motion * derivatives.shared[1];
  const UnknownBlock robot = layout.Block(kRobotBlock);
  if (has_effects) predicted.by_unknowns.middleCols(robot.first, robot.size) = by_motion * derivatives.effects[0];
  predicted.by_gripper = by_motion * derivatives.own[0];
  return predicted;
}

}  // namespace

std::shared_ptr<const SharedEffects> DrawnErrors(const StudyCell& cell) {
  if (!cell.robot) return nullptr;
  SharedEffects drawn = *cell.robot->errors;
  drawn.effects.clear();
  for (const SharedEffect& effect : cell.robot->errors->effects) {
    if (drawn.groups[effect.group].sigma > 0) drawn.effects.push_back(effect);
  }
  return drawn.effects.empty() ? nullptr : std::make_shared<const SharedEffects>(drawn);
}

Eigen::VectorXd DrawErrors(const StudyCell& cell, Rng& rng) {
  if (!cell.robot) return {};
  const SharedEffects& errors = *cell.robot->errors;
  Eigen::VectorXd drawn = Eigen::VectorXd::Zero(errors.num_all);
  for (const SharedEffect& effect : errors.effects)
    drawn[effect.index] = errors.groups[effect.group].sigma * rng.Normal();
  return drawn;
}

Rigid3d DrawPoseError(const PoseEffect& effect, const Matrix6X& gripper_by_joints, const Eigen::VectorXd& drawn,
                      double joint_noise_rad, Rng& rng) {
  Eigen::VectorXd noise(gripper_by_joints.cols());
  for (double& joint : noise) joint = joint_noise_rad * rng.Normal();
  return effect.Evaluate(drawn, nullptr) * Retract(Rigid3d(), gripper_by_joints * noise);
}

TrialEstimate WithPlaceErrors(TrialEstimate estimate, const StudyCell& cell, const PairSolution& solution,
                              const Eigen::VectorXd& drawn, Rng& rng) {
  const Covariance& covariance = solution.covariance;
  const Eigen::Vector3d middle = cell.targets[0].points.points_in_target.rowwise().mean();
  for (const StudyPlace& place : cell.robot->places) {
    const PredictedPlace predicted = PredictPlace(cell, place, solution.hand_eye, solution.shared_effects.get(),
                                                  solution.effects, covariance.layout);
    const auto truth_at = [&](double joint_noise_rad) -> Eigen::Vector3d {
      const Rigid3d correction = DrawPoseError(*place.effect, place.gripper_by_joints, drawn, joint_noise_rad, rng);
      return CameraFromTarget(SetupOf(cell), HandEyeOf(cell), place.camera_mount_from_target_mount, correction) *
             middle;
    };
    PlaceErrors& errors = place.is_inside ? estimate.inside : estimate.outside;
    errors.sum_m2 += (predicted.in_camera - truth_at(0)).squaredNorm();
    const Eigen::Vector3d difference = predicted.in_camera - truth_at(cell.robot->joint_noise_rad);
    Matrix6X by_noise(6, 6 + place.gripper_by_joints.cols());
    by_noise << Matrix6::Identity(), place.gripper_by_joints;
    const Eigen::VectorXd noise =
        CorrectionVariances(solution.robot_noise.value_or(RobotNoise{}), by_noise.cols()).cwiseSqrt();
    const Eigen::MatrixXd of_noise = predicted.by_gripper * by_noise * noise.asDiagonal();
    const Eigen::Matrix3d region =
        predicted.by_unknowns * covariance.matrix * predicted.by_unknowns.transpose() + of_noise * of_noise.transpose();
    constexpr double kOutside = 0.05;
    constexpr int kAxes = 3;
    const double squares = MahalanobisSquare(difference, region);
    errors.num_covered += squares <= kAxes * FisherQuantile(kOutside, kAxes, solution.covariance_dof) ? 1 : 0;
    ++errors.num;
  }
  return estimate;
}

StudyErrors WithPlaceBounds(StudyErrors bound, const StudyCell& cell, const SharedEffects* drawn,
                            const Covariance& covariance) {
  double sums_m2[2] = {};
  int nums[2] = {};
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(drawn == nullptr ? 0 : drawn->size());
  for (const StudyPlace& place : cell.robot->places) {
    const PredictedPlace predicted = PredictPlace(cell, place, HandEyeOf(cell), drawn, zero, covariance.layout);
    sums_m2[place.is_inside ? 0 : 1] +=
        (predicted.by_unknowns * covariance.matrix * predicted.by_unknowns.transpose()).trace();
    ++nums[place.is_inside ? 0 : 1];
  }
  if (nums[0] > 0) bound.inside_m = std::sqrt(sums_m2[0] / nums[0]);
  if (nums[1] > 0) bound.outside_m = std::sqrt(sums_m2[1] / nums[1]);
  return bound;
}

}  // namespace heba
