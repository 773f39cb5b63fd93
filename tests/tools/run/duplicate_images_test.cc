// Tests of tools/run/duplicate_images.h.
#include "tools/run/duplicate_images.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/units.h"
#include "heba/run.h"

namespace heba {
namespace {
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// Captures with the given digests. Captures of one digest have the same pose, all others stand 100 mm apart.
struct Set {
  Dataset dataset = DatasetOf(Setup::kEyeToHand, nullptr);
  std::vector<TargetDetection> detections;

  explicit Set(const std::vector<std::string>& digests) {
    for (size_t i = 0; i < digests.size(); ++i) {
      size_t first = 0;
      while (digests[first] != digests[i]) ++first;
      const Rigid3d pose(Eigen::Quaterniond::Identity(), {0.1 * static_cast<double>(first), 0, 0});
      const std::string name = std::to_string(i) + ".png";
      dataset.captures.push_back({name, {pose}, {name}});
      TargetDetection& seen = detections.emplace_back();
      seen.capture = i;
      seen.detection.image_digest = digests[i];
      seen.detection.detection.ids = {0, 1, 2};
    }
  }
  Rigid3d& Pose(size_t capture) { return dataset.captures[capture].base_from_gripper[0]; }
  std::vector<PosedImage> Images() const { return PosedImagesOf(dataset, detections, 0).images; }
  std::vector<SharedImage> Find() const { return FindSharedImages(Images()); }
  std::vector<DuplicateInDataset> Duplicates() const { return FindDuplicates(dataset, detections); }
  std::vector<size_t> DuplicateCaptures() const {
    std::vector<size_t> captures;
    for (const DuplicateInDataset& duplicate : Duplicates()) captures.push_back(duplicate.capture);
    return captures;
  }
};

TEST(FindSharedImagesTest, DifferentImagesAreNotShared) { EXPECT_THAT(Set({"a", "b", "c"}).Find(), IsEmpty()); }

TEST(FindSharedImagesTest, UnknownDigestsAreNotEqual) {
  EXPECT_THAT(Set({"", "", "c"}).Find(), IsEmpty());
  EXPECT_THAT(PosedImagesOf(Set({"a", "a"}).dataset, {}, 0).images, IsEmpty());
}

TEST(FindSharedImagesTest, ListsSharedImagesInTheOrderOfTheirFirstCaptures) {
  const std::vector<SharedImage> shared = Set({"z", "a", "z", "b", "a", "z"}).Find();
  ASSERT_THAT(shared, SizeIs(2));
  EXPECT_THAT(shared[0].images, ElementsAre(0, 2, 5));
  EXPECT_THAT(shared[1].images, ElementsAre(1, 4));
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

TEST(FindDuplicatesTest, CopiesAreDuplicatesButForTheFirst) {
  const Set set({"a", "b", "a", "c", "a"});
  const std::vector<DuplicateInDataset> duplicates = set.Duplicates();
  EXPECT_THAT(set.DuplicateCaptures(), ElementsAre(2, 4));
  EXPECT_EQ(duplicates[0].reason, "the same image as 0.png, byte by byte");
  EXPECT_EQ(duplicates[0].repeat_of, "0.png");
  EXPECT_THAT(DuplicateNotes(duplicates, 5),
              ElementsAre("2 of 5 captures repeat the image of another one, byte by byte, and its pose; "
                          "they do not count"));
}

TEST(FindDuplicatesTest, NoCaptureOfAnImageWithTwoPosesIsUsed) {
  Set set({"a", "b", "a"});
  set.Pose(2).translation.x() = 1;
  const std::vector<DuplicateInDataset> duplicates = set.Duplicates();
  EXPECT_THAT(set.DuplicateCaptures(), ElementsAre(0, 2));
  EXPECT_EQ(duplicates.at(0).reason,
            "the same image as 2.png, byte by byte, but with another pose of the robot: at most one of the poses "
            "belongs to the image, so no capture with this image is used");
  EXPECT_EQ(duplicates.at(0).repeat_of, "");
  EXPECT_THAT(DuplicateNotes(duplicates, 3),
              ElementsAre("2 of 3 captures share their images, byte by byte, with captures that have another pose; "
                          "none of them is used"));
}

// Black images without a target are equal because they show nothing.
TEST(FindDuplicatesTest, ImagesWithoutATargetAreKept) {
  Set set({"a", "a"});
  for (TargetDetection& seen : set.detections) seen.detection.detection.ids.clear();
  EXPECT_THAT(set.Duplicates(), IsEmpty());
}

TEST(FindDuplicatesTest, DifferentImagesHaveNone) {
  const Set set({"a", "b"});
  EXPECT_THAT(set.Duplicates(), IsEmpty());
  EXPECT_THAT(DuplicateNotes(set.Duplicates(), 2), IsEmpty());
}

TEST(WithDuplicatesTest, TheirEntriesHaveTheReasonAndTheirPoints) {
  const Set set({"a", "b", "a"});
  std::vector<ImageResult> images(3);
  for (size_t i = 0; i < images.size(); ++i) images[i].capture = set.dataset.captures[i].name;
  images = WithDuplicates(std::move(images), set.dataset, set.Duplicates(), set.detections);
  EXPECT_EQ(images[0].reason, "");
  EXPECT_EQ(images[2].reason, "the same image as 0.png, byte by byte");
  EXPECT_EQ(images[2].repeat_of, "0.png");
  ASSERT_THAT(images[2].targets, SizeIs(1));
  EXPECT_EQ(images[2].targets[0].num_points, 3);
  EXPECT_FALSE(images[2].targets[0].used);
}

}  // namespace
}  // namespace heba
