// Tests of the dictionaries of ArUco markers and of the search for them, in pictures whose markers are known.
#include "targets/tags/aruco_markers.h"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "heba/base/registry.h"
#include "targets/tags/aruco_dictionary.h"

namespace heba {
namespace {

using testing::IsEmpty;

ArucoDictionary DictionaryOf(const std::string& name) { return ArucoDictionary(*FindEntry(kArucoDictionaries, name)); }

// Returns the picture of a marker, one pixel a cell, border included.
cv::Mat CellsOf(const ArucoDictionary& dictionary, int index) {
  const int num_cells = dictionary.size() + 2;
  cv::Mat cells(num_cells, num_cells, CV_8UC1);
  for (int row = 0; row < num_cells; ++row) {
    for (int column = 0; column < num_cells; ++column) {
      cells.at<uchar>(row, column) = dictionary.IsBlack(index, row, column) ? 20 : 230;
    }
  }
  return cells;
}

uint64_t CodeOf(const cv::Mat& cells) {
  uint64_t code = 0;
  for (int row = 1; row + 1 < cells.rows; ++row) {
    for (int column = 1; column + 1 < cells.cols; ++column) {
      code = code << 1 | (cells.at<uchar>(row, column) > 127 ? 1 : 0);
    }
  }
  return code;
}

cv::Mat Magnified(const cv::Mat& cells, int cell_px) {
  cv::Mat picture;
  cv::resize(cells, picture, {}, cell_px, cell_px, cv::INTER_NEAREST);
  return picture;
}

class ArucoDictionaryTest : public testing::TestWithParam<ArucoDictionaryName> {};

TEST_P(ArucoDictionaryTest, EveryMarkerIsIdentifiedInEveryRotation) {
  const ArucoDictionary dictionary(GetParam());
  ASSERT_EQ(dictionary.num_markers(), GetParam().num_markers);
  ASSERT_EQ(dictionary.size(), GetParam().size);
  for (int index = 0; index < dictionary.num_markers(); ++index) {
    cv::Mat cells = CellsOf(dictionary, index);
    for (int turns = 0; turns < 4; ++turns) {
      const std::optional<IdentifiedMarker> marker = dictionary.Identify(CodeOf(cells), 0);
      ASSERT_TRUE(marker) << "marker " << index;
      EXPECT_EQ(marker->index, index);
      // The last marker of DICT_ARUCO_ORIGINAL looks the same upside down.
      const bool is_symmetric = dictionary.size() == 5 && index == 1023;
      EXPECT_EQ(marker->turns, is_symmetric ? turns % 2 : turns) << "marker " << index;
      cv::rotate(cells.clone(), cells, cv::ROTATE_90_COUNTERCLOCKWISE);
    }
  }
}

TEST_P(ArucoDictionaryTest, CorrectableErrorsAreCorrected) {
  const ArucoDictionary dictionary(GetParam());
  const int num_errors = dictionary.num_correctable_bits();
  const int num_bits = dictionary.size() * dictionary.size();
  for (int index = 0; index < dictionary.num_markers(); index += 7) {
    uint64_t code = CodeOf(CellsOf(dictionary, index));
    for (int error = 0; error < num_errors; ++error) code ^= uint64_t{1} << ((index + 5 * error) % num_bits);
    const std::optional<IdentifiedMarker> marker = dictionary.Identify(code, num_errors);
    ASSERT_TRUE(marker) << "marker " << index;
    EXPECT_EQ(marker->index, index);
    EXPECT_EQ(marker->turns, 0);
    EXPECT_TRUE(num_errors == 0 || !dictionary.Identify(code, num_errors - 1)) << "marker " << index;
  }
}

// What is black or white all over is no marker.
TEST_P(ArucoDictionaryTest, OneColourIsNoMarker) {
  const ArucoDictionary dictionary(GetParam());
  const uint64_t all_white = (uint64_t{1} << (dictionary.size() * dictionary.size())) - 1;
  EXPECT_FALSE(dictionary.Identify(0, dictionary.num_correctable_bits()));
  EXPECT_FALSE(dictionary.Identify(all_white, 0));
}

INSTANTIATE_TEST_SUITE_P(All, ArucoDictionaryTest, testing::ValuesIn(kArucoDictionaries),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(ArucoDictionary, AppendedMarkersFollow) {
  ArucoDictionary joined = DictionaryOf("DICT_5X5_50");
  const ArucoDictionary original = DictionaryOf("DICT_ARUCO_ORIGINAL");
  joined.Append(original);
  EXPECT_EQ(joined.num_markers(), 50 + 1024);
  EXPECT_EQ(CodeOf(CellsOf(joined, 50 + 7)), CodeOf(CellsOf(original, 7)));
}

// The corners are the outermost dark pixels, clockwise from the marker's top left however it is turned.
TEST(ArucoMarkers, CornersRunClockwiseFromTheTopLeft) {
  constexpr int kCellPx = 12;
  const ArucoDictionary dictionary = DictionaryOf("DICT_5X5_100");
  cv::Mat picture(13 * kCellPx, 15 * kCellPx, CV_8UC1, cv::Scalar(230));
  Magnified(CellsOf(dictionary, 17), kCellPx).copyTo(picture(cv::Rect(5 * kCellPx, 3 * kCellPx, 84, 84)));
  const double left = 5 * kCellPx;
  const double top = 3 * kCellPx;
  const double right = left + 83;
  const double bottom = top + 83;
  const TagCorners upright_px = {Eigen::Vector2d(left, top), {right, top}, {right, bottom}, {left, bottom}};
  for (int turns = 0; turns < 4; ++turns) {
    const ArucoMarkers found = FindArucoMarkers(picture, dictionary);
    ASSERT_EQ(found.markers.size(), 1U);
    EXPECT_EQ(found.markers[0].index, 17);
    for (size_t k = 0; k < 4; ++k) {
      Eigen::Vector2d corner_px = upright_px[k];
      int width_px = 15 * kCellPx;
      int height_px = 13 * kCellPx;
      for (int turn = 0; turn < turns; ++turn) {
        corner_px = {height_px - 1 - corner_px.y(), corner_px.x()};
        std::swap(width_px, height_px);
      }
      EXPECT_EQ(found.markers[0].corners_px[k], corner_px) << "corner " << k << " after " << turns << " turns";
    }
    cv::rotate(picture.clone(), picture, cv::ROTATE_90_CLOCKWISE);
  }
}

// A part of an image has the markers of that part: what is around it does not matter.
TEST(ArucoMarkers, PartOfAnImageStandsAlone) {
  const ArucoDictionary dictionary = DictionaryOf("DICT_4X4_50");
  cv::Mat picture(200, 300, CV_8UC1, cv::Scalar(0));
  const cv::Rect part(60, 40, 120, 110);
  picture(part).setTo(230);
  Magnified(CellsOf(dictionary, 3), 10).copyTo(picture(cv::Rect(90, 60, 60, 60)));
  const ArucoMarkers of_part = FindArucoMarkers(picture(part), dictionary);
  const ArucoMarkers of_copy = FindArucoMarkers(picture(part).clone(), dictionary);
  ASSERT_EQ(of_part.markers.size(), 1U);
  ASSERT_EQ(of_copy.markers.size(), 1U);
  EXPECT_EQ(of_part.markers[0].corners_px, of_copy.markers[0].corners_px);
  EXPECT_EQ(of_part.rejected, of_copy.rejected);
}

TEST(ArucoMarkers, MarkersOfOtherDictionariesAreRejectedOutlines) {
  const ArucoDictionary drawn = DictionaryOf("DICT_6X6_250");
  const ArucoDictionary other = DictionaryOf("DICT_4X4_50");
  cv::Mat picture(160, 160, CV_8UC1, cv::Scalar(230));
  Magnified(CellsOf(drawn, 100), 12).copyTo(picture(cv::Rect(32, 32, 96, 96)));
  const ArucoMarkers found = FindArucoMarkers(picture, other);
  EXPECT_THAT(found.markers, IsEmpty());
  ASSERT_FALSE(found.rejected.empty());
  EXPECT_TRUE(std::any_of(found.rejected.begin(), found.rejected.end(), [&](const TagCorners& outline) {
    const std::optional<SeenTag> marker = ReadArucoMarker(picture, outline, drawn);
    return marker && marker->index == 100;
  }));
}

TEST(ArucoMarkers, NothingIsFoundWhereNothingIs) {
  const ArucoDictionary dictionary = DictionaryOf("DICT_4X4_50");
  EXPECT_THAT(FindArucoMarkers(cv::Mat(), dictionary).markers, IsEmpty());
  EXPECT_THAT(FindArucoMarkers(cv::Mat(1, 1, CV_8UC1, cv::Scalar(9)), dictionary).markers, IsEmpty());
  const ArucoMarkers of_grey = FindArucoMarkers(cv::Mat(120, 90, CV_8UC1, cv::Scalar(128)), dictionary);
  EXPECT_THAT(of_grey.markers, IsEmpty());
  EXPECT_THAT(of_grey.rejected, IsEmpty());
}

}  // namespace
}  // namespace heba
