#include "heba/data/target_shape.h"

namespace heba {
namespace {

// Returns 1 - a^2 and 1 - b^2, which are 1 in the middle of the target and 0 at its edges; 0 for a target without
// extent, which cannot bend.
Eigen::Array2d Arch(const Eigen::Vector2d& point, const TargetShape& shape) {
  Eigen::Array2d arch = Eigen::Array2d::Zero();
  for (Eigen::Index i = 0; i < 2; ++i) {
    if (!(shape.half_size_m[i] > 0)) continue;
    const double place = (point[i] - shape.middle_m[i]) / shape.half_size_m[i];
    arch[i] = 1 - place * place;
  }
  return arch;
}

}  // namespace

TargetShape DesignedShape(const Points3& points_in_target) {
  TargetShape shape;
  if (points_in_target.cols() == 0) return shape;
  const Eigen::Vector2d low = points_in_target.topRows<2>().rowwise().minCoeff();
  const Eigen::Vector2d high = points_in_target.topRows<2>().rowwise().maxCoeff();
  shape.middle_m = 0.5 * (low + high);
  shape.half_size_m = 0.5 * (high - low);
  return shape;
}

Eigen::Vector3d ApplyShape(const Eigen::Vector3d& point, const TargetShape& shape) {
  const Eigen::Array2d arch = Arch(point.head<2>(), shape);
  return {shape.params[0] * point.x(), shape.params[1] * point.y(),
          point.z() + shape.params[2] * arch[0] + shape.params[3] * arch[1]};
}

Eigen::Matrix<double, 3, TargetShape::kNumParams> ShapedByParams(const Eigen::Vector3d& point,
                                                                 const TargetShape& shape) {
  const Eigen::Array2d arch = Arch(point.head<2>(), shape);
  Eigen::Matrix<double, 3, TargetShape::kNumParams> by_params;
  by_params << point.x(), 0, 0, 0,  //
      0, point.y(), 0, 0,           //
      0, 0, arch[0], arch[1];
  return by_params;
}

Observations ApplyShape(const Observations& observations, const TargetShape& shape) {
  Observations shaped = observations;
  for (Eigen::Index i = 0; i < shaped.size(); ++i) {
    const Eigen::Vector3d designed = observations.points_in_target.col(i);
    shaped.points_in_target.col(i) = ApplyShape(designed, shape);
  }
  return shaped;
}

}  // namespace heba
