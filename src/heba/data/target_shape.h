// How a printed target differs from its design: stretched by the printer, bent by its backing.
#pragma once

#include <array>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "heba/camera/camera_model.h"

namespace heba {

struct Observations;
struct View;

// A point designed at (x, y, z) of the target's frame is at
//   (scale_x x, scale_y y, z + bend_x (1 - a^2) + bend_y (1 - b^2))
// with a and b its place between the target's edges along x and y, -1 to 1: two parabolas, of which the bends are the
// heights in the middle, as in mrcal's model of a warped board (Kogan, mrcal, "calibration object deformation").
struct TargetShape {
  static constexpr int kNumParams = 4;
  std::array<double, kNumParams> params = {1, 1, 0, 0};  // scale_x, scale_y, bend_x in m, bend_y in m
  // Of the rectangle that holds the designed points.
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

// As designed.
TargetShape DesignedShape(const Points3& points_in_target);

// Where a point designed at `point` is, m.
Eigen::Vector3d ApplyShape(const Eigen::Vector3d& point, const TargetShape& shape);
// Its derivatives by TargetShape::params.
Eigen::Matrix<double, 3, TargetShape::kNumParams> ShapedByParams(const Eigen::Vector3d& point,
                                                                 const TargetShape& shape);

// With every point where the shape puts it. Discs keep their radius: what a shape changes of it moves no centroid.
Observations ApplyShape(const Observations& observations, const TargetShape& shape);
std::vector<View> ApplyShape(const std::vector<View>& views, const TargetShape& shape);

}  // namespace heba
