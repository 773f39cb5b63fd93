#include "tools/run/stand_in_arm.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>

#include "heba/base/error.h"
#include "heba/base/units.h"
#include "heba/robot/arm.h"
#include "heba/robot/arm_errors.h"
#include "heba/robot/arm_postures.h"
#include "heba/robot/arm_table.h"
#include "solvers/calibration/unseen_errors.h"
#include "solvers/residuals/capture_loops.h"

namespace heba {
namespace {

// Returns an arm of another size, whose joints turn without limits.
Arm Scaled(Arm arm, double scale) {
  arm.limits.clear();
  for (ArmJoint& joint : arm.joints) {
    joint.d_m *= scale;
    joint.a_m *= scale;
  }
  arm.base_from_first.translation *= scale;
  arm.last_from_tip.translation *= scale;
  return arm;
}

// Returns the postures of the poses nearest to one of the first; an empty entry for a pose that is not reached.
std::vector<Eigen::VectorXd> PosturesOfAll(const Arm& arm, const std::vector<Rigid3d>& poses) {
  std::vector<Eigen::VectorXd> postures;
  Eigen::VectorXd first;
  for (const Rigid3d& pose : poses) {
    Eigen::VectorXd& posture = postures.emplace_back();
    const Outcome<std::vector<Eigen::VectorXd>> all = PosturesOf(arm, pose);
    if (!all) continue;
    posture =
        first.size() == 0
            ? all->front()
            : *std::min_element(all->begin(), all->end(), [&](const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
                return PostureDistance(arm, a, first) < PostureDistance(arm, b, first);
              });
    if (first.size() == 0) first = posture;
  }
  return postures;
}

// Returns the sigma of each error of the stand-in.
Eigen::VectorXd SigmasOf(const SharedEffects& effects) {
  constexpr double kOffsetRad = DegToRad(0.05);
  constexpr double kLengthM = 0.3e-3;
  constexpr double kAngleRad = DegToRad(0.03);
  Eigen::VectorXd sigmas(effects.size());
  for (Eigen::Index i = 0; i < effects.size(); ++i) {
    const ArmParam param = ParamAt(effects.effects[static_cast<size_t>(i)].index);
    const bool is_length = param == ArmParam::kD || param == ArmParam::kA;
    sigmas[i] = is_length ? kLengthM : param == ArmParam::kTheta ? kOffsetRad : kAngleRad;
  }
  return sigmas;
}

// Returns the errors of the smallest stand-in that reaches most of the poses; nothing if none does.
std::optional<StandInErrors> StandInFor(const std::vector<Rigid3d>& poses) {
  const Arm ur5e = *FindArm("ur5e");
  const SharedEffects effects = ArmErrors(ur5e, ArmErrorModel::kGeometry);
  constexpr double kReachOfUr5eM = 0.75;
  double farthest_m = 0;
  for (const Rigid3d& pose : poses) farthest_m = std::max(farthest_m, pose.translation.norm());
  double scale = std::max(0.5, farthest_m / kReachOfUr5eM);
  constexpr int kMostTries = 4;
  for (int attempt = 0; attempt < kMostTries; ++attempt, scale *= 1.2) {
    const Arm arm = Scaled(ur5e, scale);
    const std::vector<Eigen::VectorXd> postures = PosturesOfAll(arm, poses);
    const auto num_missed = std::count_if(postures.begin(), postures.end(),
                                          [](const Eigen::VectorXd& posture) { return posture.size() == 0; });
    constexpr double kMostMissed = 0.1;
    if (static_cast<double>(num_missed) > kMostMissed * static_cast<double>(poses.size())) continue;
    StandInErrors errors{SigmasOf(effects), {}};
    for (const Eigen::VectorXd& posture : postures) {
      Matrix6X& by_errors = errors.gripper_by_errors.emplace_back(Matrix6X::Zero(6, effects.size()));
      if (posture.size() == 0) continue;
      Matrix6X by_all;
      MakeArmEffect(arm, posture, Rigid3d())->Evaluate(Eigen::VectorXd::Zero(effects.num_all), &by_all);
      for (Eigen::Index i = 0; i < effects.size(); ++i) {
        by_errors.col(i) = by_all.col(effects.effects[static_cast<size_t>(i)].index);
      }
    }
    return errors;
  }
  return std::nullopt;
}

}  // namespace

std::vector<Eigen::VectorXd> ChangesByUnknownArms(const Problem& problem, const Solution& solution) {
  std::vector<Eigen::VectorXd> changes;
  // An earlier session had the same arm.
  if (problem.prior != nullptr) return changes;
  for (const size_t robot : MovingRobots(problem)) {
    const SharedEffects* const effects = EffectsOf(problem, robot);
    if (effects == nullptr || effects->kind != SharedEffectsKind::kSmooth) continue;
    std::vector<Rigid3d> poses;
    for (const std::vector<size_t>& group : GroupByRobotPoses(problem)) {
      poses.push_back(problem.captures[group.front()].base_from_gripper[robot]);
    }
    const std::optional<StandInErrors> errors = StandInFor(poses);
    if (!errors) continue;
    for (Eigen::VectorXd& change : ChangesByUnseenErrors(problem, solution, robot, *errors)) {
      changes.push_back(std::move(change));
    }
  }
  return changes;
}

}  // namespace heba
