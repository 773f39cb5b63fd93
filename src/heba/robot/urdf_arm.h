// Kinematics of an arbitrary arm from its URDF: the pose of the tip for given joints, and joints that reach a given
// pose.
//
//   const std::shared_ptr<const heba::UrdfArm> arm = heba::UrdfArm::Read("arm.urdf", "base_link", "tool0");
//   const heba::Rigid3d base_from_tip = arm->BaseFromTip(std::vector<double>(arm->joint_names().size(), 0.0));
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/geometry/rigid3.h"
#include "heba/robot/arm.h"

namespace heba {

// A serial chain of revolute, continuous, prismatic and fixed joints, evaluated by the Kinematics and Dynamics Library
// (KDL).
class UrdfArm {
 public:
  // Reads the chain between two links. By default, the chain begins at the root and ends at the only link that has no
  // child. Throws InputError if the file is not a URDF, if it has no such links, if it has several branches and no tip
  // is named, or if a joint of the chain is of another kind or mimics another joint.
  static std::shared_ptr<const UrdfArm> Read(const std::filesystem::path& path, const std::string& base_link = "",
                                             const std::string& tip_link = "");
  virtual ~UrdfArm() = default;

  // Returns the names of the moving joints, beginning at the base.
  virtual const std::vector<std::string>& joint_names() const = 0;
  // Returns whether joint i rotates (rad) or slides (m).
  virtual bool IsTurning(size_t i) const = 0;
  virtual Rigid3d BaseFromTip(std::span<const double> joints) const = 0;
  // Returns the same arm with the parameters of Denavit, Hartenberg and Hayati, with its joint limits, and with the
  // masses of its links (<inertial>) if the file has them. Links beyond the tip, and those on other branches, weigh on
  // the joints with their own joints at zero. Its name is empty.
  virtual Arm Kinematics() const = 0;
};

}  // namespace heba
