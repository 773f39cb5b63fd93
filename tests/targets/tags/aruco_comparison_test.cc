// The dictionaries and the search for markers are those of OpenCV's aruco module (4.6): equal bits, equal
// identification, and equal markers and outlines in rendered and in recorded images.
#include <algorithm>
#include <filesystem>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/aruco.hpp>
#include <opencv2/imgproc.hpp>

#include "heba/base/rng.h"
#include "targets/images/image.h"
#include "targets/tags/aruco_dictionary.h"
#include "targets/tags/aruco_markers.h"
#include "tests/support/data_sets.h"
#include "tests/support/rendered_target.h"

namespace heba {
namespace {

// OpenCV's dictionaries in the order of kArucoDictionaries.
constexpr int kInOpenCv[] = {
    cv::aruco::DICT_4X4_50,        cv::aruco::DICT_4X4_100,        cv::aruco::DICT_4X4_250,
    cv::aruco::DICT_4X4_1000,      cv::aruco::DICT_5X5_50,         cv::aruco::DICT_5X5_100,
    cv::aruco::DICT_5X5_250,       cv::aruco::DICT_5X5_1000,       cv::aruco::DICT_6X6_50,
    cv::aruco::DICT_6X6_100,       cv::aruco::DICT_6X6_250,        cv::aruco::DICT_6X6_1000,
    cv::aruco::DICT_7X7_50,        cv::aruco::DICT_7X7_100,        cv::aruco::DICT_7X7_250,
    cv::aruco::DICT_7X7_1000,      cv::aruco::DICT_ARUCO_ORIGINAL, cv::aruco::DICT_APRILTAG_16h5,
    cv::aruco::DICT_APRILTAG_25h9, cv::aruco::DICT_APRILTAG_36h10, cv::aruco::DICT_APRILTAG_36h11};
static_assert(std::size(kInOpenCv) == kArucoDictionaries.size());

cv::Ptr<cv::aruco::Dictionary> InOpenCv(size_t entry) { return cv::aruco::getPredefinedDictionary(kInOpenCv[entry]); }

size_t EntryOf(const std::string& name) {
  return static_cast<size_t>(std::find_if(kArucoDictionaries.begin(), kArucoDictionaries.end(),
                                          [&](const ArucoDictionaryName& entry) { return entry.name == name; }) -
                             kArucoDictionaries.begin());
}

class ArucoDictionaryComparison : public testing::TestWithParam<size_t> {};

TEST_P(ArucoDictionaryComparison, PicturesAreEqual) {
  const cv::Ptr<cv::aruco::Dictionary> expected = InOpenCv(GetParam());
  const ArucoDictionary dictionary(kArucoDictionaries[GetParam()]);
  ASSERT_EQ(dictionary.size(), expected->markerSize);
  ASSERT_EQ(dictionary.num_markers(), expected->bytesList.rows);
  ASSERT_EQ(dictionary.num_correctable_bits(), expected->maxCorrectionBits);
  const int num_cells = dictionary.size() + 2;
  for (int index = 0; index < dictionary.num_markers(); ++index) {
    cv::Mat picture;
    cv::aruco::drawMarker(expected, index, num_cells, picture, 1);
    for (int row = 0; row < num_cells; ++row) {
      for (int column = 0; column < num_cells; ++column) {
        ASSERT_EQ(dictionary.IsBlack(index, row, column), picture.at<uchar>(row, column) == 0) << "marker " << index;
      }
    }
  }
}

// Codes at random, and those of markers with errors and turned, are identified as the same markers or as none.
TEST_P(ArucoDictionaryComparison, IdentificationIsEqual) {
  const cv::Ptr<cv::aruco::Dictionary> expected = InOpenCv(GetParam());
  const ArucoDictionary dictionary(kArucoDictionaries[GetParam()]);
  const int size = dictionary.size();
  Rng rng(71, GetParam());
  int num_identified = 0;
  constexpr int kNumCodes = 1500;
  for (int trial = 0; trial < kNumCodes; ++trial) {
    cv::Mat bits(size, size, CV_8UC1);
    const bool is_random = trial % 4 == 0;
    const int index = rng.Index(dictionary.num_markers());
    for (int row = 0; row < size; ++row) {
      for (int column = 0; column < size; ++column) {
        const bool is_white = is_random ? rng.Index(2) == 1 : !dictionary.IsBlack(index, row + 1, column + 1);
        bits.at<uchar>(row, column) = is_white ? 1 : 0;
      }
    }
    const int num_errors = is_random ? 0 : rng.Index(dictionary.num_correctable_bits() + 3);
    for (int error = 0; error < num_errors; ++error) {
      const int row = rng.Index(size);
      bits.at<uchar>(row, rng.Index(size)) ^= 1;
    }
    for (int turns = rng.Index(4); turns > 0; --turns) cv::rotate(bits.clone(), bits, cv::ROTATE_90_CLOCKWISE);
    uint64_t code = 0;
    for (int row = 0; row < size; ++row) {
      for (int column = 0; column < size; ++column) code = code << 1 | bits.at<uchar>(row, column);
    }
    int expected_index = -1;
    int expected_rotation = -1;
    const bool is_expected = expected->identify(bits, expected_index, expected_rotation, 1);
    const std::optional<IdentifiedMarker> marker = dictionary.Identify(code, dictionary.num_correctable_bits());
    ASSERT_EQ(marker.has_value(), is_expected) << "trial " << trial;
    if (!marker) continue;
    ++num_identified;
    EXPECT_EQ(marker->index, expected_index);
    EXPECT_EQ(marker->turns, expected_rotation);
  }
  EXPECT_GT(num_identified, kNumCodes / 5);
}

INSTANTIATE_TEST_SUITE_P(All, ArucoDictionaryComparison, testing::Range(size_t{0}, kArucoDictionaries.size()),
                         [](const auto& test) { return std::string(kArucoDictionaries[test.param].name); });

// The parameters that FindArucoMarkers has built in.
cv::Ptr<cv::aruco::DetectorParameters> Parameters() {
  const cv::Ptr<cv::aruco::DetectorParameters> parameters = cv::aruco::DetectorParameters::create();
  parameters->cornerRefinementMethod = cv::aruco::CORNER_REFINE_NONE;
  parameters->minMarkerPerimeterRate = 0.01;
  parameters->adaptiveThreshWinSizeMax = 53;
  parameters->adaptiveThreshWinSizeStep = 10;
  return parameters;
}

std::vector<cv::Point2f> PixelsOf(const TagCorners& corners) {
  std::vector<cv::Point2f> pixels;
  for (const Eigen::Vector2d& corner : corners) {
    pixels.emplace_back(static_cast<float>(corner.x()), static_cast<float>(corner.y()));
  }
  return pixels;
}

// Compares all markers and outlines in an image, in their order, and returns the number of markers.
size_t ExpectEqualMarkers(const cv::Mat& grey, size_t entry) {
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  std::vector<std::vector<cv::Point2f>> rejected;
  cv::aruco::detectMarkers(grey, InOpenCv(entry), corners, ids, Parameters(), rejected);
  const ArucoMarkers found = FindArucoMarkers(grey, ArucoDictionary(kArucoDictionaries[entry]));
  std::vector<int> found_ids;
  std::vector<std::vector<cv::Point2f>> found_corners;
  for (const SeenTag& marker : found.markers) {
    found_ids.push_back(marker.index);
    found_corners.push_back(PixelsOf(marker.corners_px));
  }
  std::vector<std::vector<cv::Point2f>> found_rejected;
  for (const TagCorners& outline : found.rejected) found_rejected.push_back(PixelsOf(outline));
  EXPECT_EQ(found_ids, ids);
  EXPECT_EQ(found_corners, corners);
  EXPECT_EQ(found_rejected, rejected);
  return ids.size();
}

// Boards are rendered with each dictionary in two of four ways: small, large and blurred, with much noise, in clutter.
TEST(ArucoComparisonNightly, RenderedImagesHaveEqualMarkers) {
  Rng rng(72);
  for (size_t entry = 0; entry < kArucoDictionaries.size(); ++entry) {
    SCOPED_TRACE(kArucoDictionaries[entry].name);
    const std::unique_ptr<Target> target = MakeTarget("{type: charuco, rows: 5, columns: 7, square: 40 mm, marker: " +
                                                      std::to_string(22 + 3 * static_cast<int>(entry % 6)) +
                                                      " mm, dictionary: " + kArucoDictionaries[entry].name + "}");
    size_t num_markers = 0;
    for (const size_t view : {entry % 4, (entry + 1) % 4}) {
      SCOPED_TRACE(view);
      RenderOptions options;
      options.seed = 100 * entry + view;
      options.blur_sigma_px = view == 1 ? 1.8 : 0.6;
      options.noise_sigma_grey = view == 2 ? 9 : 1;
      options.light_gradient = view == 2 ? 0 : 0.5;
      options.clutter = view == 3;
      const Drawing& drawing = target->Draw();
      const cv::Mat grey =
          RenderView(drawing, ImageCamera(), RandomView(drawing, view == 1 ? 0.9 : 0.5, 0.8, 3, rng), options);
      num_markers += ExpectEqualMarkers(grey, entry);
    }
    EXPECT_GT(num_markers, 10U);
  }
}

// A marker lies in a white cell of another one, of the same number or of the next one: both are found, in whichever
// order. Pale and blurred ones are found in large windows only, after the one around them.
TEST(ArucoComparison, MarkersWithinMarkersAreEqual) {
  const size_t entry = EntryOf("DICT_4X4_50");
  const cv::Ptr<cv::aruco::Dictionary> dictionary = InOpenCv(entry);
  for (int outer = 0; outer < 12; ++outer) {
    for (const int inner : {outer, outer + 1}) {
      for (const bool is_pale : {false, true}) {
        SCOPED_TRACE(std::to_string(inner) + (is_pale ? ", pale, in " : " in ") + std::to_string(outer));
        cv::Mat picture(520, 520, CV_8UC1, cv::Scalar(255));
        cv::Mat marker;
        cv::aruco::drawMarker(dictionary, outer, 480, marker, 1);
        marker.copyTo(picture(cv::Rect(20, 20, 480, 480)));
        int place = 7;
        while (picture.at<uchar>(60 + 80 * (place / 6), 60 + 80 * (place % 6)) == 0) ++place;
        cv::aruco::drawMarker(dictionary, inner, 42, marker, 1);
        if (is_pale) cv::addWeighted(marker, 0.15, 255, 0.85, 0, marker);
        cv::Mat cell = picture(cv::Rect(20 + 80 * (place % 6), 20 + 80 * (place / 6), 80, 80));
        marker.copyTo(cell(cv::Rect(15, 19, 42, 42)));
        if (is_pale) cv::GaussianBlur(cell, cell, {}, 1.5);
        EXPECT_EQ(ExpectEqualMarkers(picture, entry), 2U);
      }
    }
  }
}

struct RecordedFolder {
  const char* folder;
  const char* dictionary;
};

class ArucoRecordedComparison : public testing::TestWithParam<RecordedFolder> {};

TEST_P(ArucoRecordedComparison, ImagesHaveEqualMarkers) {
  const std::filesystem::path folder = DataDir() / GetParam().folder / "images";
  HEBA_SKIP_WITHOUT(folder);
  std::vector<std::filesystem::path> paths;
  for (const auto& file : std::filesystem::directory_iterator(folder)) {
    if (file.path().extension() == ".jpg" || file.path().extension() == ".png") paths.push_back(file.path());
  }
  std::sort(paths.begin(), paths.end());
  size_t num_markers = 0;
  for (const std::filesystem::path& path : paths) {
    SCOPED_TRACE(path);
    num_markers += ExpectEqualMarkers(ReadGreyImage(path), EntryOf(GetParam().dictionary));
  }
  EXPECT_GT(num_markers, 0U);
}

INSTANTIATE_TEST_SUITE_P(, ArucoRecordedComparison,
                         testing::Values(RecordedFolder{"ic_charuco_eye_to_hand", "DICT_6X6_250"},
                                         RecordedFolder{"ardootala_ur_charuco", "DICT_4X4_250"},
                                         RecordedFolder{"detect_misc_targets", "DICT_5X5_250"},
                                         RecordedFolder{"detect_apriltag_reference", "DICT_APRILTAG_36h11"}),
                         [](const auto& test) { return std::string(test.param.folder); });

}  // namespace
}  // namespace heba
