// Tests of tools/run/second_detection.h.
#include "tools/run/second_detection.h"

#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "heba/base/rng.h"
#include "tests/support/rendered_target.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
using ::testing::SizeIs;

constexpr const char* kTarget =
    "{type: charuco, rows: 6, columns: 8, square: 20 mm, marker: 14 mm, dictionary: DICT_4X4_250}";

// Six rendered images of two cameras, detected, and where they were rendered.
struct RenderedCell {
  TempFolder folder;
  Dataset dataset;
  std::vector<TargetDetection> detections;
  PredictedImages predicted;

  RenderedCell() {
    Rng rng(7);
    dataset.targets = {MakeTarget(kTarget)};
    dataset.rig.targets = {{"plate", {}, {}}};
    dataset.rig.cameras.resize(2);
    const Target& target = *dataset.targets[0];
    const TargetShape shape = DesignedShape(AllPoints(target).points_in_target);
    predicted = {{ImageCamera(), ImageCamera()}, {shape}, {}, {0.2, 0.2}};
    for (size_t i = 0; i < 6; ++i) {
      Recording& capture = dataset.captures.emplace_back();
      for (size_t c = 0; c < 2; ++c) {
        const Rigid3d pose = RandomView(target.Draw(), 0.6, 0.4, 3, rng);
        capture.images.push_back(folder / (std::to_string(2 * i + c) + ".png"));
        cv::imwrite(capture.images.back().string(), RenderView(target.Draw(), ImageCamera(), pose));
        detections.push_back({i, c, 0, DetectCapture(target, capture.images.back())});
        predicted.camera_from_target.emplace_back(pose);
      }
    }
  }
};

const RenderedCell& Rendered() {
  static const RenderedCell rendered;
  return rendered;
}

class SecondDetectionTest : public testing::Test {
 protected:
  // Removes the points with the first ids from the detections of a camera, or of all cameras.
  void Forget(int num_ids, std::optional<size_t> camera) {
    for (TargetDetection& of_image : detections_) {
      if (camera && of_image.camera != *camera) continue;
      Detection kept = of_image.detection.detection;
      Detection& all = of_image.detection.detection;
      kept.ids.clear();
      kept.pixels.clear();
      kept.covariances_px2.clear();
      for (size_t k = 0; k < all.ids.size(); ++k) {
        if (all.ids[k] < num_ids) continue;
        kept.ids.push_back(all.ids[k]);
        kept.pixels.push_back(all.pixels[k]);
        if (!all.covariances_px2.empty()) kept.covariances_px2.push_back(all.covariances_px2[k]);
      }
      all = kept;
    }
  }

  Dataset dataset_ = Rendered().dataset;
  std::vector<TargetDetection> detections_ = Rendered().detections;
  PredictedImages predicted_ = Rendered().predicted;
};

TEST_F(SecondDetectionTest, FindsPointsInTheImagesOfEveryCamera) {
  const std::vector<TargetDetection> complete = detections_;
  Forget(6, std::nullopt);
  const std::optional<std::vector<TargetDetection>> again = DetectAgain(dataset_, detections_, predicted_, 2, nullptr);
  ASSERT_TRUE(again);
  ASSERT_THAT(*again, SizeIs(complete.size()));
  for (size_t i = 0; i < complete.size(); ++i) {
    const std::vector<int>& expected = complete[i].detection.detection.ids;
    const std::vector<int>& ids = (*again)[i].detection.detection.ids;
    const std::set<int> found(ids.begin(), ids.end());
    for (const int id : expected) EXPECT_TRUE(found.contains(id)) << "image " << i << ", id " << id;
    EXPECT_GT((*again)[i].detection.num_second_pass, 0);
  }
}

TEST_F(SecondDetectionTest, ImagesThatContradictTheCalibrationAreLeftAsTheyAre) {
  Forget(6, std::nullopt);
  for (std::optional<Rigid3d>& pose : predicted_.camera_from_target) pose.reset();
  EXPECT_FALSE(DetectAgain(dataset_, detections_, predicted_, 1, nullptr));
}

TEST_F(SecondDetectionTest, GivenDetectionsAreNotSearchedForAgain) {
  Forget(6, std::nullopt);
  dataset_.given_detections = detections_;
  EXPECT_FALSE(DetectAgain(dataset_, detections_, predicted_, 1, nullptr));
}

TEST_F(SecondDetectionTest, IdsThatAreNeverFoundAreNamedWithTheirTarget) {
  EXPECT_THAT(FindMissingIds(dataset_, detections_, predicted_), SizeIs(0));
  Forget(6, 0);
  // The other camera finds them.
  EXPECT_THAT(FindMissingIds(dataset_, detections_, predicted_), SizeIs(0));
  Forget(6, 1);
  const std::vector<Finding> findings = FindMissingIds(dataset_, detections_, predicted_);
  ASSERT_THAT(findings, SizeIs(1));
  EXPECT_EQ(findings[0].code, FindingCode("missing_ids"));
  EXPECT_EQ(findings[0].Name("of_target"), "plate");
  EXPECT_EQ(findings[0].Number("missing"), 6);
}

}  // namespace
}  // namespace heba
