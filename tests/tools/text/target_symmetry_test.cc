#include "tools/text/target_symmetry.h"

#include <memory>
#include <string>

#include <gtest/gtest.h>

namespace heba {
namespace {

std::unique_ptr<Target> TargetOf(const std::string& yaml) { return ParseTarget(yaml); }

TEST(TargetSymmetryTest, ATargetWithOneOrientationHasNoText) {
  for (const char* yaml :
       {"{type: chessboard, rows: 5, columns: 8, square: 20 mm}",
        "{type: charuco, rows: 6, columns: 8, square: 20 mm, marker: 15 mm, dictionary: DICT_4X4_50}",
        "{type: circle_grid, rows: 4, columns: 5, spacing: 20 mm, marker_dot: true}"}) {
    const std::unique_ptr<Target> target = TargetOf(yaml);
    EXPECT_EQ(SymmetryText(*target), "") << yaml;
    EXPECT_EQ(SymmetryRemark(*target), "") << yaml;
    EXPECT_EQ(SymmetryCure(*target), "") << yaml;
  }
}

TEST(TargetSymmetryTest, ARectangularChessboardHasTwoPoses) {
  const std::unique_ptr<Target> target = TargetOf("{type: chessboard, rows: 6, columns: 8, square: 20 mm}");
  EXPECT_EQ(SymmetryText(*target), "the target looks the same after a rotation by 180 deg");
  EXPECT_EQ(
      SymmetryRemark(*target),
      "the target looks the same after a rotation by 180 deg, so 'heba locate' finds 2 possible poses in an image "
      "unless --near decides; the calibration itself is not affected");
  EXPECT_EQ(SymmetryCure(*target), "a chessboard with columns: 9, or a charuco, has one pose only");
}

TEST(TargetSymmetryTest, ASquareGridHasFourPoses) {
  const std::unique_ptr<Target> target = TargetOf("{type: circle_grid, rows: 5, columns: 5, spacing: 20 mm}");
  EXPECT_EQ(SymmetryText(*target), "the target looks the same after a rotation by 90 deg");
  EXPECT_EQ(SymmetryRemark(*target),
            "the target looks the same after a rotation by 90 deg, so 'heba locate' finds 4 possible poses in an image "
            "unless --near decides; the calibration itself is not affected");
  EXPECT_EQ(SymmetryCure(*target), "a circle_grid with marker_dot: true, or a charuco, has one pose only");
}

// The cure is a target without a symmetry, as it promises.
TEST(TargetSymmetryTest, TheTargetOfTheCureHasOneOrientation) {
  EXPECT_EQ(SymmetryText(*TargetOf("{type: chessboard, rows: 6, columns: 9, square: 20 mm}")), "");
  EXPECT_EQ(SymmetryText(*TargetOf("{type: circle_grid, rows: 5, columns: 5, spacing: 20 mm, marker_dot: true}")), "");
}

}  // namespace
}  // namespace heba
