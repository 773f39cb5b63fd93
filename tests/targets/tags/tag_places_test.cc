#include "targets/tags/tag_places.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "heba/base/units.h"
#include "heba/target.h"
#include "targets/render/rendering.h"
#include "tests/support/rendered_target.h"

namespace heba {
namespace {

constexpr int kWidthPx = 1200;
constexpr int kHeightPx = 900;
const Camera kCamera{"pinhole", kWidthPx, kHeightPx, {1200, 1200, 599.5, 449.5}};

// Returns the pose of a sheet whose centre lies on the optical axis.
Rigid3d PoseOf(const Drawing& drawing, double distance_m, double tilt_rad) {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(tilt_rad, Eigen::Vector3d(0.6, 0.8, 0)) *
                                Eigen::AngleAxisd(kPi, Eigen::Vector3d::UnitX()));
  const Eigen::Vector2d middle_m = 0.5 * (drawing.min_m + drawing.max_m);
  return {turn, Eigen::Vector3d(0, 0, distance_m) - turn * Eigen::Vector3d(middle_m.x(), middle_m.y(), 0)};
}

cv::Mat Rendered(const Drawing& drawing, double distance_m, double tilt_rad, double noise_grey) {
  RenderOptions options;
  options.noise_sigma_grey = noise_grey;
  options.light_gradient = 0.3;
  return RenderView(drawing, kCamera, PoseOf(drawing, distance_m, tilt_rad), options);
}

double AreaShare(const std::vector<cv::Rect>& places, const cv::Mat& grey) {
  cv::Mat mask = cv::Mat::zeros(grey.size(), CV_8U);
  for (const cv::Rect& place : places) mask(place).setTo(1);
  return static_cast<double>(cv::countNonZero(mask)) / static_cast<double>(grey.total());
}

TagPlaceOptions OptionsOf(int decimate) {
  TagPlaceOptions options;
  options.decimate = decimate;
  options.min_side_px = 8;
  return options;
}

// Returns a number as a part of a test name, with an underscore as the decimal point.
std::string NameOf(double number) {
  std::ostringstream text;
  text << number;
  std::string name = text.str();
  std::replace(name.begin(), name.end(), '.', '_');
  return name;
}

bool Contain(const std::vector<cv::Rect>& places, const cv::Point& pixel) {
  return std::any_of(places.begin(), places.end(), [&](const cv::Rect& place) { return place.contains(pixel); });
}

// The distance of the sheet in metres, its tilt in radians and the noise in grey levels.
class TagPlacesOfViewTest : public testing::TestWithParam<std::tuple<double, double, double>> {};

// All points of a target with tags lie in the returned regions, even if the tags are small, tilted and noisy.
TEST_P(TagPlacesOfViewTest, ContainEveryTag) {
  const auto& [distance_m, tilt_rad, noise_grey] = GetParam();
  const std::unique_ptr<Target> target = MakeTarget(
      "{type: apriltag_grid, family: tag36h11, rows: 3, columns: 4, tag_size: 24 mm, tag_spacing: 0.3, "
      "corner_squares: false}");
  const cv::Mat grey = Rendered(target->Draw(), distance_m, tilt_rad, noise_grey);
  const std::vector<cv::Rect> places = FindTagPlaces(grey, OptionsOf(1)).boxes;
  for (const TargetPoint& point : target->points()) {
    const std::optional<Eigen::Vector2d> pixel = PixelOf(point, kCamera, PoseOf(target->Draw(), distance_m, tilt_rad));
    ASSERT_TRUE(pixel);
    const cv::Point at(static_cast<int>(pixel->x()), static_cast<int>(pixel->y()));
    EXPECT_TRUE(Contain(places, at)) << at;
  }
}

INSTANTIATE_TEST_SUITE_P(, TagPlacesOfViewTest,
                         testing::Combine(testing::Values(0.2, 0.6, 1.8), testing::Values(0.0, 0.9),
                                          testing::Values(0.0, 4.0)),
                         [](const auto& test) {
                           return NameOf(std::get<0>(test.param)) + "_m_" + NameOf(std::get<1>(test.param)) + "_rad_" +
                                  NameOf(std::get<2>(test.param)) + "_grey";
                         });

TEST(TagPlacesTest, ExcludeNoiseAndSolidShapes) {
  Drawing drawing;
  drawing.min_m = {-1, -1};
  drawing.max_m = {1, 1};
  for (const double noise_grey : {0.0, 2.0, 12.0}) {
    const cv::Mat wall = Rendered(drawing, 0.5, 0, noise_grey);
    for (const int decimate : {1, 2, 4}) {
      EXPECT_LT(AreaShare(FindTagPlaces(wall, OptionsOf(decimate)).boxes, wall), 0.05)
          << noise_grey << " grey levels, every " << decimate << "th pixel";
    }
  }
  // Neither a square without cells nor a ring, which is not a quad, is returned.
  cv::Mat shapes(kHeightPx, kWidthPx, CV_8UC1, cv::Scalar(200));
  cv::rectangle(shapes, {100, 100, 150, 150}, cv::Scalar(40), cv::FILLED);
  cv::circle(shapes, {600, 300}, 90, cv::Scalar(40), 20);
  EXPECT_TRUE(FindTagPlaces(shapes, OptionsOf(1)).boxes.empty());
  // A square with cells is returned, and so is its negative if light regions are searched for.
  cv::rectangle(shapes, {150, 150, 40, 50}, cv::Scalar(200), cv::FILLED);
  EXPECT_EQ(FindTagPlaces(shapes, OptionsOf(1)).boxes.size(), 1U);
  TagPlaceOptions light = OptionsOf(1);
  light.is_light_in_dark = true;
  EXPECT_EQ(FindTagPlaces(~shapes, light).boxes.size(), 1U);
}

TEST(TagPlacesTest, LargeRegionsAreSearchedOnce) {
  const std::unique_ptr<Target> target = MakeTarget(
      "{type: apriltag_grid, family: tag36h11, rows: 1, columns: 1, tag_size: 24 mm, corner_squares: false}");
  const cv::Mat grey = Rendered(target->Draw(), 0.1, 0.2, 1);
  const TagPlaces coarse = FindTagPlaces(grey, OptionsOf(4));
  EXPECT_EQ(coarse.boxes.size(), 1U);
  ASSERT_FALSE(coarse.large_px.empty());
  EXPECT_GT(coarse.large_px.front().width, 200);
  // Only cells within the tag remain.
  const double share = AreaShare(FindTagPlaces(grey, OptionsOf(2)).boxes, grey);
  EXPECT_GT(share, 0.05);
  EXPECT_LT(AreaShare(FindTagPlaces(grey, OptionsOf(2), coarse.large_px).boxes, grey), 0.5 * share);
}

// The size of the image and the decimation.
class TagPlacesOfSizeTest : public testing::TestWithParam<std::tuple<cv::Size, int>> {};

TEST_P(TagPlacesOfSizeTest, LieInTheImage) {
  const auto& [size, decimate] = GetParam();
  cv::Mat grey(size, CV_8UC1);
  cv::RNG random;
  random.fill(grey, cv::RNG::UNIFORM, 0, 255);
  for (const cv::Rect& place : FindTagPlaces(grey, OptionsOf(decimate)).boxes) {
    EXPECT_EQ((place & cv::Rect({}, size)), place);
  }
}

INSTANTIATE_TEST_SUITE_P(, TagPlacesOfSizeTest,
                         testing::Combine(testing::Values(cv::Size(1, 1), cv::Size(7, 900), cv::Size(9, 9),
                                                          cv::Size(33, 17)),
                                          testing::Values(1, 3)),
                         [](const auto& test) {
                           const cv::Size& size = std::get<0>(test.param);
                           return std::to_string(size.width) + "x" + std::to_string(size.height) + "_decimated_by_" +
                                  std::to_string(std::get<1>(test.param));
                         });

}  // namespace
}  // namespace heba
