#include "tools/run/captures.h"

#include <cstdlib>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "heba/base/units.h"
#include "tests/support/input_error.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"
#include "tools/files/digest.h"

namespace heba {
namespace {
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

constexpr const char* kTarget = "{type: chessboard, rows: 3, columns: 4, square: 20 mm}";

CaptureDetection DetectionOf(int width_px, int height_px, const std::vector<int>& ids = {}) {
  CaptureDetection capture;
  capture.width_px = width_px;
  capture.height_px = height_px;
  capture.detection.ids = ids;
  for (const int id : ids) capture.detection.pixels.emplace_back(10 * id, 20);
  return capture;
}

// Returns a config of three captures whose detections are given.
RunConfig ConfigOf(const std::vector<CaptureDetection>& detections) {
  RunConfig config;
  MapReader reader(ParseYaml(kTarget, "target.yaml"));
  config.target = CreateTarget(reader);
  config.target_used = kTarget;
  config.given_detections = detections;
  config.data_files = {"detections.json"};
  config.camera_file = "camera.yaml";
  for (size_t i = 0; i < detections.size(); ++i) {
    const Rigid3d base_from_gripper(ExpRotation({0.1, 0, 0}), {static_cast<double>(i), 0, 1});
    config.captures.push_back({std::to_string(i) + ".png", "", i == 0 ? "home" : "rotate", base_from_gripper});
  }
  return config;
}

TEST(DetectCapturesTest, GivenDetectionsAreReturnedAsTheyAre) {
  const RunConfig config = ConfigOf({DetectionOf(640, 480, {0, 1}), DetectionOf(640, 480)});
  const std::vector<CaptureDetection> detections = DetectCaptures(config, 1, Verbosity::kQuiet);
  ASSERT_THAT(detections, SizeIs(2));
  EXPECT_THAT(detections[0].detection.ids, ElementsAre(0, 1));
}

TEST(DetectCapturesTest, AnUnknownSizeIsThatOfTheCamera) {
  RunConfig config = ConfigOf({DetectionOf(0, 0, {0})});
  EXPECT_THAT(InputErrorOf([&] { DetectCaptures(config, 1, Verbosity::kQuiet); }),
              HasSubstr("detections.json: does not state the image size; provide a camera file that does"));
  config.camera = Camera{"pinhole", 800, 600, {600, 600, 400, 300}};
  EXPECT_EQ(DetectCaptures(config, 1, Verbosity::kQuiet).at(0).width_px, 800);
  EXPECT_EQ(DetectCaptures(config, 1, Verbosity::kQuiet).at(0).height_px, 600);
}

TEST(DetectCapturesTest, AllImagesHaveOneSize) {
  EXPECT_THAT(InputErrorOf([] {
                DetectCaptures(ConfigOf({DetectionOf(640, 480), DetectionOf(640, 480), DetectionOf(640, 481)}), 1,
                               Verbosity::kQuiet);
              }),
              HasSubstr("2.png: is 640 x 481 px, but 0.png is 640 x 480 px; all images must come from one camera"));
}

class CaptureDetectorTest : public testing::Test {
 protected:
  CaptureDetectorTest() {
    setenv("HEBA_CACHE", (folder_ / "cache").c_str(), 1);
    cv::imwrite((folder_ / "empty.png").string(), cv::Mat(48, 64, CV_8UC1, cv::Scalar(128)));
  }
  TempFolder folder_;
};

TEST_F(CaptureDetectorTest, StatesTheDigestAndTheSizeOfTheImage) {
  const CaptureDetection detection = CaptureDetector(kTarget).Detect(folder_ / "empty.png", std::nullopt);
  EXPECT_EQ(detection.image_digest, DigestOfFile(folder_ / "empty.png"));
  EXPECT_EQ(detection.width_px, 64);
  EXPECT_EQ(detection.height_px, 48);
  EXPECT_THAT(detection.detection.ids, SizeIs(0));
}

// An image is searched once, even if another detector searches it for a target of another size.
TEST_F(CaptureDetectorTest, DetectionsAreKeptIndependentlyOfTheTargetsSize) {
  const CaptureDetector first(kTarget);
  EXPECT_FALSE(first.has_kept());
  first.Detect(folder_ / "empty.png", std::nullopt);
  EXPECT_TRUE(first.has_kept());
  const CaptureDetector larger("{type: chessboard, rows: 3, columns: 4, square: 25 mm}");
  larger.Detect(folder_ / "empty.png", std::nullopt);
  EXPECT_FALSE(larger.has_kept());
  const CaptureDetector other("{type: chessboard, rows: 3, columns: 5, square: 20 mm}");
  other.Detect(folder_ / "empty.png", std::nullopt);
  EXPECT_TRUE(other.has_kept());
}

TEST_F(CaptureDetectorTest, RefusesAnImageOfAnotherSize) {
  EXPECT_THAT(InputErrorOf([&] {
                CaptureDetector(kTarget).Detect(folder_ / "empty.png", ImageSize{64, 64});
              }),
              HasSubstr("empty.png"));
  EXPECT_THAT(InputErrorOf([&] { CaptureDetector(kTarget).Detect(folder_ / "absent.png", std::nullopt); }),
              HasSubstr("absent.png: cannot be read"));
}

TEST(FitCameraToImagesTest, FillsInASizeThatTheFileDoesNotState) {
  RunConfig config = ConfigOf({DetectionOf(640, 480)});
  FitCameraToImages(DetectionOf(640, 480), &config);
  EXPECT_FALSE(config.camera.has_value());
  config.camera = Camera{"pinhole", 0, 0, {600, 600, 320, 240}};
  FitCameraToImages(DetectionOf(640, 480), &config);
  EXPECT_EQ(config.camera->width_px, 640);
  EXPECT_EQ(config.camera->height_px, 480);
}

TEST(FitCameraToImagesTest, RefusesTheCameraOfAnotherSize) {
  RunConfig config = ConfigOf({DetectionOf(640, 480)});
  config.camera = Camera{"pinhole", 640, 400, {600, 600, 320, 200}};
  EXPECT_EQ(InputErrorOf([&] { FitCameraToImages(DetectionOf(640, 480), &config); }),
            "camera.yaml: is for images of 640 x 400 px, but 0.png is 640 x 480 px; provide the intrinsics of that "
            "resolution");
}

TEST_F(CaptureDetectorTest, TheHeaderOfTheFirstImageShowsTheWrongCamera) {
  RunConfig config = ConfigOf({DetectionOf(64, 48)});
  config.captures[0].image = folder_ / "empty.png";
  config.camera = Camera{"pinhole", 0, 0, {600, 600, 32, 24}};
  CheckCameraByHeader(config);
  EXPECT_EQ(config.camera->width_px, 0);
  config.camera->width_px = config.camera->height_px = 64;
  EXPECT_THAT(InputErrorOf([&] { CheckCameraByHeader(config); }),
              HasSubstr("is for images of 64 x 64 px, but 0.png is 64 x 48 px"));
}

TEST(ViewsTest, ViewsAreThoseOfTheCapturesInWhichTheTargetWasSeen) {
  RunConfig config = ConfigOf({DetectionOf(640, 480), DetectionOf(640, 480, {0, 5})});
  const std::vector<View> views = ViewsOf(config, config.given_detections);
  ASSERT_THAT(views, SizeIs(1));
  EXPECT_EQ(views[0].name, "1.png");
  EXPECT_EQ(views[0].role, "rotate");
  EXPECT_THAT(views[0].camera_mount_from_target_mount, IsNearPose(config.captures[1].base_from_gripper, 1e-12, 1e-12));
  EXPECT_THAT(views[0].observations.ids, ElementsAre(0, 5));
  // Point 5 is the second one of the second row.
  EXPECT_NEAR((views[0].observations.points_in_target.col(1) - Eigen::Vector3d(0.02, 0.02, 0)).norm(), 0, 1e-12);
  EXPECT_EQ(views[0].observations.pixels.col(1), Eigen::Vector2d(50, 20));
}

TEST(ViewsTest, TheMountOfAnEyeInHandCameraIsTheGripper) {
  RunConfig config = ConfigOf({DetectionOf(640, 480, {0})});
  config.setup = Setup::kEyeInHand;
  EXPECT_THAT(ViewOf(config, 0, {}).camera_mount_from_target_mount,
              IsNearPose(Inverse(config.captures[0].base_from_gripper), 1e-12, 1e-12));
}

TEST(OptionsOfTest, OptionsAreThoseOfTheConfig) {
  RunConfig config = ConfigOf({DetectionOf(640, 480)});
  config.setup = Setup::kEyeInHand;
  config.methods = {"park"};
  config.seed = "park";
  config.bundle.loss = "huber";
  config.choose.robot_noise = true;
  config.camera_model = "brown5";
  const CalibrationOptions options = OptionsOf(config, 640, 480);
  EXPECT_EQ(options.setup, Setup::kEyeInHand);
  EXPECT_THAT(options.methods, ElementsAre("park"));
  EXPECT_EQ(options.seed, "park");
  EXPECT_EQ(options.bundle.loss, "huber");
  EXPECT_TRUE(options.choose.robot_noise);
  EXPECT_EQ(options.camera_model, "brown5");
  EXPECT_EQ(options.width_px, 640);
  EXPECT_EQ(options.height_px, 480);
  EXPECT_FALSE(options.camera.has_value());
  // Three rows and four columns of corners have no symmetry.
  EXPECT_THAT(options.symmetries, SizeIs(1));
  EXPECT_NEAR(options.shape.half_size_m.x(), 0.03, 1e-12);
  EXPECT_NEAR(options.shape.half_size_m.y(), 0.02, 1e-12);
}

}  // namespace
}  // namespace heba
