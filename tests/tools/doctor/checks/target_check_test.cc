// Tests of the check whether the images show the target that the config names: tools/doctor/checks/target.cc.
#include <cstdlib>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "heba/base/units.h"
#include "targets/render/rendering.h"
#include "tests/support/temp_folder.h"
#include "tests/tools/doctor/examinations.h"

namespace heba {
namespace {
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

constexpr const char* kCharuco =
    "{type: charuco, rows: 4, columns: 5, square: 30 mm, marker: 22 mm, dictionary: DICT_4X4_50}";

// Returns an image of the whole target, or of an empty wall.
cv::Mat ImageOf(const std::string& target_yaml) {
  const std::shared_ptr<const Target> target = TargetOfYaml(target_yaml);
  const Camera camera{"pinhole", 360, 300, {375, 375, 180, 150}};
  const Rigid3d camera_from_target(ExpRotation({0.2, -0.1, 0.1}), {-0.075, -0.06, 0.3});
  return RenderView(target->Draw(), camera, camera_from_target);
}

class TargetCheckTest : public testing::Test {
 protected:
  // Detections are not cached, so that every test searches its images.
  TargetCheckTest() { setenv("HEBA_CACHE", "", 1); }

  // Returns an examination of images that all show the same.
  Examination ExaminationOfImages(const cv::Mat& image, int num_images, const std::string& configured) const {
    Examination examination;
    examination.config.data = DatasetOf(Setup::kEyeToHand, TargetOfYaml(configured));
    examination.config.targets_used = {configured};
    examination.config.has_target_keys = {false};
    examination.verbosity = Verbosity::kQuiet;
    for (int i = 0; i < num_images; ++i) AddImage(image, &examination);
    return examination;
  }
  void AddImage(const cv::Mat& image, Examination* examination) const {
    const std::string name = std::to_string(examination->config.data.captures.size()) + ".png";
    cv::imwrite((folder_ / name).string(), image);
    examination->config.data.captures.push_back({name, {Rigid3d()}, {folder_ / name}});
  }

  TempFolder folder_;
};

TEST_F(TargetCheckTest, TheRightTargetHasNoSymptom) {
  Examination examination = ExaminationOfImages(ImageOf(kCharuco), 3, kCharuco);
  EXPECT_THAT(CodesOf(RunCheck(Check_target, &examination)), IsEmpty());
  ASSERT_THAT(examination.detections, SizeIs(3));
  EXPECT_THAT(examination.detections[0].detection.detection.ids, SizeIs(12));
}

TEST_F(TargetCheckTest, FindsTheDictionaryOfTheImagesAndContinuesWithIt) {
  std::string other = kCharuco;
  other.replace(other.find("DICT_4X4_50"), 11, "DICT_5X5_50");
  Examination examination = ExaminationOfImages(ImageOf(kCharuco), 2, other);
  const std::vector<Symptom> symptoms = RunCheck(Check_target, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong target"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("the images show another target than the config names: that one is detected "
                                          "in 0 of 2 images that were searched"));
  EXPECT_THAT(symptoms[0].cure, HasSubstr("set in the target: dictionary: DICT_4X4_"));
  ASSERT_THAT(examination.detections, SizeIs(2));
  EXPECT_THAT(examination.detections[0].detection.detection.ids, SizeIs(12));
  EXPECT_THAT(examination.config.targets_used[0], HasSubstr("DICT_4X4_"));
}

// A setting target.KEY would not reach into the target's own file.
TEST_F(TargetCheckTest, SettingsCureATargetInItsOwnFile) {
  std::string other = kCharuco;
  other.replace(other.find("rows: 4, columns: 5"), 19, "rows: 5, columns: 4");
  ExaminationOfImages(ImageOf(kCharuco), 2, other);  // Writes the images.
  std::ofstream(folder_ / "poses.csv") << "image,x,y,z,qx,qy,qz,qw\n0.png,0,0,1,0,0,0,1\n1.png,0.1,0,1,0,0,0,1\n";
  std::ofstream(folder_ / "target.yaml") << other;
  const std::string config = "setup: eye_in_hand\ncaptures: {images: ., poses: poses.csv, pose_format: ros}\ntarget: ";
  std::ofstream(folder_ / "keys.yaml") << config << other;
  std::ofstream(folder_ / "file.yaml") << config << "target.yaml";
  for (const std::string name : {"keys.yaml", "file.yaml"}) {
    Examination examination;
    examination.config = ReadShortRunConfig(folder_ / name);
    examination.verbosity = Verbosity::kQuiet;
    const std::vector<Symptom> symptoms = RunCheck(Check_target, &examination);
    ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong target")) << name;
    EXPECT_EQ(symptoms[0].settings.size(), name == "file.yaml" ? 1U : 2U);
    std::vector<std::string> settings;
    for (const auto& [key, value] : symptoms[0].settings) settings.push_back(key + "=" + value);
    examination.config = ReadShortRunConfig(folder_ / name, settings);
    EXPECT_THAT(CodesOf(RunCheck(Check_target, &examination)), IsEmpty()) << name;
  }
}

TEST_F(TargetCheckTest, SaysThatTheTargetIsNotSeen) {
  Examination examination = ExaminationOfImages(cv::Mat(200, 240, CV_8UC1, cv::Scalar(128)), 3, kCharuco);
  const std::vector<Symptom> symptoms = RunCheck(Check_target, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong target_not_seen"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("the target is detected in 0 of 3 images"));
  // 'heba detect' writes nothing if no image shows the target.
  EXPECT_THAT(symptoms[0].cure, Not(HasSubstr("heba detect")));
}

TEST_F(TargetCheckTest, RemarksOnATargetThatIsOftenMissed) {
  const cv::Mat seen = ImageOf(kCharuco);
  Examination examination = ExaminationOfImages(seen, 3, kCharuco);
  for (int i = 0; i < 2; ++i) AddImage(cv::Mat(seen.size(), CV_8UC1, cv::Scalar(128)), &examination);
  const std::vector<Symptom> symptoms = RunCheck(Check_target, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("remark target_often_missed"));
  EXPECT_THAT(symptoms[0].what,
              HasSubstr("the target is detected only in 3 of 5 images (100 % of its points in the median image)"));
}

// Detections of an earlier run replace the images, so there is nothing to search.
TEST_F(TargetCheckTest, GivenDetectionsAreTakenAsTheyAre) {
  Examination examination = CleanExamination();
  examination.detections.clear();
  EXPECT_THAT(CodesOf(RunCheck(Check_target, &examination)), IsEmpty());
  EXPECT_THAT(examination.detections, SizeIs(12));
}

}  // namespace
}  // namespace heba
