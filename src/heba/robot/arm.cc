#include "heba/robot/arm.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

namespace heba {
namespace {

// Members of ArmJoint, in the order of ArmParam.
constexpr std::array<double ArmJoint::*, kNumArmParams> kMembers = {
    &ArmJoint::theta_rad, &ArmJoint::d_m, &ArmJoint::a_m, &ArmJoint::alpha_rad, &ArmJoint::beta_rad};
constexpr std::array<std::string_view, kNumArmParams> kNames = {"offset", "d", "a", "alpha", "beta"};

Rigid3d Turn(double angle_rad, const Eigen::Vector3d& axis) {
  return Rigid3d(Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, axis)), Eigen::Vector3d::Zero());
}

Rigid3d Shift(const Eigen::Vector3d& by_m) { return Rigid3d(Eigen::Quaterniond::Identity(), by_m); }

// The motion of one parameter: a turn about an axis of the frame that precedes it, or a shift along it.
struct Motion {
  int axis;
  bool is_turn;
};
constexpr std::array<Motion, kNumArmParams> kMotions = {{{2, true}, {2, false}, {0, false}, {0, true}, {1, true}}};

Rigid3d PoseOf(const Motion& motion, double amount) {
  const Eigen::Vector3d axis = Eigen::Vector3d::Unit(motion.axis);
  return motion.is_turn ? Turn(amount, axis) : Shift(amount * axis);
}

// Returns the tangent, in the tip's frame, of a motion of the frame whose pose in the tip is `tip_from_frame`.
Tangent6 TipTangent(const Motion& motion, const Rigid3d& tip_from_frame) {
  const Eigen::Vector3d axis = tip_from_frame.rotation * Eigen::Vector3d::Unit(motion.axis);
  Tangent6 tangent;
  if (motion.is_turn) {
    tangent << tip_from_frame.translation.cross(axis), axis;
  } else {
    tangent << axis, Eigen::Vector3d::Zero();
  }
  return tangent;
}

// Returns the position of the joint that adds to a parameter: to theta if it turns, to d if it slides.
int MovedParam(const ArmJoint& joint) { return static_cast<int>(joint.is_turning ? ArmParam::kTheta : ArmParam::kD); }

double AmountOf(const ArmJoint& joint, int param, double position) {
  return joint.*kMembers[static_cast<size_t>(param)] + (param == MovedParam(joint) ? position : 0);
}

// Returns a unit vector that is perpendicular to `direction`, in the plane of `direction` and the base's x axis if
// these differ.
Eigen::Vector3d PerpendicularTo(const Eigen::Vector3d& direction) {
  const Eigen::Vector3d start =
      std::abs(direction.x()) < 0.9 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d(Eigen::Vector3d::UnitY());
  return (start - start.dot(direction) * direction).normalized();
}

Rigid3d FrameOf(const Eigen::Vector3d& x, const Eigen::Vector3d& z, const Eigen::Vector3d& origin) {
  Eigen::Matrix3d rotation;
  rotation << x, z.cross(x), z;
  return Rigid3d(rotation, origin);
}

}  // namespace

double& ArmJoint::operator[](ArmParam param) { return this->*kMembers[static_cast<size_t>(param)]; }

double ArmJoint::operator[](ArmParam param) const { return this->*kMembers[static_cast<size_t>(param)]; }

std::string ArmParamName(int place) {
  return "joint" + std::to_string(place / kNumArmParams + 1) + "." +
         std::string(kNames[static_cast<size_t>(place % kNumArmParams)]);
}

bool IsAngle(int place) { return kMotions[static_cast<size_t>(place % kNumArmParams)].is_turn; }

Arm WithChanges(Arm arm, const Eigen::VectorXd& changes) {
  CHECK_EQ(changes.size(), arm.num_params());
  for (int place = 0; place < arm.num_params(); ++place) {
    arm.joints[static_cast<size_t>(place / kNumArmParams)][static_cast<ArmParam>(place % kNumArmParams)] +=
        changes[place];
  }
  return arm;
}

Rigid3d BaseFromTip(const Arm& arm, const Eigen::VectorXd& joints, Matrix6X* by_joints, Matrix6X* by_params) {
  CHECK_EQ(joints.size(), arm.num_joints());
  if (by_joints != nullptr) by_joints->resize(6, arm.num_joints());
  if (by_params != nullptr) by_params->resize(6, arm.num_params());
  // The product is formed from the tip on, so that every frame is known in the tip's.
  Rigid3d frame_from_tip = arm.last_from_tip;
  for (int j = arm.num_joints() - 1; j >= 0; --j) {
    const ArmJoint& joint = arm.joints[static_cast<size_t>(j)];
    for (int param = kNumArmParams - 1; param >= 0; --param) {
      const Motion& motion = kMotions[static_cast<size_t>(param)];
      const double amount = AmountOf(joint, param, joints[j]);
      if (amount != 0) frame_from_tip = PoseOf(motion, amount) * frame_from_tip;
      if (by_joints == nullptr && by_params == nullptr) continue;
      const Tangent6 tangent = TipTangent(motion, Inverse(frame_from_tip));
      if (by_params != nullptr) by_params->col(kNumArmParams * j + param) = tangent;
      if (by_joints != nullptr && param == MovedParam(joint)) by_joints->col(j) = tangent;
    }
  }
  return arm.base_from_first * frame_from_tip;
}

Arm ArmFromAxes(std::string name, const std::vector<ArmAxis>& axes, const Rigid3d& base_from_tip) {
  CHECK(!axes.empty());
  Arm arm;
  arm.name = std::move(name);
  const ArmAxis& first = axes.front();
  // The origin of the first frame is the point of its axis next to the base's.
  Rigid3d base_from_joint = FrameOf(PerpendicularTo(first.direction), first.direction,
                                    first.point - first.point.dot(first.direction) * first.direction);
  arm.base_from_first = base_from_joint;
  constexpr double kNothingM = 1e-9;
  for (size_t i = 0; i < axes.size(); ++i) {
    ArmJoint joint;
    joint.is_turning = axes[i].is_turning;
    if (i + 1 == axes.size()) {
      arm.joints.push_back(joint);
      break;
    }
    const Rigid3d joint_from_base = Inverse(base_from_joint);
    const Eigen::Vector3d z = joint_from_base.rotation * axes[i + 1].direction;
    const Eigen::Vector3d point = joint_from_base * axes[i + 1].point;
    const double sine = z.head<2>().norm();
    if (sine < std::sin(kParallelRad)) {
      // The next axis meets the plane z = 0 of this frame.
      const Eigen::Vector3d meeting = point - z * (point.z() / z.z());
      joint.a_m = meeting.head<2>().norm();
      joint.theta_rad = joint.a_m > kNothingM ? std::atan2(meeting.y(), meeting.x()) : 0;
      const Eigen::Vector3d turned = Turn(-joint.theta_rad, Eigen::Vector3d::UnitZ()) * z;
      joint.alpha_rad = std::atan2(-turned.y(), turned.z());
      joint.beta_rad = std::asin(std::clamp(turned.x(), -1.0, 1.0));
    } else {
      // The common normal of both axes is the next x axis. It points to the next axis.
      Eigen::Vector3d x(-z.y() / sine, z.x() / sine, 0);
      double a_m = point.dot(x);
      const bool has_wrong_sense = std::abs(a_m) > kNothingM ? a_m < 0 : x.x() < -kNothingM;
      if (has_wrong_sense) {
        x = -x;
        a_m = -a_m;
      }
      const Eigen::Vector3d y = Eigen::Vector3d::UnitZ().cross(x);
      joint.theta_rad = std::atan2(x.y(), x.x());
      joint.a_m = std::abs(a_m) > kNothingM ? a_m : 0;
      joint.alpha_rad = std::atan2(-z.dot(y), z.z());
      // The next axis crosses the common normal where its component along y vanishes.
      joint.d_m = (point - z * (point.dot(y) / z.dot(y))).z();
    }
    for (int param = 0; param < kNumArmParams; ++param) {
      base_from_joint = base_from_joint * PoseOf(kMotions[static_cast<size_t>(param)], AmountOf(joint, param, 0));
    }
    arm.joints.push_back(joint);
  }
  arm.last_from_tip = Inverse(base_from_joint) * base_from_tip;
  return arm;
}

std::vector<ArmAxis> AxesOf(const Arm& arm, const Eigen::VectorXd& joints) {
  CHECK_EQ(joints.size(), arm.num_joints());
  std::vector<ArmAxis> axes;
  Rigid3d base_from_joint = arm.base_from_first;
  for (int j = 0; j < arm.num_joints(); ++j) {
    const ArmJoint& joint = arm.joints[static_cast<size_t>(j)];
    axes.push_back(
        {base_from_joint.rotation * Eigen::Vector3d::UnitZ(), base_from_joint.translation, joint.is_turning});
    for (int param = 0; param < kNumArmParams; ++param) {
      base_from_joint =
          base_from_joint * PoseOf(kMotions[static_cast<size_t>(param)], AmountOf(joint, param, joints[j]));
    }
  }
  return axes;
}

bool IsParallelToNext(const Arm& arm, int joint) {
  if (joint + 1 >= arm.num_joints()) return false;
  const ArmJoint& at = arm.joints[static_cast<size_t>(joint)];
  return std::abs(std::sin(at.alpha_rad)) < std::sin(kParallelRad);
}

}  // namespace heba
