// The kinematics of a serial arm with the parameters of Denavit and Hartenberg (1955), and with the angle beta of
// Hayati and Mirmirani ("Improving the absolute positioning accuracy of robot manipulators", 1985) where the next axis
// is parallel: there, the parameters of Denavit and Hartenberg jump when the axis tilts.
//
//   base_from_tip = base_from_first * A_1 ... A_n * last_from_tip,
//   A_i = Rz(theta_i) Tz(d_i) Tx(a_i) Rx(alpha_i) Ry(beta_i),
//
// where the position of joint i adds to theta_i if the joint turns, and to d_i if it slides.
//
//   const heba::Arm& arm = *heba::FindArm("ur5e");
//   const heba::Rigid3d base_from_flange = heba::BaseFromTip(arm, joints_rad);
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "heba/base/error.h"
#include "heba/geometry/rigid3.h"

namespace heba {

// The parameters of one joint, in the order in which they are counted.
enum class ArmParam : int { kTheta, kD, kA, kAlpha, kBeta };
inline constexpr int kNumArmParams = 5;

struct ArmJoint {
  double theta_rad = 0;
  double d_m = 0;
  double a_m = 0;
  double alpha_rad = 0;
  double beta_rad = 0;
  bool is_turning = true;

  double& operator[](ArmParam param);
  double operator[](ArmParam param) const;
};

struct Arm {
  std::string name;
  Rigid3d base_from_first;
  std::vector<ArmJoint> joints;  // The base's first.
  Rigid3d last_from_tip;         // The tip is the flange, unless the source says otherwise.

  int num_joints() const { return static_cast<int>(joints.size()); }
  int num_params() const { return kNumArmParams * num_joints(); }
};

// Returns the place of a parameter among all of an arm.
inline int ArmParamPlace(int joint, ArmParam param) { return kNumArmParams * joint + static_cast<int>(param); }
// Returns the name of a parameter in files, with the joints counted from 1: "joint2.offset" for theta, "joint2.d".
std::string ArmParamName(int place);
// Returns whether a parameter is an angle (rad); otherwise it is a length (m).
bool IsAngle(int place);

// Returns the arm with `changes` (one number per parameter, m and rad) added to its parameters.
Arm WithChanges(Arm arm, const Eigen::VectorXd& changes);

// Returns the pose of the tip. `joints` are the positions of the joints, rad or m. `by_joints` and `by_params`, which
// may be null, become the derivatives of the tangent of the pose (Tangent6: m, rad, in the tip's frame).
Rigid3d BaseFromTip(const Arm& arm, const Eigen::VectorXd& joints, Matrix6X* by_joints = nullptr,
                    Matrix6X* by_params = nullptr);

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

// Returns, for each joint, its axis when the joints are at `joints`.
std::vector<ArmAxis> AxesOf(const Arm& arm, const Eigen::VectorXd& joints);

// Returns whether the axes of joints i and i + 1 are parallel, so that the arm needs the angle beta of joint i.
bool IsParallelToNext(const Arm& arm, int joint);

}  // namespace heba
