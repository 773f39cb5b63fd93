#include "targets/images/light_areas.h"

#include <algorithm>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "heba/base/rng.h"

namespace heba {
namespace {

constexpr int kThreshold = 128;

// Returns an image with blots of all sizes, with holes, and with specks.
cv::Mat Blots(uint64_t seed, int width, int height) {
  Rng rng(seed, 0);
  cv::Mat grey(height, width, CV_8UC1, cv::Scalar(40));
  for (int i = 0; i < 60; ++i) {
    const cv::Point centre{static_cast<int>(rng.Uniform(0, width)), static_cast<int>(rng.Uniform(0, height))};
    const cv::Size axes{static_cast<int>(rng.Uniform(0, 8)), static_cast<int>(rng.Uniform(0, 8))};
    cv::ellipse(grey, centre, axes, rng.Uniform(0, 180), 0, 360, cv::Scalar(i % 3 == 2 ? 40 : 200), cv::FILLED);
  }
  return grey;
}

using Area = std::tuple<int, int, int, int, int>;  // Bounding box and number of pixels.

TEST(LightAreasTest, MatchTheConnectedComponents) {
  constexpr int kMinSide = 2;
  constexpr int kMaxSide = 40;
  // The widths fill words of 64 pixels exactly or in part.
  for (const int width : {64, 127, 128, 200}) {
    const cv::Mat grey = Blots(static_cast<uint64_t>(width), width, 400);
    cv::Mat labels;
    cv::Mat stats;
    cv::Mat centroids;
    const int num_labels = cv::connectedComponentsWithStats(grey > kThreshold, labels, stats, centroids, 8);
    std::set<Area> expected;
    for (int i = 1; i < num_labels; ++i) {
      const cv::Rect box(stats.at<int>(i, cv::CC_STAT_LEFT), stats.at<int>(i, cv::CC_STAT_TOP),
                         stats.at<int>(i, cv::CC_STAT_WIDTH), stats.at<int>(i, cv::CC_STAT_HEIGHT));
      const int side = std::max(box.width, box.height);
      const bool is_cut = box.x == 0 || box.y == 0 || box.br().x == grey.cols || box.br().y == grey.rows;
      if (is_cut || side < kMinSide || side > kMaxSide) continue;
      expected.insert({box.x, box.y, box.width, box.height, stats.at<int>(i, cv::CC_STAT_AREA)});
    }
    std::set<Area> found;
    for (const LightArea& area : FindLightAreas(grey, kThreshold, kMinSide, kMaxSide)) {
      found.insert({area.box.x, area.box.y, area.box.width, area.box.height, area.num_pixels});
    }
    EXPECT_GT(expected.size(), 3U);
    EXPECT_EQ(found, expected) << width;
  }
}

TEST(LightAreasTest, OutlinesMatchTheOuterContours) {
  const cv::Mat grey = Blots(9, 300, 200);
  std::vector<std::vector<cv::Point>> contours;
  cv::findContours(grey > kThreshold, contours, cv::RETR_LIST, cv::CHAIN_APPROX_NONE);
  const auto points_of = [](const std::vector<cv::Point>& outline) {
    std::set<std::pair<int, int>> points;
    for (const cv::Point& point : outline) points.insert({point.x, point.y});
    return points;
  };
  std::set<std::set<std::pair<int, int>>> expected;
  for (const std::vector<cv::Point>& contour : contours) expected.insert(points_of(contour));
  int num_areas = 0;
  for (const LightArea& area : FindLightAreas(grey, kThreshold, 2, 100)) {
    const std::optional<std::vector<cv::Point>> traced = TraceOutline(grey, kThreshold, area.first, 1000);
    ASSERT_TRUE(traced);
    const std::vector<cv::Point>& outline = *traced;
    EXPECT_EQ(expected.count(points_of(outline)), 1U) << area.box;
    ++num_areas;
    for (size_t i = 0; i < outline.size(); ++i) {
      const cv::Point step = outline[(i + 1) % outline.size()] - outline[i];
      EXPECT_LE(std::max(std::abs(step.x), std::abs(step.y)), 1);
    }
    EXPECT_FALSE(outline.size() > 1 && TraceOutline(grey, kThreshold, area.first, outline.size() - 1));
  }
  EXPECT_GT(num_areas, 8);
}

}  // namespace
}  // namespace heba
