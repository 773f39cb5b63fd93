// Tests of ChArUco targets: their frame, rendered images and images recorded by others.
#include <cmath>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "targets/images/image.h"
#include "tests/support/data_sets.h"
#include "tests/support/input_error.h"
#include "tests/support/recorded_boards.h"
#include "tests/support/rendered_target.h"

namespace heba {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

std::unique_ptr<Target> MakeBoard(int rows, int columns, const std::string& more) {
  return MakeTarget("{type: charuco, rows: " + std::to_string(rows) + ", columns: " + std::to_string(columns) +
                    ", square: 40 mm, " + more + "}");
}

class CharucoTest : public testing::TestWithParam<std::string> {};

// Both layouts are tested, with markers that leave room for a saddle point and with markers that do not.
TEST_P(CharucoTest, FindsRenderedTargetsAccurately) {
  const std::unique_ptr<Target> target = MakeBoard(6, 8, GetParam());
  const int num_views = 3;
  const DetectionErrors errors = DetectRendered(*target, num_views, 0.9, /*seed=*/31);
  EXPECT_EQ(errors.num_found, num_views * target->points().size());
  EXPECT_EQ(errors.num_unknown_ids, 0U);
  // Noise of 2 grey levels causes about 0.01 px; the rest is lens distortion between neighbouring corners.
  EXPECT_LT(errors.BiasPx(), 0.02);
  EXPECT_LT(errors.RmsPx(), 0.05);
}

INSTANTIATE_TEST_SUITE_P(All, CharucoTest,
                         testing::Values("marker: 20 mm, dictionary: DICT_6X6_250",
                                         "marker: 35 mm, dictionary: DICT_4X4_50",
                                         "marker: 30 mm, dictionary: DICT_5X5_1000, legacy_pattern: true",
                                         "marker: 30 mm, dictionary: DICT_APRILTAG_36h11, first_marker: 40",
                                         "marker: 36 mm, dictionary: DICT_ARUCO_ORIGINAL, legacy_pattern: true"));

// Corners are compared with what is drawn in an image from which noise that hides them was removed.
TEST(Charuco, FindsTargetsInStrongNoise) {
  const std::unique_ptr<Target> target = MakeBoard(6, 8, "marker: 30 mm, dictionary: DICT_4X4_50");
  const int num_views = 3;
  const DetectionErrors errors = DetectRendered(*target, num_views, 0.9, /*seed=*/31, /*noise_grey=*/40);
  EXPECT_GE(errors.num_found, 0.95 * num_views * static_cast<double>(target->points().size()));
  EXPECT_LT(errors.RmsPx(), 0.3);
}

TEST(Charuco, LeavesTheImageAsItIs) {
  const std::unique_ptr<Target> target = MakeBoard(6, 8, "marker: 30 mm, dictionary: DICT_4X4_50");
  cv::Mat image(480, 640, CV_8UC1);
  cv::randu(image, 0, 255);
  const cv::Mat before = image.clone();
  target->Detect(image);
  EXPECT_EQ(cv::norm(image, before, cv::NORM_L1), 0);
}

// The frame is that of OpenCV since 4.7: the origin is at the top left, and the first inner corner is one square
// inside.
TEST(Charuco, CornersCountFromTheTopLeft) {
  const std::unique_ptr<Target> target = MakeBoard(4, 5, "marker: 30 mm, dictionary: DICT_4X4_50");
  ASSERT_EQ(target->points().size(), 12U);
  EXPECT_EQ(target->points()[0].in_target, Eigen::Vector3d(0.04, 0.04, 0));
  EXPECT_EQ(target->points()[1].in_target, Eigen::Vector3d(0.08, 0.04, 0));
  EXPECT_EQ(target->points()[4].in_target, Eigen::Vector3d(0.04, 0.08, 0));
}

TEST(Charuco, FindsNothingWithoutTarget) {
  const std::unique_ptr<Target> target = MakeBoard(6, 8, "marker: 30 mm, dictionary: DICT_5X5_250");
  const Detection detection = target->Detect(cv::Mat(480, 640, CV_8UC1, cv::Scalar(128)));
  EXPECT_THAT(detection.ids, IsEmpty());
  EXPECT_THAT(detection.reason, HasSubstr("no marker"));
}

TEST(Charuco, RejectsInvalidSettings) {
  EXPECT_THAT(InputErrorOf([] { MakeBoard(20, 20, "marker: 30 mm, dictionary: DICT_4X4_50"); }),
              HasSubstr("DICT_4X4_50 has 50 markers"));
  EXPECT_THAT(InputErrorOf([] { MakeBoard(5, 5, "marker: 40 mm, dictionary: DICT_4X4_50"); }),
              HasSubstr("smaller than the square"));
}

// The number of corners and the RMS, which reveals wrong and inaccurate corners, are bounded with a margin; that of
// the RMS is a fifth of the measured value.
TEST(Charuco, FindsRecordedTargetsWithMarginAroundMarkers) {
  const std::filesystem::path folder = DataDir() / "ic_charuco_eye_to_hand" / "images";
  HEBA_SKIP_WITHOUT(folder);
  const std::unique_ptr<Target> target = MakeTarget(
      "{type: charuco, rows: 7, columns: 5, square: 36.195 mm, marker: 18.256 mm, dictionary: DICT_6X6_250}");
  const RecordedBoards found = DetectRecorded(*target, folder);
  EXPECT_GE(found.num_points, 360U);  // 384 corners in total.
  EXPECT_LT(found.rms_px, 0.6);       // The images are interlaced.
}

TEST(Charuco, FindsRecordedTargetsWithoutMarginAroundMarkers) {
  const std::filesystem::path folder = DataDir() / "ardootala_ur_charuco" / "images";
  HEBA_SKIP_WITHOUT(folder);
  // The README of the set states legacy_pattern, but the images show a black square in the first corner of the
  // target.
  const std::unique_ptr<Target> target =
      MakeTarget("{type: charuco, rows: 6, columns: 9, square: 40 mm, marker: 35 mm, dictionary: DICT_4X4_250}");
  const RecordedBoards found = DetectRecorded(*target, folder);
  EXPECT_GE(found.num_points, 270U);
  EXPECT_LT(found.rms_px, 0.16);
}

// If the wrong layout is assumed, the markers are consistent but shifted by one square. Positions outside the target
// are not accepted as corners.
TEST(Charuco, WrongLayoutOmitsCornersOutsideTheTarget) {
  const std::string markers = "marker: 35 mm, dictionary: DICT_4X4_50";
  const std::unique_ptr<Target> printed = MakeBoard(6, 9, markers);
  const std::unique_ptr<Target> assumed = MakeBoard(6, 9, markers + ", legacy_pattern: true");
  Rng rng(32);
  const Drawing& drawing = printed->Draw();
  const Detection detection =
      assumed->Detect(RenderView(drawing, ImageCamera(), RandomView(drawing, 0.9, 0.5, 0.4, rng)));
  EXPECT_EQ(detection.ids.size(), assumed->points().size() - 5);
  EXPECT_THAT(detection.reason, HasSubstr("5 of 40 corners not seen"));
}

// A hand hides some corners; the visible ones are found.
TEST(Charuco, FindsCornersThatAHandLeavesVisible) {
  const std::filesystem::path folder = DataDir() / "detect_misc_targets" / "images";
  HEBA_SKIP_WITHOUT(folder);
  const std::unique_ptr<Target> target = MakeTarget(
      "{type: charuco, rows: 7, columns: 5, square: 36.195 mm, marker: 18.256 mm, dictionary: DICT_6X6_250}");
  const Detection whole = target->Detect(ReadGreyImage(folder / "ic_charuco_unobscured.jpg"));
  EXPECT_EQ(whole.ids.size(), 24U);
  EXPECT_EQ(whole.reason, "");
  const Detection part = target->Detect(ReadGreyImage(folder / "ic_charuco_obscured.jpg"));
  for (const int visible : {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 17, 18, 19}) {
    EXPECT_THAT(part.ids, testing::Contains(visible));
  }
  // No corner is reported on the hand.
  for (const int hidden : {16, 20, 22}) EXPECT_THAT(part.ids, testing::Not(testing::Contains(hidden)));
  EXPECT_THAT(part.reason, HasSubstr("not seen"));
  EXPECT_THAT(target->Detect(ReadGreyImage(folder / "ic_charuco_one_corner.jpg")).ids, testing::ElementsAre(20));
}

// The image has 640 x 480 px; a homography fits up to the lens distortion.
TEST(Charuco, FindsARecordedSmallTarget) {
  const std::filesystem::path image =
      DataDir() / "detect_misc_targets" / "images" / "moveit_test_charuco_board_detection.jpg";
  HEBA_SKIP_WITHOUT(image);
  const std::unique_ptr<Target> target =
      MakeTarget("{type: charuco, rows: 7, columns: 5, square: 20 mm, marker: 13 mm, dictionary: DICT_5X5_250}");
  const Detection detection = target->Detect(ReadGreyImage(image));
  ASSERT_EQ(detection.ids.size(), 24U) << detection.reason;
  std::vector<cv::Point2d> board;
  std::vector<cv::Point2d> found;
  for (size_t i = 0; i < detection.ids.size(); ++i) {
    const Eigen::Vector3d& place_m = target->points()[static_cast<size_t>(detection.ids[i])].in_target;
    board.emplace_back(place_m.x(), place_m.y());
    found.emplace_back(detection.pixels[i].x(), detection.pixels[i].y());
  }
  std::vector<cv::Point2d> fitted;
  cv::perspectiveTransform(board, fitted, cv::findHomography(board, found));
  EXPECT_LT(cv::norm(fitted, found, cv::NORM_L2) / std::sqrt(24.0), 0.3);  // px
  // The markers are 13 mm wide. If the size is wrong, the message says that they do not look as drawn.
  const std::unique_ptr<Target> wrong =
      MakeTarget("{type: charuco, rows: 7, columns: 5, square: 20 mm, marker: 15 mm, dictionary: DICT_5X5_250}");
  EXPECT_THAT(wrong->Detect(ReadGreyImage(image)).reason, HasSubstr("do not look as drawn"));
}

// The images show other targets and single markers, of other families and dictionaries.
TEST(Charuco, FindsNothingOnOtherTargets) {
  const std::filesystem::path folder = DataDir() / "detect_misc_targets" / "images";
  HEBA_SKIP_WITHOUT(folder);
  const std::unique_ptr<Target> target =
      MakeTarget("{type: charuco, rows: 6, columns: 8, square: 40 mm, marker: 30 mm, dictionary: DICT_APRILTAG_36h11}");
  for (const char* name : {"ic_aruco.jpg", "ic_modified_circle_grid_10x10_0.025.png", "ic_charuco_unobscured.jpg",
                           "moveit_test_aruco_marker_detection.png", "moveit_test_charuco_board_detection.jpg"}) {
    EXPECT_THAT(target->Detect(ReadGreyImage(folder / name)).ids, IsEmpty()) << name;
  }
}

}  // namespace
}  // namespace heba
