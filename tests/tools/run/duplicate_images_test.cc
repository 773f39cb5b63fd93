// Tests of tools/run/duplicate_images.h.
#include "tools/run/duplicate_images.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/units.h"

namespace heba {
namespace {
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// Captures with the given digests. Captures of one digest have the same pose, all others stand 100 mm apart.
struct Set {
  PairDataset dataset;
  std::vector<CaptureDetection> detections;

  explicit Set(const std::vector<std::string>& digests) {
    for (size_t i = 0; i < digests.size(); ++i) {
      size_t first = 0;
      while (digests[first] != digests[i]) ++first;
      const Rigid3d pose(Eigen::Quaterniond::Identity(), {0.1 * static_cast<double>(first), 0, 0});
      dataset.captures.push_back({std::to_string(i) + ".png", "", CaptureRole::kNone, pose});
      CaptureDetection detection;
      detection.image_digest = digests[i];
      detection.detection.ids = {0, 1, 2};
      detections.push_back(detection);
    }
  }
  Rigid3d& Pose(size_t capture) { return dataset.captures[capture].base_from_gripper; }
  std::vector<SharedImage> Find() const { return FindSharedImages(Images()); }
  std::vector<PosedImage> Images() const { return PosedImagesOf(dataset.captures, detections); }
  LeftOutCaptures LeaveOut() { return LeaveOutSharedImages(&dataset, &detections); }
  std::vector<std::string> Names() const {
    std::vector<std::string> names;
    for (const Capture& capture : dataset.captures) names.push_back(capture.name);
    return names;
  }
};

TEST(FindSharedImagesTest, DifferentImagesAreNotShared) { EXPECT_THAT(Set({"a", "b", "c"}).Find(), IsEmpty()); }

TEST(FindSharedImagesTest, UnknownDigestsAreNotEqual) {
  EXPECT_THAT(Set({"", "", "c"}).Find(), IsEmpty());
  EXPECT_THAT(FindSharedImages(PosedImagesOf(Set({"a", "a"}).dataset.captures, {})), IsEmpty());
}

TEST(FindSharedImagesTest, ListsSharedImagesInTheOrderOfTheirFirstCaptures) {
  const std::vector<SharedImage> shared = Set({"z", "a", "z", "b", "a", "z"}).Find();
  ASSERT_THAT(shared, SizeIs(2));
  EXPECT_THAT(shared[0].captures, ElementsAre(0, 2, 5));
  EXPECT_THAT(shared[1].captures, ElementsAre(1, 4));
  EXPECT_TRUE(shared[0].has_one_pose);
}

TEST(FindSharedImagesTest, PosesAreEqualWithinTheNoiseOfARobotThatStandsStill) {
  Set set({"a", "a"});
  set.Pose(1).translation.x() += 0.09e-3;
  EXPECT_TRUE(set.Find().at(0).has_one_pose);
  set.Pose(1).translation.x() += 0.02e-3;
  EXPECT_FALSE(set.Find().at(0).has_one_pose);
  set.Pose(1) = set.Pose(0);
  set.Pose(1).rotation = ExpRotation({DegToRad(0.009), 0, 0});
  EXPECT_TRUE(set.Find().at(0).has_one_pose);
  set.Pose(1).rotation = ExpRotation({DegToRad(0.011), 0, 0});
  EXPECT_FALSE(set.Find().at(0).has_one_pose);
}

TEST(FindOtherPoseTest, IsTheFirstCaptureWithAnotherPose) {
  Set set({"a", "a", "a"});
  set.Pose(2).translation.x() = 1;
  const SharedImage shared = set.Find().at(0);
  EXPECT_EQ(FindOtherPose(set.Images(), shared, 0), 2u);
  EXPECT_EQ(FindOtherPose(set.Images(), shared, 2), 0u);
}

TEST(LeaveOutSharedImagesTest, CopiesAreLeftOutButForTheFirst) {
  Set set({"a", "b", "a", "c", "a"});
  set.dataset.captures[2].role = CaptureRole::kRotate;
  const LeftOutCaptures left_out = set.LeaveOut();
  EXPECT_THAT(set.Names(), ElementsAre("0.png", "1.png", "3.png"));
  EXPECT_THAT(set.detections, SizeIs(3));
  EXPECT_EQ(set.detections[2].image_digest, "c");
  EXPECT_THAT(left_out.indices, ElementsAre(2, 4));
  ASSERT_THAT(left_out.results, SizeIs(2));
  EXPECT_EQ(left_out.results[0].image, "2.png");
  EXPECT_EQ(left_out.results[0].role, CaptureRole::kRotate);
  ASSERT_THAT(left_out.results[0].targets, SizeIs(1));
  EXPECT_EQ(left_out.results[0].targets[0].num_points, 3);
  EXPECT_FALSE(left_out.results[0].used);
  EXPECT_EQ(left_out.results[0].reason, "the same image as 0.png, byte by byte");
  EXPECT_EQ(left_out.results[0].repeat_of, "0.png");
  EXPECT_THAT(left_out.notes,
              ElementsAre("2 of 5 captures repeat the image of another one, byte by byte, and its pose; "
                          "they do not count"));
}

TEST(LeaveOutSharedImagesTest, NoCaptureOfAnImageWithTwoPosesIsUsed) {
  Set set({"a", "b", "a"});
  set.Pose(2).translation.x() = 1;
  const LeftOutCaptures left_out = set.LeaveOut();
  EXPECT_THAT(set.Names(), ElementsAre("1.png"));
  EXPECT_THAT(left_out.indices, ElementsAre(0, 2));
  EXPECT_EQ(
      left_out.results.at(0).reason,
      "the same image as 2.png, byte by byte, but with another pose of the robot: at most one of the poses belongs "
      "to the image, so no capture with this image is used");
  EXPECT_EQ(left_out.results.at(0).repeat_of, "");
  EXPECT_THAT(left_out.notes, ElementsAre("2 of 3 captures share their images, byte by byte, with captures that have "
                                          "another pose; none of them is used"));
}

// Black images without a target are equal because they show nothing.
TEST(LeaveOutSharedImagesTest, ImagesWithoutATargetAreKept) {
  Set set({"a", "a"});
  for (CaptureDetection& detection : set.detections) detection.detection.ids.clear();
  EXPECT_THAT(set.LeaveOut().indices, IsEmpty());
  EXPECT_THAT(set.Names(), SizeIs(2));
}

TEST(LeaveOutSharedImagesTest, NothingIsLeftOutOfDifferentImages) {
  Set set({"a", "b"});
  const LeftOutCaptures left_out = set.LeaveOut();
  EXPECT_THAT(left_out.indices, IsEmpty());
  EXPECT_THAT(left_out.notes, IsEmpty());
  EXPECT_THAT(set.Names(), SizeIs(2));
}

TEST(InsertLeftOutTest, RestoresTheOrderOfTheCaptures) {
  Set set({"a", "b", "a", "c", "a"});
  const LeftOutCaptures left_out = set.LeaveOut();
  std::vector<ImageResult> results;
  for (const std::string& name : set.Names()) {
    results.emplace_back();
    results.back().image = name;
    results.back().used = true;
  }
  InsertLeftOut(left_out, &results);
  std::vector<std::string> names;
  for (const ImageResult& result : results) names.push_back(result.image);
  EXPECT_THAT(names, ElementsAre("0.png", "1.png", "2.png", "3.png", "4.png"));
  EXPECT_TRUE(results[3].used);
  EXPECT_FALSE(results[4].used);
}

}  // namespace
}  // namespace heba
