#include "heba/robot/arm_postures.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/SVD>

#include "heba/base/levenberg_marquardt.h"
#include "heba/base/rng.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/robot/ur_kinematics.h"

namespace heba {
namespace {

struct PosturePoint {
  Eigen::VectorXd joints;
  double cost = 0;
  Eigen::MatrixXd normal;
  Eigen::VectorXd gradient;
};

PosturePoint PointAt(const Arm& arm, const Rigid3d& base_from_tip, Eigen::VectorXd joints) {
  Matrix6X by_joints;
  const Rigid3d reached = BaseFromTip(arm, joints, &by_joints);
  // The pose of the goal in the reached tip's frame. Its tangent decreases by the motion of the tip.
  const Tangent6 missing = LocalCoordinates(reached, base_from_tip);
  PosturePoint point;
  point.joints = std::move(joints);
  point.cost = missing.squaredNorm();
  point.normal = by_joints.transpose() * by_joints;
  // Without it, the damping of a joint that does not move the tip would be zero.
  point.normal.diagonal().array() += 1e-12;
  point.gradient = -by_joints.transpose() * missing;
  return point;
}

// Returns whether two postures are the same but for full turns.
bool AreSame(const Arm& arm, const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  constexpr double kSame = 1e-4;
  for (Eigen::Index j = 0; j < a.size(); ++j) {
    const double difference = a[j] - b[j];
    const bool is_turning = arm.joints[static_cast<size_t>(j)].is_turning;
    if (std::abs(is_turning ? std::remainder(difference, 2 * kPi) : difference) > kSame) return false;
  }
  return true;
}

Eigen::VectorXd Wrapped(const Arm& arm, Eigen::VectorXd joints) {
  for (Eigen::Index j = 0; j < joints.size(); ++j) {
    if (arm.joints[static_cast<size_t>(j)].is_turning) joints[j] = std::remainder(joints[j], 2 * kPi);
  }
  return joints;
}

// Returns postures from which the other solutions for a posture's pose are near: those with the wrist, the elbow or the
// shoulder flipped, of an arm with a spherical wrist and parallel axes 2 and 3.
std::vector<Eigen::VectorXd> FlipsOf(const Arm& arm, const Eigen::VectorXd& joints) {
  std::vector<Eigen::VectorXd> flips;
  if (joints.size() != 6) return flips;
  const auto theta = [&](int j) { return joints[j] + arm.joints[static_cast<size_t>(j)].theta_rad; };
  Eigen::VectorXd wrist = joints;
  wrist[3] += kPi;
  wrist[4] -= 2 * theta(4);
  wrist[5] += kPi;
  flips.push_back(wrist);
  Eigen::VectorXd elbow = joints;
  elbow[1] += joints[2];
  elbow[2] -= 2 * theta(2);
  flips.push_back(elbow);
  Eigen::VectorXd shoulder = joints;
  shoulder[0] += kPi;
  shoulder[1] = -joints[1];
  flips.push_back(shoulder);
  return flips;
}

// The point of axis `a` next to axis `b`.
Eigen::Vector3d FootOn(const ArmAxis& a, const ArmAxis& b) {
  const Eigen::Vector3d normal = a.direction.cross(b.direction);
  const Eigen::Vector3d between = b.point - a.point;
  return a.point + a.direction * (between.cross(b.direction).dot(normal) / normal.squaredNorm());
}

double DistanceM(const ArmAxis& a, const ArmAxis& b) { return (FootOn(a, b) - FootOn(b, a)).norm(); }

// Returns the arm as one of Universal Robots' form, whose postures exist in closed form; nothing if it is another one.
std::optional<UrRobot> UrRobotOf(const Arm& arm) {
  if (arm.num_joints() != 6) return std::nullopt;
  constexpr double kRightAngle = kPi / 2;
  const std::array<double, 6> alphas_rad = {kRightAngle, 0, 0, kRightAngle, -kRightAngle, 0};
  constexpr std::array<bool, 6> kHasD = {true, false, false, true, true, true};
  const auto is_identity = [](const Rigid3d& pose) {
    return pose.translation.isZero(0) && RotationAngle(pose.rotation) == 0;
  };
  if (!is_identity(arm.base_from_first) || !is_identity(arm.last_from_tip)) return std::nullopt;
  for (size_t j = 0; j < 6; ++j) {
    const ArmJoint& joint = arm.joints[j];
    const bool has_a = j == 1 || j == 2;
    if (!joint.is_turning || joint.theta_rad != 0 || joint.beta_rad != 0 ||
        std::abs(joint.alpha_rad - alphas_rad[j]) > 1e-12 || (!kHasD[j] && joint.d_m != 0) ||
        (!has_a && joint.a_m != 0)) {
      return std::nullopt;
    }
  }
  const std::vector<ArmJoint>& at = arm.joints;
  return UrRobot{arm.name, at[0].d_m, at[1].a_m, at[2].a_m, at[3].d_m, at[4].d_m, at[5].d_m};
}

std::vector<Eigen::VectorXd> SortedPostures(std::vector<Eigen::VectorXd> postures) {
  std::sort(postures.begin(), postures.end(), [](const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
    return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end());
  });
  return postures;
}

// Returns the postures by the closed form.
Outcome<std::vector<Eigen::VectorXd>> UrPosturesOf(const UrRobot& robot, const Rigid3d& base_from_tip) {
  const Outcome<std::vector<JointAngles>> found = PosturesOf(robot, base_from_tip);
  if (!found) return Failure{found.reason()};
  std::vector<Eigen::VectorXd> postures;
  for (const JointAngles& joints_rad : *found) {
    postures.emplace_back(Eigen::Map<const Eigen::Matrix<double, 6, 1>>(joints_rad.data()));
  }
  return SortedPostures(std::move(postures));
}

// Returns the posture near `start` whose tip is the nearest to the pose; `small_drop` as in LevenbergMarquardtOptions.
PosturePoint NearestPosture(const Arm& arm, const Rigid3d& base_from_tip, const Eigen::VectorXd& start,
                            double small_drop) {
  LevenbergMarquardtOptions options;
  options.max_iterations = 100;
  options.max_tries = 200;
  options.small_drop = small_drop;
  PosturePoint point = PointAt(arm, base_from_tip, start);
  constexpr double kLargestTurn = 0.5;  // rad or m in one step: a larger one would leave the branch.
  MinimiseSquares(
      options,
      [&](const PosturePoint& at, const Eigen::VectorXd& step) -> std::optional<PosturePoint> {
        const double largest = step.cwiseAbs().maxCoeff();
        return PointAt(arm, base_from_tip, at.joints + std::min(1.0, kLargestTurn / largest) * step);
      },
      &point, [](const PosturePoint& at) { return at.cost < 1e-24; });
  return point;
}

// Returns joints within the limits, those without limits within a turn: shares of 0 and 1 are the ends.
template <class Share>
Eigen::VectorXd JointsWithin(const Arm& arm, const Share& share) {
  Eigen::VectorXd joints(arm.num_joints());
  for (int j = 0; j < arm.num_joints(); ++j) {
    JointLimits limits = arm.limits.empty() ? JointLimits{-kPi, kPi} : arm.limits[static_cast<size_t>(j)];
    if (!std::isfinite(limits.high - limits.low)) limits = {-kPi, kPi};
    joints[j] = limits.low + share() * (limits.high - limits.low);
  }
  return joints;
}

// Returns one posture: that near the middle of the limits or, if it is beyond them, the first within them from random
// starts; one beyond them if none is.
Outcome<Eigen::VectorXd> AnyPostureOf(const Arm& arm, const Rigid3d& base_from_tip) {
  constexpr int kMostStarts = 40;
  Rng rng(1);
  Outcome<Eigen::VectorXd> found = PostureNear(arm, base_from_tip, JointsWithin(arm, [] { return 0.5; }));
  for (int start = 1; start < kMostStarts && !(found && WithinLimits(arm, *found)); ++start) {
    const Eigen::VectorXd from = JointsWithin(arm, [&] { return rng.Uniform(0, 1); });
    Outcome<Eigen::VectorXd> other = PostureNear(arm, base_from_tip, from);
    if (other) found = std::move(other);
  }
  return found;
}

}  // namespace

Outcome<Eigen::VectorXd> PostureNear(const Arm& arm, const Rigid3d& base_from_tip, const Eigen::VectorXd& start) {
  const PosturePoint point = NearestPosture(arm, base_from_tip, start, 0);
  const double distance = std::sqrt(point.cost);
  if (distance > kReached) {
    const Tangent6 missing = LocalCoordinates(BaseFromTip(arm, point.joints), base_from_tip);
    return Failure{"out of reach: the nearest posture that was found is " +
                   Significant(1000 * missing.head<3>().norm(), 3) + " mm and " +
                   Significant(missing.tail<3>().norm() * 180 / kPi, 3) + " deg away"};
  }
  return point.joints;
}

std::optional<Eigen::VectorXd> NearestPostureTo(const Arm& arm, const Rigid3d& base_from_tip) {
  constexpr int kNumStarts = 2;
  Rng rng(1);
  std::optional<Eigen::VectorXd> nearest;
  double least = std::numeric_limits<double>::infinity();
  for (int k = 0; k < kNumStarts; ++k) {
    const Eigen::VectorXd start = JointsWithin(arm, [&] { return k == 0 ? 0.5 : rng.Uniform(0, 1); });
    // The tip need not be where no other posture is any nearer.
    constexpr double kSmallDrop = 1e-4;
    const PosturePoint point = NearestPosture(arm, base_from_tip, start, kSmallDrop);
    std::optional<Eigen::VectorXd> joints = WithinLimits(arm, Wrapped(arm, point.joints));
    if (!joints || point.cost >= least) continue;
    least = point.cost;
    nearest = std::move(joints);
  }
  return nearest;
}

Outcome<std::vector<Eigen::VectorXd>> PosturesOf(const Arm& arm, const Rigid3d& base_from_tip) {
  if (arm.num_joints() > 6) {
    return Failure{"the arm has " + std::to_string(arm.num_joints()) +
                   " joints, so that a pose does not determine their positions"};
  }
  if (const std::optional<UrRobot> robot = UrRobotOf(arm)) return UrPosturesOf(*robot, base_from_tip);
  constexpr int kNumStarts = 80;
  constexpr double kReachM = 1;  // The range of sliding joints that is searched.
  // At a singularity, infinitely many postures reach the pose.
  constexpr size_t kMostPostures = 16;
  std::vector<Eigen::VectorXd> postures;
  std::string reason;
  const auto search = [&](const Eigen::VectorXd& start) {
    Outcome<Eigen::VectorXd> found = PostureNear(arm, base_from_tip, start);
    if (!found) {
      if (reason.empty()) reason = found.reason();
      return;
    }
    const bool is_known = std::any_of(postures.begin(), postures.end(),
                                      [&](const Eigen::VectorXd& other) { return AreSame(arm, *found, other); });
    if (!is_known && postures.size() < kMostPostures) postures.push_back(Wrapped(arm, *found));
  };
  Rng rng(1);
  size_t num_flipped = 0;
  for (int k = 0; k < kNumStarts && postures.size() < kMostPostures; ++k) {
    Eigen::VectorXd start(arm.num_joints());
    for (int j = 0; j < arm.num_joints(); ++j) {
      start[j] =
          arm.joints[static_cast<size_t>(j)].is_turning ? rng.Uniform(-kPi, kPi) : rng.Uniform(-kReachM, kReachM);
    }
    search(start);
    for (; num_flipped < postures.size(); ++num_flipped) {
      for (const Eigen::VectorXd& flip : FlipsOf(arm, Eigen::VectorXd(postures[num_flipped]))) search(flip);
    }
  }
  if (postures.empty()) return Failure{reason};
  return SortedPostures(std::move(postures));
}

Outcome<std::vector<Eigen::VectorXd>> PosturesWithinLimits(const Arm& arm, const Rigid3d& base_from_tip) {
  std::vector<Eigen::VectorXd> reaching;
  if (arm.num_joints() > 6) {
    Outcome<Eigen::VectorXd> any = AnyPostureOf(arm, base_from_tip);
    if (!any) return any.failure();
    reaching.push_back(Wrapped(arm, *std::move(any)));
  } else {
    Outcome<std::vector<Eigen::VectorXd>> all = PosturesOf(arm, base_from_tip);
    if (!all) return all.failure();
    reaching = *std::move(all);
  }
  std::vector<Eigen::VectorXd> within;
  for (Eigen::VectorXd& posture : reaching) {
    std::optional<Eigen::VectorXd> joints = WithinLimits(arm, std::move(posture));
    if (joints) within.push_back(*std::move(joints));
  }
  if (within.empty()) return Failure{"no posture that was found is within the limits of the joints"};
  return within;
}

std::vector<Eigen::Vector3d> OriginsOf(const Arm& arm, const Eigen::VectorXd& joints) {
  std::vector<Eigen::Vector3d> origins;
  const std::vector<ArmAxis> axes = AxesOf(arm, joints);
  for (size_t j = 1; j < axes.size(); ++j) origins.push_back(axes[j].point);
  origins.push_back((BaseFromTip(RigidPart(arm), joints) * Inverse(arm.last_from_tip)).translation);
  return origins;
}

std::optional<Eigen::VectorXd> WithinLimits(const Arm& arm, Eigen::VectorXd joints) {
  if (arm.limits.empty()) return joints;
  CHECK_EQ(joints.size(), static_cast<Eigen::Index>(arm.limits.size()));
  for (Eigen::Index j = 0; j < joints.size(); ++j) {
    const JointLimits& limits = arm.limits[static_cast<size_t>(j)];
    const auto is_within = [&] { return joints[j] > limits.low - kReached && joints[j] < limits.high + kReached; };
    if (is_within()) continue;
    const double middle = 0.5 * (limits.low + limits.high);
    if (arm.joints[static_cast<size_t>(j)].is_turning) {
      joints[j] = middle + std::remainder(joints[j] - middle, 2 * kPi);
    }
    if (!is_within()) return std::nullopt;
  }
  return joints;
}

double PostureDistance(const Arm& arm, const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  double sum = 0;
  for (Eigen::Index j = 0; j < a.size(); ++j) {
    const size_t joint = static_cast<size_t>(j);
    const bool has_limits = !arm.limits.empty() && std::isfinite(arm.limits[joint].low);
    const double difference = a[j] - b[j];
    const double to_next =
        arm.joints[joint].is_turning && !has_limits ? std::remainder(difference, 2 * kPi) : difference;
    sum += to_next * to_next;
  }
  return std::sqrt(sum);
}

std::optional<Configuration> ConfigurationOf(const Arm& arm, const Eigen::VectorXd& joints) {
  const bool all_turn =
      std::all_of(arm.joints.begin(), arm.joints.end(), [](const ArmJoint& joint) { return joint.is_turning; });
  if (arm.num_joints() != 6 || !all_turn || !IsParallelToNext(arm, 1)) return std::nullopt;
  const std::vector<ArmAxis> axes = AxesOf(arm, joints);
  constexpr double kMeetM = 0.02;
  if (DistanceM(axes[3], axes[4]) > kMeetM || DistanceM(axes[4], axes[5]) > kMeetM) return std::nullopt;
  const Eigen::Vector3d wrist = FootOn(axes[3], axes[4]);
  // In the singularity of the shoulder, the point where axes 5 and 6 meet lies in the plane of axes 1 and 2. It is that
  // of axes 4 and 5 if the wrist is spherical, but not for Universal Robots' arms.
  const Eigen::Vector3d hand = FootOn(axes[4], axes[5]);
  const Eigen::Vector3d forward = axes[1].direction.cross(axes[0].direction);
  const Eigen::Vector3d upper_arm = axes[2].point - axes[1].point;
  return Configuration{(hand - axes[0].point).dot(forward) > 0,
                       upper_arm.cross(wrist - axes[2].point).dot(axes[1].direction) > 0,
                       axes[3].direction.cross(axes[5].direction).dot(axes[4].direction) > 0};
}

std::string NameOf(const Configuration& configuration) {
  const auto sign = [&](size_t i) { return configuration[i] ? "+" : "-"; };
  return std::string("shoulder ") + sign(0) + ", elbow " + sign(1) + ", wrist " + sign(2);
}

std::string SingularityAt(const Arm& arm, const Eigen::VectorXd& joints) {
  constexpr double kNearSingular = 2e-3;
  constexpr double kMoves = 0.2;
  Matrix6X by_joints;
  BaseFromTip(arm, joints, &by_joints);
  // A redundant arm has six singular values, too: it is singular if its tip cannot move in some direction.
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(by_joints, Eigen::ComputeThinV);
  if (svd.singularValues().tail<1>()[0] > kNearSingular) return {};
  if (arm.num_joints() > 6) return "the tip cannot move in some direction";
  const Eigen::VectorXd motion = svd.matrixV().col(svd.matrixV().cols() - 1);
  std::vector<std::string> names;
  for (Eigen::Index j = 0; j < motion.size(); ++j) {
    if (std::abs(motion[j]) > kMoves) names.push_back(std::to_string(j + 1));
  }
  return "a common motion of joints " + Join(names, ", ") + " hardly moves the tip";
}

}  // namespace heba
