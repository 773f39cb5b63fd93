// The idea of the two-step method as one weighted least-squares problem: it accepts any motion, and each capture's
// target position is weighted by its covariance. With M = camera_mount_from_target_mount, c the position of the
// target's point in the camera, S its covariance, y the point in the target's mount and [R, t] the inverse of X:
//   min over R, t, y of  sum |R (R_M y + p_M) + t - c|^2 in the metric S^-1.
// For a known R the problem is linear in (y, t). The depth of a small target is an order of magnitude less certain
// than its lateral position; without S, as in the paper's formulas, the depth noise would dominate the estimate. The
// orientation of the target is not used. The rotation is found by iterative refinement from the 24 rotations of a
// cube, because every rotation is within 63 deg of one of them; the solution with the smallest cost is used.
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/LU>

#include "heba/base/factorisation.h"
#include "heba/base/failure_code.h"
#include "heba/base/levenberg_marquardt.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/closed_form/known_rotation.h"
#include "solvers/closed_form/target_position.h"

namespace heba {
namespace {

// The measurements of one capture.
struct Measured {
  Eigen::Matrix3d mount_rotation;
  Eigen::Vector3d mount_position;  // Relative to the mean over the captures.
  Eigen::Vector3d in_camera;
  Eigen::Matrix3d information;  // S^-1
};

struct State {
  Eigen::Matrix3d rotation;  // camera_from_camera_mount
  Eigen::Vector3d translation;
  Eigen::Vector3d point_in_mount;
  double cost = std::numeric_limits<double>::infinity();
};

// Solves for the best translation and point, given a rotation.
State WithRotation(const std::vector<Measured>& captures, const Eigen::Matrix3d& rotation) {
  Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
  for (const Measured& m : captures) {
    const Eigen::Matrix3d by_point = rotation * m.mount_rotation;
    const Eigen::Matrix3d weighted = m.information * by_point;
    const Eigen::Vector3d pull = m.information * (m.in_camera - rotation * m.mount_position);
    normal.topLeftCorner<3, 3>() += by_point.transpose() * weighted;
    normal.bottomLeftCorner<3, 3>() += weighted;
    normal.bottomRightCorner<3, 3>() += m.information;
    right.head<3>() += by_point.transpose() * pull;
    right.tail<3>() += pull;
  }
  // SolveSymmetric reads the lower triangle only.
  const Eigen::Matrix<double, 6, 1> solution = SolveSymmetric(normal, right);
  return {rotation, solution.tail<3>(), solution.head<3>()};
}

// A state and the normal equations of its rotation (left perturbation), point and translation.
struct Equations {
  State state;
  Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();  // Only the lower triangle is used.
  Eigen::Matrix<double, 9, 1> gradient = Eigen::Matrix<double, 9, 1>::Zero();
  double cost = 0;
};

Equations EquationsAt(const std::vector<Measured>& captures, const State& state) {
  Equations at;
  at.state = state;
  for (const Measured& m : captures) {
    const Eigen::Matrix3d by_point = state.rotation * m.mount_rotation;
    const Eigen::Vector3d rotated = by_point * state.point_in_mount + state.rotation * m.mount_position;
    const Eigen::Matrix3d cross = Skew(rotated);  // The residual changes by -cross * (rotation step).
    const Eigen::Matrix3d weighted_point = m.information * by_point;
    const Eigen::Matrix3d weighted_cross = m.information * cross;
    const Eigen::Vector3d residual = rotated + state.translation - m.in_camera;
    const Eigen::Vector3d pull = m.information * residual;
    at.cost += residual.dot(pull);
    at.normal.topLeftCorner<3, 3>() -= cross * weighted_cross;
    at.normal.block<3, 3>(3, 0) -= weighted_point.transpose() * cross;
    at.normal.block<3, 3>(3, 3) += by_point.transpose() * weighted_point;
    at.normal.block<3, 3>(6, 0) -= weighted_cross;
    at.normal.block<3, 3>(6, 3) += weighted_point;
    at.normal.block<3, 3>(6, 6) += m.information;
    at.gradient.head<3>() += rotated.cross(pull);
    at.gradient.segment<3>(3) += by_point.transpose() * pull;
    at.gradient.tail<3>() += pull;
  }
  at.state.cost = at.cost;
  return at;
}

// Refines a state. Stops early near `known`, a minimum that need not be found again.
State Refined(const std::vector<Measured>& captures, const State& start, int max_iterations, double small_drop,
              const State* known = nullptr) {
  LevenbergMarquardtOptions options;
  options.max_iterations = max_iterations;
  options.most_damping = 1e4;
  options.small_drop = small_drop;
  const auto try_step = [&](const Equations& from, const Eigen::Matrix<double, 9, 1>& step) {
    const State& state = from.state;
    return std::optional<Equations>(
        EquationsAt(captures, {ExpRotation(step.head<3>()).toRotationMatrix() * state.rotation,
                               state.translation + step.tail<3>(), state.point_in_mount + step.segment<3>(3)}));
  };
  const auto is_known = [&](const Equations& at) {
    constexpr double kNear2 = 0.01;  // Squared Frobenius distance of two rotations, 8 sin^2(angle / 2): 4 deg.
    return known != nullptr && (at.state.rotation - known->rotation).squaredNorm() < kNear2;
  };
  Equations here = EquationsAt(captures, start);
  MinimiseSquares(options, try_step, &here, is_known);
  return here.state;
}

}  // namespace

Outcome<HandEye> SolveHandEye_two_step_ls(const HandEyeInput& input) {
  const std::vector<PosePair>& pairs = input.pairs();
  const TargetPositions& positions = input.positions();
  Eigen::Vector3d mean_position = Eigen::Vector3d::Zero();
  for (const PosePair& pair : pairs) {
    mean_position += pair.camera_mount_from_target_mount.translation / static_cast<double>(pairs.size());
  }
  std::vector<Measured> captures;
  for (size_t i = 0; i < pairs.size(); ++i) {
    const auto factor = Cholesky(positions.captures[i].covariance_at_1px);
    if (!factor) return Failure{FailureCode("bad_covariance")};
    captures.push_back({pairs[i].camera_mount_from_target_mount.RotationMatrix(),
                        pairs[i].camera_mount_from_target_mount.translation - mean_position,
                        positions.captures[i].in_camera, factor->Inverse()});
  }
  // A few captures suffice to compare the initial rotations.
  constexpr size_t kMaxForStart = 30;
  std::vector<Measured> few;
  for (size_t i = 0; i < captures.size(); i += std::max<size_t>(1, captures.size() / kMaxForStart)) {
    few.push_back(captures[i]);
  }
  State best;
  for (const Eigen::Matrix3d& turn : CubeRotations()) {
    constexpr int kFewIterations = 12;
    constexpr double kTellingDrop = 1e-3;
    const State found =
        Refined(few, WithRotation(few, turn), kFewIterations, kTellingDrop, std::isfinite(best.cost) ? &best : nullptr);
    if (found.cost < best.cost) best = found;
  }
  if (!std::isfinite(best.cost)) return Failure{FailureCode("weak_positions")};
  constexpr int kMaxIterations = 100;
  constexpr double kLastDrop = 1e-13;
  best = Refined(captures, WithRotation(captures, best.rotation), kMaxIterations, kLastDrop);
  const Eigen::Matrix3d rotation_x = best.rotation.transpose();
  const Rigid3d camera_mount_from_camera(rotation_x, mean_position - rotation_x * best.translation);
  return WithBoardAtPoint(pairs, camera_mount_from_camera, positions.point_in_target, best.point_in_mount);
}

}  // namespace heba
