// The deviation of a printed target from its design: stretched by the printer, bent by its backing.
#pragma once

#include <array>
#include <string_view>

#include <Eigen/Core>

#include "heba/camera/camera_model.h"
#include "heba/data/observations.h"

namespace heba {

// A point designed at (x, y, z) in the target's frame lies at
//   (scale_x x, scale_y y, z + bend_x (1 - a^2) + bend_y (1 - b^2))
// The numbers a and b, from -1 to 1, are its position between the target's edges along x and y. The bend is a sum of
// two parabolas with the given heights in the middle, as in mrcal's model of a warped board (Kogan, mrcal, "calibration
// object deformation").
struct TargetShape {
  static constexpr int kNumParams = 4;
  std::array<double, kNumParams> params = {1, 1, 0, 0};  // scale_x, scale_y, bend_x in m, bend_y in m
  // Centre and half size of the rectangle that contains the designed points.
  Eigen::Vector2d middle_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d half_size_m = Eigen::Vector2d::Zero();
};

// The groups that a refinement can free, and the parameters of each, in the order of TargetShape::params.
enum class TargetShapeGroup { kScale, kBend };
inline constexpr std::array<std::string_view, 2> kTargetShapeGroupNames = {"scale", "bend"};
inline constexpr std::array<std::string_view, TargetShape::kNumParams> kTargetShapeParamNames = {
    "scale_x", "scale_y", "bend_x_m", "bend_y_m"};
constexpr TargetShapeGroup ShapeGroupOf(int param) {
  return param < 2 ? TargetShapeGroup::kScale : TargetShapeGroup::kBend;
}

// Returns the shape of a target that is exactly as designed.
TargetShape DesignedShape(const Points3& points_in_target);

// Returns the actual position, in m, of a point designed at `point`.
Eigen::Vector3d ApplyShape(const Eigen::Vector3d& point, const TargetShape& shape);
// Returns the derivatives of the actual position by TargetShape::params.
Eigen::Matrix<double, 3, TargetShape::kNumParams> ShapedByParams(const Eigen::Vector3d& point,
                                                                 const TargetShape& shape);

// Returns the observations with every point moved to its actual position. Discs keep their radius, because the change
// of a disc's size does not move its centroid.
Observations ApplyShape(const Observations& observations, const TargetShape& shape);

}  // namespace heba
