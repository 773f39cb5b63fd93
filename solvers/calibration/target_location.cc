#include "heba/target_location.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "heba/data/hand_eye.h"
#include "heba/location.h"

namespace heba {
namespace {

// A hand-eye calibration as a rig without captures.
struct WholeHandEye {
  Problem problem;
  Solution solution;

  WholeHandEye(Setup setup, const PairSolution& of)
      : problem(HandEyeProblem(setup, of)), solution(ProblemSolution(of)) {}
};

}  // namespace

Outcome<LocatedTarget> LocateTarget(Setup setup, const PairSolution& solution, const Observations& observations,
                                    const StatedPose& camera_mount) {
  Outcome<std::vector<LocatedTarget>> possible =
      LocateSymmetricTarget(setup, solution, observations, {Rigid3d()}, camera_mount);
  if (!possible) return possible.failure();
  return std::move(possible->front());
}

Outcome<std::vector<LocatedTarget>> LocateSymmetricTarget(Setup setup, const PairSolution& solution,
                                                          const Observations& observations,
                                                          const std::vector<Rigid3d>& symmetries,
                                                          const StatedPose& camera_mount) {
  WholeHandEye rig(setup, solution);
  rig.problem.targets[0].symmetries = symmetries;
  return LocateTargetInCell(rig.problem, rig.solution, 0, {{0, observations}}, {camera_mount});
}

PositionCovariance CovarianceOfReach(Setup setup, const PairSolution& solution, const LocatedTarget& located,
                                     const StatedPose& command, const Eigen::Vector3d& point_in_gripper,
                                     const Eigen::Vector3d& point_in_target) {
  const WholeHandEye rig(setup, solution);
  return CovarianceOfReachInCell(rig.problem, rig.solution, 0, located, command, point_in_gripper, point_in_target);
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

Outcome<LocatedPoint> LocatePixel(Setup setup, const PairSolution& solution, const Eigen::Vector2d& pixel,
                                  const Plane& plane, const StatedPose& camera_mount) {
  const WholeHandEye rig(setup, solution);
  return LocatePixelInCell(rig.problem, rig.solution, {0, pixel}, plane, {camera_mount});
}

Outcome<LocatedPoint> LocatePixelOnTarget(Setup setup, const PairSolution& solution, const Eigen::Vector2d& pixel,
                                          const Observations& observations, const StatedPose& camera_mount) {
  const WholeHandEye rig(setup, solution);
  const Outcome<std::vector<LocatedTarget>> target =
      LocateTargetInCell(rig.problem, rig.solution, 0, {{0, observations}}, {camera_mount});
  if (!target) return target.failure();
  return LocatePixelOnTargetInCell(rig.problem, rig.solution, {0, pixel}, target->front(), {camera_mount});
}

}  // namespace heba
