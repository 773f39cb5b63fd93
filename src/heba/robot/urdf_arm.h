// Kinematics of an arbitrary arm from its URDF.
//
//   const heba::UrdfArm urdf = heba::ReadUrdfArm("arm.urdf", "base_link", "tool0");
//   const heba::Rigid3d base_from_tip = heba::BaseFromTip(urdf.arm, Eigen::VectorXd::Zero(urdf.arm.num_joints()));
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/robot/arm.h"

namespace heba {

// A serial chain of revolute, continuous, prismatic and fixed joints.
struct UrdfArm {
  // It has no name. It has the limits of its joints, and the masses of its links (<inertial>) if the file has them.
  // Links beyond the tip, and those on other branches, weigh on the joints with their own joints at zero.
  Arm arm;
  std::vector<std::string> joint_names;  // Those that move, beginning at the base.
};

// Reads the chain between two links. By default, the chain begins at the root and ends at the only link that has no
// child. Throws InputError if the file is not a URDF, if it has no such links, if it has several branches and no tip is
// named, or if a joint of the chain is of another kind or mimics another joint.
UrdfArm ReadUrdfArm(const std::filesystem::path& path, const std::string& base_link = "",
                    const std::string& tip_link = "");

}  // namespace heba
