#include "heba/robot/ur_kinematics.h"

#include <algorithm>
#include <cmath>

#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/base/units.h"

namespace heba {
namespace {

Rigid3d DhLink(double angle_rad, double d_m, double a_m, double alpha_rad) {
  const Rigid3d turn(Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitZ())),
                     Eigen::Vector3d(a_m * std::cos(angle_rad), a_m * std::sin(angle_rad), d_m));
  return turn *
         Rigid3d(Eigen::Quaterniond(Eigen::AngleAxisd(alpha_rad, Eigen::Vector3d::UnitX())), Eigen::Vector3d::Zero());
}

double Wrapped(double angle_rad) { return std::remainder(angle_rad, 2 * kPi); }

// Returns whether `value` is the cosine of an angle. Values that exceed 1 only by rounding errors are clamped.
bool IsCosine(double* value) {
  constexpr double kRounding = 1e-9;
  if (!(std::abs(*value) <= 1 + kRounding)) return false;
  *value = std::clamp(*value, -1.0, 1.0);
  return true;
}

std::string Mm(double m) { return Significant(1000 * m, 3) + " mm"; }

// Returns whether the sixth joint is undetermined, by the sine of the angle between the arm's normal and axis 6.
bool IsWristFree(double wrist_sine) {
  constexpr double kNothing = 1e-9;
  return wrist_sine < kNothing;
}

// Joints 2 to 4, whose axes are parallel.
struct PlanarJoints {
  double q2 = 0;
  double q3 = 0;
  double q4 = 0;
};

// Returns the postures of a planar arm with two links whose last frame is `from_4` in the first: elbow up and down, or
// none if it is out of reach.
std::vector<PlanarJoints> PlanarPosturesOf(const UrRobot& robot, const Rigid3d& from_4) {
  const double u = from_4.translation.x();
  const double v = from_4.translation.y();
  const double squared = u * u + v * v;
  double elbow_cosine = (squared - robot.a2_m * robot.a2_m - robot.a3_m * robot.a3_m) / (2 * robot.a2_m * robot.a3_m);
  if (!IsCosine(&elbow_cosine)) return {};
  std::vector<PlanarJoints> postures;
  for (const double elbow : {1.0, -1.0}) {
    const double q3 = elbow * std::acos(elbow_cosine);
    const double q2 = std::atan2(v, u) - std::atan2(robot.a3_m * std::sin(q3), robot.a2_m + robot.a3_m * std::cos(q3));
    const Eigen::Matrix3d r4 = from_4.RotationMatrix();
    const double q4 = std::atan2(r4(1, 0), r4(0, 0)) - q2 - q3;
    postures.push_back({q2, q3, q4});
  }
  return postures;
}

}  // namespace

const std::vector<UrRobot>& UrRobots() {
  static const std::vector<UrRobot> robots = {
#define HEBA_UR_ROBOT(name, d1, a2, a3, d4, d5, d6) {#name, d1, a2, a3, d4, d5, d6},
#define HEBA_UR_LINKS(name, ...)
#include "heba/robot/ur_robots.def"
#undef HEBA_UR_LINKS
#undef HEBA_UR_ROBOT
  };
  return robots;
}

std::vector<std::string> UrRobotNames() { return NamesOf(UrRobots()); }

const UrRobot* FindUrRobot(std::string_view name) { return FindEntry(UrRobots(), name); }

Rigid3d BaseFromFlange(const UrRobot& robot, const JointAngles& q) {
  return DhLink(q[0], robot.d1_m, 0, kPi / 2) * DhLink(q[1], 0, robot.a2_m, 0) * DhLink(q[2], 0, robot.a3_m, 0) *
         DhLink(q[3], robot.d4_m, 0, kPi / 2) * DhLink(q[4], robot.d5_m, 0, -kPi / 2) * DhLink(q[5], robot.d6_m, 0, 0);
}

Outcome<std::vector<JointAngles>> PosturesOf(const UrRobot& robot, const Rigid3d& base_from_flange) {
  const Eigen::Matrix3d r = base_from_flange.RotationMatrix();
  const Eigen::Vector3d& p = base_from_flange.translation;
  // The origin of frame 5, the wrist, has the distance d4 from the plane of the arm, which leaves two solutions for the
  // first joint.
  const Eigen::Vector3d wrist = p - robot.d6_m * r.col(2);
  const double from_axis_m = std::hypot(wrist.x(), wrist.y());
  double shoulder_cosine = from_axis_m > 0 ? robot.d4_m / from_axis_m : 2;
  if (!IsCosine(&shoulder_cosine)) {
    return Failure{"out of reach: the wrist would be " + Mm(from_axis_m) + " from the axis of the base, " +
                   Mm(robot.d4_m) + " is the minimum"};
  }
  std::vector<JointAngles> postures;
  double too_far_m = 0;
  double too_near_m = 0;
  for (const double shoulder : {1.0, -1.0}) {
    const double q1 = std::atan2(wrist.y(), wrist.x()) + shoulder * std::acos(shoulder_cosine) + kPi / 2;
    const double s1 = std::sin(q1);
    const double c1 = std::cos(q1);
    // The normal of the arm in the flange's frame: its angle with axis 6 is the fifth joint, its direction about axis 6
    // the sixth. If it is parallel to axis 6, the sixth joint is undetermined.
    const Eigen::Vector3d normal = r.transpose() * Eigen::Vector3d(s1, -c1, 0);
    const double sine = normal.head<2>().norm();
    const bool is_free = IsWristFree(sine);
    for (const double flip : {1.0, -1.0}) {
      if (is_free && flip < 0) continue;  // It is the same posture.
      const double q5 = flip * std::atan2(sine, normal.z());
      const double q6 = is_free ? 0 : std::atan2(-flip * normal.y(), flip * normal.x());
      const Rigid3d from_4 = Inverse(DhLink(q1, robot.d1_m, 0, kPi / 2)) * base_from_flange *
                             Inverse(DhLink(q5, robot.d5_m, 0, -kPi / 2) * DhLink(q6, robot.d6_m, 0, 0));
      const std::vector<PlanarJoints> planar = PlanarPosturesOf(robot, from_4);
      if (planar.empty()) {
        const double u = from_4.translation.x();
        const double v = from_4.translation.y();
        const double distance_m = std::sqrt(u * u + v * v);
        const double reach_m = std::abs(robot.a2_m) + std::abs(robot.a3_m);
        const double least_m = std::abs(std::abs(robot.a2_m) - std::abs(robot.a3_m));
        if (distance_m > reach_m)
          too_far_m = too_far_m == 0 ? distance_m - reach_m : std::min(too_far_m, distance_m - reach_m);
        if (distance_m < least_m)
          too_near_m = too_near_m == 0 ? least_m - distance_m : std::min(too_near_m, least_m - distance_m);
      }
      for (const auto& [q2, q3, q4] : planar) {
        postures.push_back({Wrapped(q1), Wrapped(q2), Wrapped(q3), Wrapped(q4), Wrapped(q5), Wrapped(q6)});
      }
    }
  }
  if (!postures.empty()) return postures;
  if (too_far_m > 0) return Failure{"out of reach: too far by " + Mm(too_far_m)};
  return Failure{"out of reach: too near to the shoulder by " + Mm(too_near_m)};
}

}  // namespace heba
