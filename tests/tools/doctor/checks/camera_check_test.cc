// Tests of the check whether the intrinsics belong to the images: tools/doctor/checks/camera.cc.
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/doctor/examinations.h"

namespace heba {
namespace {
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Returns an examination before this check: the config names `given`, and no camera is chosen yet.
Examination ExaminationWith(const std::optional<Camera>& given, const SimulatedSetOptions& options = {}) {
  Examination examination = CleanExamination(options);
  examination.config.data.has_camera = {given.has_value()};
  examination.config.data.rig.cameras[0].camera = given.value_or(Camera());
  examination.camera.reset();
  examination.views.clear();
  return examination;
}

// Returns the camera of images that are larger by `factor`.
Camera ScaledCamera(Camera camera, double factor) {
  for (const size_t i : {0, 1}) camera.params[i] *= factor;
  for (const size_t i : {2, 3}) camera.params[i] = (camera.params[i] + 0.5) * factor - 0.5;
  return camera;
}

TEST(CameraCheckTest, TheRightCameraIsUsedWithoutASymptom) {
  Examination examination = ExaminationWith(TestCamera());
  EXPECT_THAT(CodesOf(RunCheck(Check_camera, &examination)), IsEmpty());
  ASSERT_TRUE(examination.camera.has_value());
  EXPECT_EQ(examination.camera->params, TestCamera().params);
}

TEST(CameraCheckTest, ACameraWithoutASizeTakesThatOfTheImages) {
  Camera given = TestCamera();
  given.width_px = given.height_px = 0;
  Examination examination = ExaminationWith(given);
  EXPECT_THAT(CodesOf(RunCheck(Check_camera, &examination)), IsEmpty());
  EXPECT_EQ(examination.camera->width_px, 1600);
  EXPECT_EQ(examination.camera->height_px, 1200);
}

TEST(CameraCheckTest, EstimatesACameraThatIsNotGiven) {
  Examination examination = ExaminationWith(std::nullopt);
  EXPECT_THAT(CodesOf(RunCheck(Check_camera, &examination)), IsEmpty());
  ASSERT_TRUE(examination.camera.has_value());
  EXPECT_NEAR(examination.camera->params[0], TestCamera().params[0], 15);
}

TEST(CameraCheckTest, SaysThatOneCaptureDoesNotDetermineTheIntrinsics) {
  SimulatedSetOptions options;
  options.num_captures = 1;
  options.max_tilt_rad = 0;
  Examination examination = ExaminationWith(std::nullopt, options);
  const std::vector<Symptom> symptoms = RunCheck(Check_camera, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong no_camera"));
  EXPECT_THAT(symptoms[0].cure, HasSubstr("camera.intrinsics"));
  EXPECT_FALSE(examination.camera.has_value());
}

TEST(CameraCheckTest, FindsTheIntrinsicsOfHalfTheImageSize) {
  Camera half = ScaledCamera(TestCamera(), 0.5);
  half.width_px = 800;
  half.height_px = 600;
  Examination examination = ExaminationWith(half);
  const std::vector<Symptom> symptoms = RunCheck(Check_camera, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong camera_size"));
  EXPECT_THAT(symptoms[0].what,
              HasSubstr("camera.yaml is for images of 800 x 600 px, but these are 1600 x 1200 px: scaled by 2.000"));
  EXPECT_THAT(symptoms[0].cure, HasSubstr("multiply fx, fy, cx + 0.5 and cy + 0.5 by 2.000"));
  ASSERT_TRUE(examination.camera.has_value());
  EXPECT_NEAR(examination.camera->params[0], TestCamera().params[0], 15);
}

// One capture does not determine the intrinsics, so those of the file are scaled.
TEST(CameraCheckTest, ScalesIntrinsicsThatCannotBeEstimated) {
  SimulatedSetOptions options;
  options.num_captures = 1;
  options.max_tilt_rad = 0;
  Camera half = ScaledCamera(TestCamera(), 0.5);
  half.width_px = 800;
  half.height_px = 600;
  Examination examination = ExaminationWith(half, options);
  EXPECT_THAT(CodesOf(RunCheck(Check_camera, &examination)), ElementsAre("wrong camera_size"));
  ASSERT_TRUE(examination.camera.has_value());
  EXPECT_THAT(examination.camera->params, testing::Pointwise(testing::DoubleNear(1e-9), TestCamera().params));
  EXPECT_EQ(examination.camera->width_px, 1600);
}

// The images are a window in the middle of those that the camera was calibrated with.
TEST(CameraCheckTest, FindsCroppedImages) {
  Camera whole = TestCamera();
  whole.width_px += 400;
  whole.height_px += 100;
  whole.params[2] += 200;
  whole.params[3] += 50;
  Examination examination = ExaminationWith(whole);
  const std::vector<Symptom> symptoms = RunCheck(Check_camera, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong camera_size"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("2000 x 1300 px, but these are 1600 x 1200 px: cropped"));
  EXPECT_THAT(symptoms[0].cure, HasSubstr("subtract the window's left and top from cx and cy"));
}

// The file states the size of these images, but its numbers are of another resolution.
TEST(CameraCheckTest, FindsTheFocalLengthOfAnotherResolution) {
  Examination examination = ExaminationWith(ScaledCamera(TestCamera(), 0.5));
  const std::vector<Symptom> symptoms = RunCheck(Check_camera, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong camera_scale"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("the intrinsics of camera.yaml are for images half as large"));
  ASSERT_TRUE(examination.camera.has_value());
  EXPECT_NEAR(examination.camera->params[0], TestCamera().params[0], 1e-9);
}

TEST(CameraCheckTest, FindsTheIntrinsicsOfAnotherLens) {
  Camera other = TestCamera();
  for (const size_t i : {0, 1}) other.params[i] *= 1.3;
  Examination examination = ExaminationWith(other);
  const std::vector<Symptom> symptoms = RunCheck(Check_camera, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong camera"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("focal length 1950 px given, 1"));
  EXPECT_THAT(symptoms[0].cure, HasSubstr("leave camera.intrinsics out"));
  ASSERT_TRUE(examination.camera.has_value());
  EXPECT_NEAR(examination.camera->params[0], TestCamera().params[0], 15);
}

TEST(CameraCheckTest, RemarksOnDistortionThatTheFileLacks) {
  SimulatedSetOptions options;
  options.camera.params[4] = -0.2;
  Camera straight = options.camera;
  for (size_t i = 4; i < straight.params.size(); ++i) straight.params[i] = 0;
  Examination examination = ExaminationWith(straight, options);
  const std::vector<Symptom> symptoms = RunCheck(Check_camera, &examination);
  ASSERT_EQ(symptoms.size(), 1u);
  EXPECT_EQ(symptoms[0].code.name(), "distortion");
  EXPECT_THAT(symptoms[0].what, HasSubstr("the distortion of the lens differs from that of the intrinsics"));
  EXPECT_NEAR(examination.camera->params[4], -0.2, 0.05);
}

// Returns an examination of a lens with this k1, without a camera file.
Examination ExaminationWithoutFile(double k1, const std::string& model) {
  SimulatedSetOptions options;
  options.num_captures = 20;
  options.camera.params[4] = k1;
  Examination examination = CleanExamination(options);
  examination.config.data.has_camera = {false};
  examination.config.data.rig.cameras[0].camera = {model, 0, 0, {}};
  return examination;
}

TEST(CameraCheckTest, FindsAModelThatDoesNotFitTheLens) {
  Examination examination = ExaminationWithoutFile(-0.2, "pinhole");
  const std::vector<Symptom> symptoms = RunCheck(Check_camera, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong lens"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("the camera model pinhole does not fit the lens: single views fit to "));
  EXPECT_THAT(symptoms[0].cure, HasSubstr("set camera.model: " + examination.camera->model));
  EXPECT_NEAR(examination.camera->params[0], TestCamera().params[0], 15);
}

TEST(CameraCheckTest, ModelsThatFitTheLensHaveNoSymptom) {
  Examination examination = ExaminationWithoutFile(-0.2, "brown5");
  EXPECT_THAT(CodesOf(RunCheck(Check_camera, &examination)), IsEmpty());
  Examination straight = ExaminationWithoutFile(0, "pinhole");
  for (size_t i = 4; i < straight.camera->params.size(); ++i) straight.camera->params[i] = 0;
  EXPECT_THAT(CodesOf(RunCheck(Check_camera, &straight)), IsEmpty());
}

}  // namespace
}  // namespace heba
