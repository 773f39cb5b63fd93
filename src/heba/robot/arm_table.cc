#include "heba/robot/arm_table.h"

#include <algorithm>
#include <array>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/registry.h"
#include "heba/base/units.h"
#include "heba/robot/ur_kinematics.h"

namespace heba {
namespace {

ArmJoint DhJoint(double theta_deg, double d_m, double a_m, double alpha_deg) {
  return {DegToRad(theta_deg), d_m, a_m, DegToRad(alpha_deg)};
}

Arm ArmOf(const UrRobot& robot) {
  return {robot.name,
          {},
          {DhJoint(0, robot.d1_m, 0, 90), DhJoint(0, 0, robot.a2_m, 0), DhJoint(0, 0, robot.a3_m, 0),
           DhJoint(0, robot.d4_m, 0, 90), DhJoint(0, robot.d5_m, 0, -90), DhJoint(0, robot.d6_m, 0, 0)},
          {}};
}

// Returns the arms, that of this name with the weight of its links.
std::vector<Arm> WithLinksOf(std::vector<Arm> arms, std::string_view name, std::vector<PointMass> links) {
  const auto arm = std::find_if(arms.begin(), arms.end(), [&](const Arm& other) { return other.name == name; });
  if (arm != arms.end()) *arm = WithLinks(std::move(*arm), std::move(links));
  return arms;
}

// Returns the arms, that of this name with the limits of its joints.
std::vector<Arm> WithLimitsOf(std::vector<Arm> arms, std::string_view name, std::vector<JointLimits> limits) {
  const auto arm = std::find_if(arms.begin(), arms.end(), [&](const Arm& other) { return other.name == name; });
  CHECK(arm != arms.end() && limits.size() == arm->joints.size()) << name;
  arm->limits = std::move(limits);
  return arms;
}

Arm DhArm(std::string name, std::vector<ArmJoint> joints) { return {std::move(name), {}, std::move(joints), {}}; }

// The dimensions of an arm with an ortho-parallel base and a spherical wrist; see arms.def.
struct OpwDimensions {
  double a1_m, a2_m, b_m, c1_m, c2_m, c3_m, c4_m;
};

Arm OpwArm(std::string name, const OpwDimensions& by, const std::array<double, 6>& zeros_deg,
           const std::array<double, 6>& signs) {
  const Eigen::Vector3d shoulder(by.a1_m, by.b_m, by.c1_m);
  const Eigen::Vector3d elbow = shoulder + Eigen::Vector3d(0, 0, by.c2_m);
  const Eigen::Vector3d wrist = elbow + Eigen::Vector3d(by.a2_m, 0, by.c3_m);
  const Eigen::Vector3d y = Eigen::Vector3d::UnitY();
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  std::vector<ArmAxis> axes = {
      {z, Eigen::Vector3d::Zero()}, {y, shoulder}, {y, elbow}, {z, wrist}, {y, wrist}, {z, wrist}};
  for (size_t i = 0; i < axes.size(); ++i) axes[i].direction *= signs[i];
  Arm arm = ArmFromAxes(std::move(name), axes,
                        Rigid3d(Eigen::Quaterniond::Identity(), wrist + Eigen::Vector3d(0, 0, by.c4_m)));
  for (size_t i = 0; i < axes.size(); ++i) arm.joints[i].theta_rad -= signs[i] * DegToRad(zeros_deg[i]);
  return arm;
}

std::vector<Arm> MakeArms() {
  std::vector<Arm> arms;
  for (const UrRobot& robot : UrRobots()) arms.push_back(ArmOf(robot));
#define HEBA_UR_ROBOT(name, d1, a2, a3, d4, d5, d6)
#define HEBA_UR_LINK(mass, x, y, z) \
  PointMass {                       \
    mass, { x, y, z }               \
  }
#define HEBA_UR_LINKS(name, ...) arms = WithLinksOf(std::move(arms), #name, {__VA_ARGS__});
#include "heba/robot/ur_robots.def"
#undef HEBA_UR_LINKS
#undef HEBA_UR_LINK
#undef HEBA_UR_ROBOT
#define HEBA_DH_JOINT(theta, d, a, alpha) DhJoint(theta, d, a, alpha)
#define HEBA_SIX(...) \
  { __VA_ARGS__ }
#define HEBA_DH_ARM(name, ...) arms.push_back(DhArm(#name, {__VA_ARGS__}));
#define HEBA_OPW_ARM(name, a1, a2, b, c1, c2, c3, c4, ...) \
  arms.push_back(OpwArm(#name, {a1, a2, b, c1, c2, c3, c4}, __VA_ARGS__));
#include "heba/robot/arms.def"
#undef HEBA_OPW_ARM
#undef HEBA_DH_ARM
#undef HEBA_SIX
#undef HEBA_DH_JOINT
#define HEBA_JOINT(low, high) \
  JointLimits { DegToRad(low), DegToRad(high) }
#define HEBA_JOINT_LIMITS(name, ...) arms = WithLimitsOf(std::move(arms), #name, {__VA_ARGS__});
#include "heba/robot/joint_limits.def"
#undef HEBA_JOINT_LIMITS
#undef HEBA_JOINT
  return arms;
}

}  // namespace

const std::vector<Arm>& Arms() {
  static const std::vector<Arm> arms = MakeArms();
  return arms;
}

std::vector<std::string> ArmNames() { return NamesOf(Arms()); }

const Arm* FindArm(std::string_view name) { return FindEntry(Arms(), name); }

}  // namespace heba
