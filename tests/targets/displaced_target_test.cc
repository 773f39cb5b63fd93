#include "heba/displaced_target.h"

#include <gtest/gtest.h>

#include "heba/detection.h"

namespace heba {
namespace {

TEST(DisplacedTargetTest, PointsAreDisplacedAndTheRestIsAsDesigned) {
  const std::shared_ptr<const Target> designed =
      ParseTarget("{type: chessboard, rows: 6, columns: 9, square: 20 mm, scale_sigma: 0.1 %}");
  const std::shared_ptr<const Target> displaced = Displaced(designed, {{3, {1e-3, 0, -2e-3}}, {999, {1, 1, 1}}});
  ASSERT_EQ(displaced->points().size(), designed->points().size());
  for (size_t i = 0; i < designed->points().size(); ++i) {
    const TargetPoint& before = designed->points()[i];
    const TargetPoint& after = displaced->points()[i];
    EXPECT_EQ(after.id, before.id);
    const Eigen::Vector3d expected = before.id == 3 ? Eigen::Vector3d(1e-3, 0, -2e-3) : Eigen::Vector3d::Zero();
    EXPECT_LT((after.in_target - before.in_target - expected).norm(), 1e-15);
  }
  EXPECT_EQ(displaced->type(), "chessboard");
  EXPECT_EQ(displaced->Codes(), designed->Codes());
  EXPECT_EQ(displaced->Symmetries().size(), designed->Symmetries().size());
  EXPECT_EQ(displaced->UnitLengths(), designed->UnitLengths());
  EXPECT_EQ(displaced->scale_sigma(), designed->scale_sigma());
  EXPECT_EQ(&displaced->Draw(), &designed->Draw());
}

TEST(DisplacedTargetTest, NoOffsetsGiveTheSameTarget) {
  const std::shared_ptr<const Target> designed = ParseTarget("{type: chessboard, rows: 6, columns: 9, square: 20 mm}");
  EXPECT_EQ(Displaced(designed, {}), designed);
}

}  // namespace
}  // namespace heba
