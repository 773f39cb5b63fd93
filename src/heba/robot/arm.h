// The kinematics of a serial arm with the parameters of Denavit and Hartenberg (1955), and with the angle beta of
// Hayati and Mirmirani ("Improving the absolute positioning accuracy of robot manipulators", 1985) where the next axis
// is parallel: there, the parameters of Denavit and Hartenberg jump when the axis tilts.
//
//   base_from_tip = base_from_first * A_1 ... A_n * last_from_tip,
//   A_i = Rz(theta_i) Tz(d_i) Tx(a_i) Rx(alpha_i) Ry(beta_i),
//
// where the position of joint i adds to theta_i if the joint turns, and to d_i if it slides.
//
// The gear of a joint yields to the weight that it carries. To first order, its true position exceeds the commanded one
// by its compliance times the torque of gravity, q_i + c_i tau_i(q), with tau_i of the maker's parameters and masses at
// the commanded positions. The base's z axis points up.
//
//   const heba::Arm& arm = *heba::FindArm("ur5e");
//   const heba::Rigid3d base_from_flange = heba::BaseFromTip(arm, joints_rad);
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "heba/base/error.h"
#include "heba/geometry/rigid3.h"

namespace heba {

// The parameters of one joint, in the order in which they are counted.
enum class ArmParam : int { kTheta, kD, kA, kAlpha, kBeta, kCompliance };
inline constexpr int kNumArmParams = 6;

struct ArmJoint {
  double theta_rad = 0;
  double d_m = 0;
  double a_m = 0;
  double alpha_rad = 0;
  double beta_rad = 0;
  bool is_turning = true;
  double compliance = 0;  // rad/(N m) if the joint turns, m/N if it slides.

  double& operator[](ArmParam param);
  double operator[](ArmParam param) const;
};

// A body, as its weight acts: its mass and its centre of mass.
struct PointMass {
  double mass_kg = 0;
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
};

// The weight that the joints carry. It is part of an arm's nominal description: errors of the arm's parameters change
// the torques by a thousandth, which is neglected.
struct ArmLoad {
  Rigid3d base_from_first;
  std::vector<ArmJoint> joints;
  std::vector<PointMass> links;  // One per joint, in the frame that follows it: that of A_1 ... A_i.
};

// The positions between which a joint moves, rad or m.
struct JointLimits {
  double low = 0;
  double high = 0;
};

struct Arm {
  std::string name;
  Rigid3d base_from_first;
  std::vector<ArmJoint> joints;                   // The base's first.
  Rigid3d last_from_tip;                          // The tip is the flange, unless the source says otherwise.
  std::shared_ptr<const ArmLoad> load = nullptr;  // Null if the masses of the links are not known.
  std::vector<JointLimits> limits = {};           // One per joint; empty if they are not known.

  int num_joints() const { return static_cast<int>(joints.size()); }
  int num_params() const { return kNumArmParams * num_joints(); }
};

// Returns the place of a parameter among all of an arm.
inline int ArmParamPlace(int joint, ArmParam param) { return kNumArmParams * joint + static_cast<int>(param); }
// Returns the parameter that is at a place.
inline ArmParam ParamAt(int place) { return static_cast<ArmParam>(place % kNumArmParams); }
// Returns the name of a parameter in files, with the joints counted from 1: "joint2.offset" for theta, "joint2.d".
std::string ArmParamName(int place);
// Returns the unit of a parameter: "rad", "m", and for a compliance "rad/(N m)", or "m/N" if the joint slides.
std::string_view ArmParamUnit(const Arm& arm, int place);

// Returns the arm with `changes` (one number per parameter, in its unit) added to its parameters. Its load stays.
Arm WithChanges(Arm arm, const Eigen::VectorXd& changes);

// Returns the arm with the weight of these links, one per joint, with centres in the frames that follow the joints.
Arm WithLinks(Arm arm, std::vector<PointMass> links);
// Likewise with centres in the base when all joints are at zero.
Arm WithLinksInBase(Arm arm, std::vector<PointMass> links_in_base);
// Returns the arm with the weight and the limits of `other`, whose joints must be at the same places; without those
// that it does not have.
Arm WithLoadAndLimitsOf(Arm arm, const Arm& other);
// Returns the arm with a mass on its tip, with its centre in the tip's frame. The arm must have a load.
Arm WithPayload(Arm arm, const PointMass& payload);
// Returns the arm without its load and its compliances.
Arm RigidPart(Arm arm);

// Returns the torque of gravity about each joint (N m), or the force along it if it slides (N), in the direction in
// which the joint's position increases; zeros if the arm has no load.
Eigen::VectorXd GravityTorques(const Arm& arm, const Eigen::VectorXd& joints);

// Returns the pose of the tip. `joints` are the positions of the joints, rad or m. `by_joints` and `by_params`, which
// may be null, become the derivatives of the tangent of the pose (Tangent6: m, rad, in the tip's frame). `by_joints`
// are those by the true positions of the joints, from which those by the commanded ones differ by some thousandths.
Rigid3d BaseFromTip(const Arm& arm, const Eigen::VectorXd& joints, Matrix6X* by_joints = nullptr,
                    Matrix6X* by_params = nullptr);
// Likewise with the torques of gravity at these joints, which are the same for all errors of an arm.
Rigid3d BaseFromTip(const Arm& arm, const Eigen::VectorXd& joints, const Eigen::VectorXd& torques, Matrix6X* by_joints,
                    Matrix6X* by_params);

// The axis of a joint, in the base, with all joints at zero.
struct ArmAxis {
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  // Unit vector; the joint turns right-handed about it.
  Eigen::Vector3d point = Eigen::Vector3d::Zero();       // A point on the axis, m.
  bool is_turning = true;
};

// Axes whose directions differ by less are parallel, in the choice of parameters.
inline constexpr double kParallelRad = 0.05;

// Returns the arm with these axes, the base's first, whose tip is at `base_from_tip` when all joints are at zero. The
// parameters of the last joint are zero.
Arm ArmFromAxes(std::string name, const std::vector<ArmAxis>& axes, const Rigid3d& base_from_tip);

// Returns, for each joint, its axis when the joints are truly at `joints`.
std::vector<ArmAxis> AxesOf(const Arm& arm, const Eigen::VectorXd& joints);

// Returns whether the axes of joints i and i + 1 are parallel, so that the arm needs the angle beta of joint i.
bool IsParallelToNext(const Arm& arm, int joint);

}  // namespace heba
