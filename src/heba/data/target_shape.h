// The deviation of a printed target from its design: stretched by the printer, bent by its backing.
#pragma once

#include <array>
#include <string_view>

#include <Eigen/Core>

#include "heba/camera/camera_model.h"
#include "heba/data/observations.h"

namespace heba {

// A point designed at (x, y, z) in the target's frame lies at
//   (scale_x x, scale_y y, z + bend_x (1 - a^2) + bend_y (1 - b^2) + twist a b
//                            + (cubic_xxx a + cubic_xxy b) (1 - a^2) + (cubic_xyy a + cubic_yyy b) (1 - b^2))
// The numbers a and b, from -1 to 1, are its position between the target's edges along x and y. The bend is
// two parabolas with the given heights in the middle, as in mrcal's model of a warped board (Kogan, mrcal, "calibration
// object deformation"); the twist, a saddle with the given height at the corners, completes the quadratic surface, and
// the cubic part that of the third order. What is constant or linear in a and b is a motion of the target.
struct TargetShape {
  static constexpr int kNumParams = 9;
  // Their order is that of kTargetShapeParamNames: the scales, then heights in m.
  std::array<double, kNumParams> params = {1, 1, 0, 0, 0, 0, 0, 0, 0};
  // Centre and half size of the rectangle that contains the designed points.
  Eigen::Vector2d middle_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d half_size_m = Eigen::Vector2d::Zero();
};

// The groups that a refinement can free, and the parameters of each, in the order of TargetShape::params. kPoints are
// the positions of the points by themselves (heba/data/point_offsets.h), which have no parameter here.
enum class TargetShapeGroup { kScale, kBend, kTwist, kCubic, kPoints };
inline constexpr std::array<std::string_view, 5> kTargetShapeGroupNames = {"scale", "bend", "twist", "cubic", "points"};
inline constexpr std::array<std::string_view, TargetShape::kNumParams> kTargetShapeParamNames = {
    "scale_x",     "scale_y",     "bend_x_m",    "bend_y_m",   "twist_m",
    "cubic_xxx_m", "cubic_xxy_m", "cubic_xyy_m", "cubic_yyy_m"};
constexpr TargetShapeGroup ShapeGroupOf(int param) {
  return param < 2   ? TargetShapeGroup::kScale
         : param < 4 ? TargetShapeGroup::kBend
         : param < 5 ? TargetShapeGroup::kTwist
                     : TargetShapeGroup::kCubic;
}
constexpr int NumParamsOf(TargetShapeGroup group) {
  int num = 0;
  for (int param = 0; param < TargetShape::kNumParams; ++param) num += ShapeGroupOf(param) == group ? 1 : 0;
  return num;
}
// Returns the largest height, in m, among the parameters of the shape that are heights.
double LargestHeightM(const TargetShape& shape);

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
