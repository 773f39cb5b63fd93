#include "targets/guided_detection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

namespace heba {
namespace {

// A target that detects the given points in any image. If the image is a region of a larger one, the pixels are
// relative to the region.
class ScriptedTarget final : public Target {
 public:
  explicit ScriptedTarget(Detection in_whole_image) : found_(std::move(in_whole_image)) {
    for (int id = 0; id < 4; ++id) {
      const int row = id / 2;
      points_.push_back({id, {0.1 * (id % 2), 0.1 * row, 0}});
    }
  }
  std::string_view type() const override { return "scripted"; }
  const std::vector<TargetPoint>& points() const override { return points_; }
  Detection Detect(const cv::Mat& grey) const override {
    cv::Size whole;
    cv::Point offset;
    grey.locateROI(whole, offset);
    Detection detection = found_;
    for (Eigen::Vector2d& pixel : detection.pixels) pixel -= Eigen::Vector2d(offset.x, offset.y);
    return detection;
  }
  const Drawing& Draw() const override { return drawing_; }

 private:
  Detection found_;
  std::vector<TargetPoint> points_;
  Drawing drawing_;
};

const std::vector<std::optional<Eigen::Vector2d>> kExpected = {Eigen::Vector2d(400, 300), Eigen::Vector2d(450, 300),
                                                               Eigen::Vector2d(400, 350), std::nullopt};

Detection MakeDetection(const std::vector<int>& ids, const std::vector<Eigen::Vector2d>& pixels) {
  Detection detection;
  detection.ids = ids;
  detection.pixels = pixels;
  for (size_t i = 0; i < ids.size(); ++i) detection.covariances_px2.emplace_back(Eigen::Matrix2d::Identity());
  return detection;
}

TEST(GuidedDetectionTest, AddsNewPointsAndKeepsDetectedOnes) {
  const cv::Mat image(800, 1000, CV_8UC1, cv::Scalar(100));
  // The second detection returns point 0 at a slightly different position, point 1, and point 3, for which no
  // position is expected.
  const ScriptedTarget target(MakeDetection({0, 1, 3}, {{400.4, 300}, {450.5, 300.2}, {450, 350}}));
  const Detection first = MakeDetection({0}, {{400.1, 299.9}});
  const GuidedDetection guided = DetectGuided(target, image, first, kExpected, 2);
  EXPECT_EQ(guided.num_added, 1);
  EXPECT_EQ(guided.num_dropped, 0);
  EXPECT_THAT(guided.detection.ids, testing::ElementsAre(0, 1));
  EXPECT_EQ(guided.detection.pixels[0], first.pixels[0]);
  EXPECT_LT((guided.detection.pixels[1] - Eigen::Vector2d(450.5, 300.2)).norm(), 1e-9);
  EXPECT_EQ(guided.detection.covariances_px2.size(), 2U);
}

TEST(GuidedDetectionTest, DropsPointsFarFromTheirExpectedPosition) {
  const cv::Mat image(800, 1000, CV_8UC1, cv::Scalar(100));
  const ScriptedTarget target(MakeDetection({}, {}));
  const Detection first = MakeDetection({0, 1, 3}, {{400, 300}, {480, 300}, {10, 10}});
  const GuidedDetection guided = DetectGuided(target, image, first, kExpected, 2);
  EXPECT_EQ(guided.num_dropped, 2);
  EXPECT_THAT(guided.detection.ids, testing::ElementsAre(0));
}

TEST(GuidedDetectionTest, CorrelatedPointsAreKeptOrDroppedTogether) {
  const cv::Mat image(800, 1000, CV_8UC1, cv::Scalar(100));
  const ScriptedTarget target(MakeDetection({}, {}));
  Detection first = MakeDetection({0, 1, 2}, {{400, 300}, {480, 300}, {400, 350}});
  first.covariances_px2 = {Eigen::MatrixXd::Identity(4, 4), Eigen::MatrixXd::Identity(2, 2)};
  const GuidedDetection guided = DetectGuided(target, image, first, kExpected, 2);
  EXPECT_THAT(guided.detection.ids, testing::ElementsAre(2));
  ASSERT_EQ(guided.detection.covariances_px2.size(), 1U);
  EXPECT_EQ(guided.detection.covariances_px2[0].rows(), 2);
}

}  // namespace
}  // namespace heba
