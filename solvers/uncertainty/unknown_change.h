// The change from one estimate to another, unknown by unknown.
#pragma once

#include <span>
#include <string_view>

#include <Eigen/Core>

#include "heba/data/unknowns.h"
#include "heba/geometry/rigid3.h"

namespace heba {

// A change in the layout of an estimate's unknowns. Unknowns that are not set do not change, and blocks that the layout
// does not have are ignored.
class UnknownChange {
 public:
  explicit UnknownChange(const UnknownLayout& layout);

  // Sets the tangent from one pose to another.
  void SetPose(std::string_view block, const Rigid3d& from, const Rigid3d& to);
  // Sets the differences of all parameters that the block has free. `from` and `to` hold those that are held too.
  void SetParams(std::string_view block, std::span<const double> from, std::span<const double> to);

  const Eigen::VectorXd& vector() const { return change_; }

 private:
  const UnknownLayout& layout_;
  Eigen::VectorXd change_;
};

}  // namespace heba
