#include "heba/recognition.h"

#include <map>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/rendered_target.h"

namespace heba {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::MatchesRegex;

std::vector<cv::Mat> ViewsOf(const Target& target, int num_views, double share, uint64_t seed) {
  std::vector<cv::Mat> views;
  for (int view = 0; view < num_views; ++view) {
    Rng rng(seed, static_cast<uint64_t>(view));
    RenderOptions options;
    options.noise_sigma_grey = 2;
    options.seed = seed + static_cast<uint64_t>(view);
    views.push_back(RenderView(target.Draw(), ImageCamera(), RandomView(target.Draw(), share, 0.6, 0.5, rng), options));
  }
  return views;
}

// A target with the keys that must be recognised.
struct Shown {
  const char* name;
  const char* keys;      // The keys of the rendered target.
  const char* expected;  // The keys that are recognised, with its size; ratios are known to some hundredths.
  double size_m;
};

class RecognitionTest : public testing::TestWithParam<Shown> {};

TEST_P(RecognitionTest, NamesTheTarget) {
  const std::unique_ptr<Target> target = MakeTarget(GetParam().keys);
  const std::vector<cv::Mat> views = ViewsOf(*target, 3, 0.85, 7);
  const std::vector<RecognisedTarget> found = RecogniseTargets(views);
  ASSERT_FALSE(found.empty());
  EXPECT_THAT(RecognisedTargetText(found.front(), GetParam().size_m), MatchesRegex(GetParam().expected));
  EXPECT_GE(found.front().num_images, 2);
}

INSTANTIATE_TEST_SUITE_P(
    , RecognitionTest,
    testing::Values(
        Shown{"Chessboard", "{type: chessboard, rows: 6, columns: 9, square: 20 mm}",
              "\\{type: chessboard, rows: 6, columns: 9, square: 20 mm\\}", 0.02},
        Shown{"Charuco",
              "{type: charuco, rows: 5, columns: 8, square: 40 mm, marker: 30 mm, dictionary: DICT_5X5_1000}",
              "\\{type: charuco, rows: 5, columns: 8, square: 40 mm, marker: (29\\.6|30|30\\.4) mm, dictionary: "
              "DICT_5X5_50\\}",
              0.04},
        Shown{"LegacyCharuco",
              "{type: charuco, rows: 6, columns: 8, square: 40 mm, marker: 30 mm, dictionary: DICT_4X4_50, "
              "legacy_pattern: true}",
              "\\{type: charuco, rows: 6, columns: 8, square: 40 mm, marker: (29\\.6|30|30\\.4) mm, dictionary: "
              "DICT_4X4_50, legacy_pattern: true\\}",
              0.04},
        // Dictionaries whose markers have as many cells are read together.
        Shown{"CharucoOfOriginalMarkers",
              "{type: charuco, rows: 5, columns: 8, square: 40 mm, marker: 30 mm, dictionary: DICT_ARUCO_ORIGINAL}",
              "\\{type: charuco, rows: 5, columns: 8, square: 40 mm, marker: (29\\.6|30|30\\.4) mm, dictionary: "
              "DICT_ARUCO_ORIGINAL\\}",
              0.04},
        Shown{"CharucoOfAprilTags",
              "{type: charuco, rows: 5, columns: 8, square: 40 mm, marker: 30 mm, dictionary: DICT_APRILTAG_36h11}",
              "\\{type: charuco, rows: 5, columns: 8, square: 40 mm, marker: (29\\.6|30|30\\.4) mm, dictionary: "
              "DICT_APRILTAG_36h11\\}",
              0.04},
        Shown{"CharucoOfLargeMarkers",
              "{type: charuco, rows: 5, columns: 8, square: 40 mm, marker: 30 mm, dictionary: DICT_7X7_250, "
              "first_marker: 60}",
              "\\{type: charuco, rows: 5, columns: 8, square: 40 mm, marker: (29\\.6|30|30\\.4) mm, dictionary: "
              "DICT_7X7_100, first_marker: 60\\}",
              0.04},
        Shown{"AprilTagsWithReversedBorder",
              "{type: apriltag_grid, family: tagStandard41h12, rows: 3, columns: 4, tag_size: 40 mm, tag_spacing: 1}",
              "\\{type: apriltag_grid, family: tagStandard41h12, rows: 3, columns: 4, tag_size: 40 mm, tag_spacing: "
              "(0\\.9[0-9]|1\\.0[0-9])\\}",
              0.04},
        Shown{"AprilTagsWithWideBorder",
              "{type: apriltag_grid, family: tag36h11, rows: 4, columns: 5, tag_size: 40 mm, tag_spacing: 0.3, "
              "border_bits: 2}",
              "\\{type: apriltag_grid, family: tag36h11, rows: 4, columns: 5, tag_size: 40 mm, tag_spacing: "
              "0.(29|30|31), border_bits: 2\\}",
              0.04},
        Shown{"AprilTags",
              "{type: apriltag_grid, family: tag36h11, rows: 4, columns: 5, tag_size: 40 mm, tag_spacing: 0.3}",
              "\\{type: apriltag_grid, family: tag36h11, rows: 4, columns: 5, tag_size: 40 mm, tag_spacing: "
              "0.(29|30|31)\\}",
              0.04},
        Shown{"CircleGrid", "{type: circle_grid, rows: 5, columns: 8, spacing: 20 mm}",
              "\\{type: circle_grid, rows: 5, columns: 8, spacing: 20 mm, dot_diameter: (9|10)[.0-9]* mm\\}", 0.02},
        Shown{"CodedBoard", "{type: coded_board, rows: 6, columns: 8, spacing: 25 mm}",
              "\\{type: coded_board, rows: 6, columns: 8, spacing: 25 mm, dot_diameter: (6|6[.][0-9]*) mm, bits: 12\\}",
              0.025},
        Shown{"CodedBoardWithLargeDots", "{type: coded_board, rows: 5, columns: 6, spacing: 30 mm, dot_diameter: 9 mm}",
              "\\{type: coded_board, rows: 5, columns: 6, spacing: 30 mm, dot_diameter: (8|9)[.0-9]* mm, bits: 12\\}",
              0.03}),
    [](const auto& shown) { return shown.param.name; });

// The rotated lattice of an asymmetric grid is told from a symmetric one; the rest of its keys follow.
TEST(RecogniseTargetsTest, TellsAsymmetricGrids) {
  const std::unique_ptr<Target> target =
      MakeTarget("{type: circle_grid, rows: 11, columns: 4, spacing: 15 mm, asymmetric: true}");
  const std::vector<RecognisedTarget> found = RecogniseTargets(ViewsOf(*target, 2, 0.85, 3));
  ASSERT_FALSE(found.empty());
  EXPECT_THAT(RecognisedTargetText(found.front()), HasSubstr("rows: 11, columns: 4, spacing: SIZE"));
  EXPECT_THAT(RecognisedTargetText(found.front()), HasSubstr("asymmetric: true"));
}

// Clutter, noise and edges are no target.
TEST(RecogniseTargetsTest, FindsNothingWithoutTarget) {
  for (uint64_t seed = 0; seed < 4; ++seed) {
    Rng rng(seed, 1);
    cv::Mat image(480, 640, CV_8UC1);
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        const double wave = 60 * std::sin(0.05 * (x + 3.0 * static_cast<double>(seed) * y / 10)) + 128;
        image.at<uchar>(y, x) = static_cast<uchar>(std::clamp(wave + 6 * rng.Normal(), 0.0, 255.0));
      }
    }
    for (int i = 0; i < 30; ++i) {
      const cv::Rect box{rng.Index(600), rng.Index(440), 5 + rng.Index(30), 5 + rng.Index(30)};
      image(box & cv::Rect(0, 0, image.cols, image.rows)).setTo(rng.Index(256));
    }
    EXPECT_THAT(RecogniseTargets({image}), IsEmpty());
  }
}

}  // namespace
}  // namespace heba
