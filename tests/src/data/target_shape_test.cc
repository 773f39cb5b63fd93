#include "heba/data/target_shape.h"

#include <gtest/gtest.h>

#include "heba/data/pair_problem.h"

namespace heba {
namespace {

TargetShape MakeShape() {
  Points3 points(3, 3);
  points << 0.0, 0.2, 0.1,  //
      0.0, 0.0, 0.1,        //
      0.0, 0.0, 0.0;
  TargetShape shape = DesignedShape(points);
  shape.params = {1.002, 0.999, 5e-4, -2e-4};
  return shape;
}

TEST(TargetShapeTest, DesignedShapeMovesNoPoint) {
  TargetShape shape = MakeShape();
  shape.params = TargetShape().params;
  const Eigen::Vector3d point(0.03, 0.04, 0.001);
  EXPECT_EQ(ApplyShape(point, shape), point);
}

TEST(TargetShapeTest, BendsAreHeightsAtTheCentre) {
  const TargetShape shape = MakeShape();
  // The two bends add up at the centre of the target; in the middle of an edge only one of them acts.
  EXPECT_TRUE(ApplyShape({0.1, 0.05, 0}, shape).isApprox(Eigen::Vector3d(0.1002, 0.04995, 3e-4), 1e-12));
  EXPECT_TRUE(ApplyShape({0.2, 0.05, 0}, shape).isApprox(Eigen::Vector3d(0.2004, 0.04995, -2e-4), 1e-12));
  EXPECT_TRUE(ApplyShape({0.1, 0.1, 0}, shape).isApprox(Eigen::Vector3d(0.1002, 0.0999, 5e-4), 1e-12));
}

TEST(TargetShapeTest, DerivativesMatchFiniteDifferences) {
  const TargetShape shape = MakeShape();
  const Eigen::Vector3d point(0.03, 0.08, 0);
  const Eigen::Matrix<double, 3, TargetShape::kNumParams> by_params = ShapedByParams(point, shape);
  constexpr double kStep = 1e-6;
  for (size_t i = 0; i < shape.params.size(); ++i) {
    TargetShape more = shape;
    more.params[i] += kStep;
    const Eigen::Vector3d difference = (ApplyShape(point, more) - ApplyShape(point, shape)) / kStep;
    EXPECT_LT((difference - by_params.col(static_cast<Eigen::Index>(i))).norm(), 1e-9) << kTargetShapeParamNames[i];
  }
}

TEST(TargetShapeTest, DoesNotBendALineAcrossItsDirection) {
  Points3 points(3, 2);
  points << 0.0, 0.2, 0.0, 0.0, 0.0, 0.0;
  TargetShape shape = DesignedShape(points);
  shape.params = {1, 1, 1e-3, 1e-3};
  EXPECT_TRUE(ApplyShape({0.1, 0, 0}, shape).isApprox(Eigen::Vector3d(0.1, 0, 1e-3), 1e-12));
}

}  // namespace
}  // namespace heba
