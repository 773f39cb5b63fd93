// Any arm, from its URDF: where its tip is for given joints, and joints that bring it to a given place.
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/geometry/rigid3.h"

namespace heba {

// A serial chain of revolute, continuous, prismatic and fixed joints, by the Kinematics and Dynamics Library (KDL).
class UrdfArm {
 public:
  // The chain between two links. Without names: from the root to the only link that has no child. InputError if the
  // file is not a URDF, has no such links, branches without a tip being named, or a joint of the chain is of another
  // kind or mimics one.
  static std::shared_ptr<const UrdfArm> Read(const std::filesystem::path& path, const std::string& base_link = "",
                                             const std::string& tip_link = "");
  virtual ~UrdfArm() = default;

  // Of the joints that move, from the base on.
  virtual const std::vector<std::string>& joint_names() const = 0;
  // Whether joint i turns (rad) or slides (m).
  virtual bool IsTurning(size_t i) const = 0;
  virtual Rigid3d BaseFromTip(std::span<const double> joints) const = 0;
  // Joints within their limits that reach the pose to 1e-6 m and rad, different postures if several starts find them:
  // numerically, by Levenberg and Marquardt from fixed starts. A Failure if none is found, which does not prove that
  // there is none.
  virtual Outcome<std::vector<std::vector<double>>> PosturesOf(const Rigid3d& base_from_tip) const = 0;
};

}  // namespace heba
