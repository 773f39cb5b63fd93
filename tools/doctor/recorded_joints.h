// The tool that recorded joints and poses imply, for every way in which they may belong together.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "heba/geometry/rigid3.h"
#include "heba/robot/arm.h"

namespace heba {

// The pose of the gripper on the tip that the captures share, and how far single captures are from it. Figures of the
// scatter are 70 % quantiles.
struct ImpliedTool {
  Rigid3d tip_from_gripper;
  double scatter_m = 0;
  double scatter_rad = 0;
  // Both combined, with the rotation as the motion of a point at half a metre.
  double misfit_m = 0;
};

// Returns the tool for joints (rad or m) and poses, one per capture. Captures that contradict the others do not affect
// it as long as they are fewer than three of ten. There must be at least one capture.
ImpliedTool ImpliedToolOf(const Arm& arm, const std::vector<Eigen::VectorXd>& joints,
                          const std::vector<Rigid3d>& base_from_gripper);

// One way in which joints and poses may belong together.
struct JointReading {
  enum class Mistake { kNone, kAngle, kBase, kArm, kPairing };
  Arm arm;
  std::vector<Eigen::VectorXd> joints;  // One entry per capture; empty for a capture without joints.
  Rigid3d arm_base_from_base;           // The base of the poses in that of the arm.
  std::vector<Mistake> mistakes;        // The mistakes that lead from this reading to the config's.
  std::string pairing;                  // How the rows belong together, as a clause, if not in their order.
  ImpliedTool tool;
};

// Returns the reading of the config: these joints and poses as they are.
JointReading ReadingAsStated(const Arm& arm, const std::vector<Eigen::VectorXd>& joints,
                             const std::vector<Rigid3d>& base_from_gripper);

// Returns other readings: each arm of `arms` with as many joints, joints in degrees that were read as radians and the
// reverse, a base that is rotated by 180 deg about z or that is any other, rows that are shifted or reversed, and the
// angles combined with each. The most likely mistakes come first.
std::vector<JointReading> OtherReadings(const Arm& arm, const std::vector<Arm>& arms,
                                        const std::vector<Eigen::VectorXd>& joints,
                                        const std::vector<Rigid3d>& base_from_gripper);

}  // namespace heba
