#include "heba/robot/arm.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

namespace heba {
namespace {

// Members of ArmJoint, in the order of ArmParam.
constexpr std::array<double ArmJoint::*, kNumArmParams> kMembers = {&ArmJoint::theta_rad, &ArmJoint::d_m,
                                                                    &ArmJoint::a_m,       &ArmJoint::alpha_rad,
                                                                    &ArmJoint::beta_rad,  &ArmJoint::compliance};
constexpr std::array<std::string_view, kNumArmParams> kNames = {"offset", "d", "a", "alpha", "beta", "compliance"};

Rigid3d Turn(double angle_rad, const Eigen::Vector3d& axis) {
  return Rigid3d(Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, axis)), Eigen::Vector3d::Zero());
}

Rigid3d Shift(const Eigen::Vector3d& by_m) { return Rigid3d(Eigen::Quaterniond::Identity(), by_m); }

// The motion of one parameter: a turn about an axis of the frame that precedes it, or a shift along it. The compliance,
// the last parameter, moves with the joint.
struct Motion {
  int axis;
  bool is_turn;
};
constexpr int kNumMotions = 5;
constexpr std::array<Motion, kNumMotions> kMotions = {{{2, true}, {2, false}, {0, false}, {0, true}, {1, true}}};

Rigid3d PoseOf(const Motion& motion, double amount) {
  const Eigen::Vector3d axis = Eigen::Vector3d::Unit(motion.axis);
  return motion.is_turn ? Turn(amount, axis) : Shift(amount * axis);
}

// A frame of the arm in the tip's. Motions act on single columns of the rotation matrix, which is several times faster
// than products of poses.
struct TipFromFrame {
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;

  // Moves on to the frame from which `motion` by `amount` leads to this one.
  void Undo(const Motion& motion, double amount) {
    if (!motion.is_turn) {
      translation -= amount * rotation.col(motion.axis);
      return;
    }
    const int y = (motion.axis + 1) % 3;
    const int z = (motion.axis + 2) % 3;
    const double c = std::cos(amount);
    const double s = std::sin(amount);
    const Eigen::Vector3d along_y = rotation.col(y);
    rotation.col(y) = c * along_y - s * rotation.col(z);
    rotation.col(z) = s * along_y + c * rotation.col(z);
  }

  // Returns the tangent, in the tip's frame, of a motion of the frame.
  Tangent6 TangentOf(const Motion& motion) const {
    const Eigen::Vector3d axis = rotation.col(motion.axis);
    Tangent6 tangent;
    if (motion.is_turn) {
      tangent << translation.cross(axis), axis;
    } else {
      tangent << axis, Eigen::Vector3d::Zero();
    }
    return tangent;
  }
};

// Returns the position of the joint that adds to a parameter: to theta if it turns, to d if it slides.
int MovedParam(const ArmJoint& joint) { return static_cast<int>(joint.is_turning ? ArmParam::kTheta : ArmParam::kD); }

double AmountOf(const ArmJoint& joint, int param, double position) {
  return joint.*kMembers[static_cast<size_t>(param)] + (param == MovedParam(joint) ? position : 0);
}

// Returns A_i, the pose of the next frame in that of a joint at this position.
Rigid3d LinkPose(const ArmJoint& joint, double position) {
  Rigid3d pose;
  for (int param = 0; param < kNumMotions; ++param) {
    const double amount = AmountOf(joint, param, position);
    if (amount != 0) pose = pose * PoseOf(kMotions[static_cast<size_t>(param)], amount);
  }
  return pose;
}

// Returns the poses in the base of the frames that follow the joints when these are at zero.
std::vector<Rigid3d> LinkFrames(const Arm& arm) {
  std::vector<Rigid3d> frames;
  Rigid3d base_from_link = arm.base_from_first;
  for (const ArmJoint& joint : arm.joints) {
    base_from_link = base_from_link * LinkPose(joint, 0);
    frames.push_back(base_from_link);
  }
  return frames;
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

std::string_view ArmParamUnit(const Arm& arm, int place) {
  const int param = place % kNumArmParams;
  if (param < kNumMotions) return kMotions[static_cast<size_t>(param)].is_turn ? "rad" : "m";
  return arm.joints[static_cast<size_t>(place / kNumArmParams)].is_turning ? "rad/(N m)" : "m/N";
}

Arm WithChanges(Arm arm, const Eigen::VectorXd& changes) {
  CHECK_EQ(changes.size(), arm.num_params());
  for (int place = 0; place < arm.num_params(); ++place) {
    arm.joints[static_cast<size_t>(place / kNumArmParams)][ParamAt(place)] += changes[place];
  }
  return arm;
}

Arm WithLinks(Arm arm, std::vector<PointMass> links) {
  CHECK_EQ(links.size(), arm.joints.size());
  arm.load = std::make_shared<const ArmLoad>(ArmLoad{arm.base_from_first, arm.joints, std::move(links)});
  return arm;
}

Arm WithLinksInBase(Arm arm, std::vector<PointMass> links_in_base) {
  CHECK_EQ(links_in_base.size(), arm.joints.size());
  const std::vector<Rigid3d> frames = LinkFrames(arm);
  for (size_t j = 0; j < frames.size(); ++j) {
    links_in_base[j].centre_m = Inverse(frames[j]) * links_in_base[j].centre_m;
  }
  return WithLinks(std::move(arm), std::move(links_in_base));
}

Arm WithLoadAndLimitsOf(Arm arm, const Arm& other) {
  arm.limits = other.limits;
  arm.load = nullptr;
  if (other.load == nullptr) return arm;
  std::vector<PointMass> links = other.load->links;
  const std::vector<Rigid3d> frames = LinkFrames(other);
  for (size_t j = 0; j < frames.size(); ++j) links[j].centre_m = frames[j] * links[j].centre_m;
  return WithLinksInBase(std::move(arm), std::move(links));
}

Arm WithPayload(Arm arm, const PointMass& payload) {
  CHECK(arm.load != nullptr);
  std::vector<PointMass> links = arm.load->links;
  PointMass& last = links.back();
  const double mass_kg = last.mass_kg + payload.mass_kg;
  if (mass_kg > 0) {
    last.centre_m = (last.mass_kg * last.centre_m + payload.mass_kg * (arm.last_from_tip * payload.centre_m)) / mass_kg;
  }
  last.mass_kg = mass_kg;
  return WithLinks(std::move(arm), std::move(links));
}

Arm RigidPart(Arm arm) {
  arm.load = nullptr;
  for (ArmJoint& joint : arm.joints) joint.compliance = 0;
  return arm;
}

Eigen::VectorXd GravityTorques(const Arm& arm, const Eigen::VectorXd& joints) {
  CHECK_EQ(joints.size(), arm.num_joints());
  Eigen::VectorXd torques = Eigen::VectorXd::Zero(arm.num_joints());
  if (arm.load == nullptr) return torques;
  const ArmLoad& load = *arm.load;
  std::vector<Rigid3d> base_from_joint = {load.base_from_first};
  for (size_t j = 0; j < load.joints.size(); ++j) {
    base_from_joint.push_back(base_from_joint.back() * LinkPose(load.joints[j], joints[static_cast<Eigen::Index>(j)]));
  }
  const Eigen::Vector3d gravity(0, 0, -9.81);  // m/s^2.
  // The mass that a joint carries, and its moment about the base.
  double mass_kg = 0;
  Eigen::Vector3d moment_kg_m = Eigen::Vector3d::Zero();
  for (size_t j = load.joints.size(); j-- > 0;) {
    mass_kg += load.links[j].mass_kg;
    moment_kg_m += load.links[j].mass_kg * (base_from_joint[j + 1] * load.links[j].centre_m);
    const Eigen::Vector3d axis = base_from_joint[j].rotation * Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d lever_kg_m = moment_kg_m - mass_kg * base_from_joint[j].translation;
    torques[static_cast<Eigen::Index>(j)] =
        load.joints[j].is_turning ? axis.dot(lever_kg_m.cross(gravity)) : mass_kg * axis.dot(gravity);
  }
  return torques;
}

Rigid3d BaseFromTip(const Arm& arm, const Eigen::VectorXd& joints, Matrix6X* by_joints, Matrix6X* by_params) {
  const bool yields =
      std::any_of(arm.joints.begin(), arm.joints.end(), [](const ArmJoint& joint) { return joint.compliance != 0; });
  if (arm.load == nullptr || (by_params == nullptr && !yields)) {
    return BaseFromTip(arm, joints, Eigen::VectorXd(), by_joints, by_params);
  }
  return BaseFromTip(arm, joints, GravityTorques(arm, joints), by_joints, by_params);
}

Rigid3d BaseFromTip(const Arm& arm, const Eigen::VectorXd& joints, const Eigen::VectorXd& torques, Matrix6X* by_joints,
                    Matrix6X* by_params) {
  CHECK_EQ(joints.size(), arm.num_joints());
  // Without torques, they are zero.
  CHECK(torques.size() == joints.size() || torques.size() == 0);
  if (by_joints != nullptr) by_joints->resize(6, arm.num_joints());
  if (by_params != nullptr) by_params->resize(6, arm.num_params());
  // The product is formed from the tip on, so that every frame is known in the tip's.
  const Rigid3d tip_from_last = Inverse(arm.last_from_tip);
  TipFromFrame frame{tip_from_last.RotationMatrix(), tip_from_last.translation};
  for (int j = arm.num_joints() - 1; j >= 0; --j) {
    const ArmJoint& joint = arm.joints[static_cast<size_t>(j)];
    const double torque = torques.size() == 0 ? 0 : torques[j];
    for (int param = kNumMotions - 1; param >= 0; --param) {
      const Motion& motion = kMotions[static_cast<size_t>(param)];
      const double amount = AmountOf(joint, param, joints[j] + joint.compliance * torque);
      if (amount != 0) frame.Undo(motion, amount);
      if (by_joints == nullptr && by_params == nullptr) continue;
      const Tangent6 tangent = frame.TangentOf(motion);
      if (by_params != nullptr) by_params->col(kNumArmParams * j + param) = tangent;
      if (param != MovedParam(joint)) continue;
      if (by_joints != nullptr) by_joints->col(j) = tangent;
      if (by_params != nullptr) by_params->col(ArmParamPlace(j, ArmParam::kCompliance)) = torque * tangent;
    }
  }
  return arm.base_from_first * Inverse(Rigid3d(frame.rotation, frame.translation));
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
    base_from_joint = base_from_joint * LinkPose(joint, 0);
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
    base_from_joint = base_from_joint * LinkPose(joint, joints[j]);
  }
  return axes;
}

bool IsParallelToNext(const Arm& arm, int joint) {
  if (joint + 1 >= arm.num_joints()) return false;
  const ArmJoint& at = arm.joints[static_cast<size_t>(joint)];
  return std::abs(std::sin(at.alpha_rad)) < std::sin(kParallelRad);
}

}  // namespace heba
