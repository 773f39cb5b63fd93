#include "heba/data/target_shape.h"

#include <algorithm>
#include <cmath>

namespace heba {
namespace {

constexpr int kNumScales = 2;
using Heights = Eigen::Matrix<double, 1, TargetShape::kNumParams - kNumScales>;

// Returns the derivatives of a point's height by the heights of the shape; 0 for a target without extent, which cannot
// bend.
Heights ByHeights(const Eigen::Vector2d& point, const TargetShape& shape) {
  Eigen::Array2d place = Eigen::Array2d::Zero();
  Eigen::Array2d arch = Eigen::Array2d::Zero();
  for (Eigen::Index i = 0; i < 2; ++i) {
    if (!(shape.half_size_m[i] > 0)) continue;
    place[i] = (point[i] - shape.middle_m[i]) / shape.half_size_m[i];
    arch[i] = 1 - place[i] * place[i];
  }
  return {arch[0],           arch[1], place[0] * place[1], place[0] * arch[0], place[1] * arch[0], place[0] * arch[1],
          place[1] * arch[1]};
}

bool IsFlat(const TargetShape& shape) {
  return std::all_of(shape.params.begin() + kNumScales, shape.params.end(), [](double height) { return height == 0; });
}

}  // namespace

double LargestHeightM(const TargetShape& shape) {
  double largest_m = 0;
  for (size_t i = kNumScales; i < shape.params.size(); ++i) {
    largest_m = std::max(largest_m, std::abs(shape.params[i]));
  }
  return largest_m;
}

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
  // Most targets are flat, which costs nothing.
  if (IsFlat(shape)) return {shape.params[0] * point.x(), shape.params[1] * point.y(), point.z()};
  const Eigen::Map<const Heights> heights(shape.params.data() + kNumScales);
  return {shape.params[0] * point.x(), shape.params[1] * point.y(),
          point.z() + heights.dot(ByHeights(point.head<2>(), shape))};
}

Eigen::Matrix<double, 3, TargetShape::kNumParams> ShapedByParams(const Eigen::Vector3d& point,
                                                                 const TargetShape& shape) {
  Eigen::Matrix<double, 3, TargetShape::kNumParams> by_params = decltype(by_params)::Zero();
  by_params(0, 0) = point.x();
  by_params(1, 1) = point.y();
  by_params.bottomRightCorner<1, Heights::SizeAtCompileTime>() = ByHeights(point.head<2>(), shape);
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
