#include "tools/run/captures.h"

#include <cstdlib>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "heba/base/units.h"
#include "heba/image_detection.h"
#include "tests/support/input_error.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

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

// Returns a data set of captures whose detections are given.
PairDataset DatasetOf(const std::vector<CaptureDetection>& detections) {
  PairDataset dataset;
  dataset.target = ParseTarget(kTarget);
  dataset.given_detections = detections;
  dataset.detections_source = "detections.json";
  dataset.camera_source = "camera.yaml";
  for (size_t i = 0; i < detections.size(); ++i) {
    const Rigid3d base_from_gripper(ExpRotation({0.1, 0, 0}), {static_cast<double>(i), 0, 1});
    dataset.captures.push_back(
        {std::to_string(i) + ".png", "", i == 0 ? CaptureRole::kHome : CaptureRole::kRotate, base_from_gripper});
  }
  return dataset;
}

TEST(DetectCapturesTest, GivenDetectionsAreReturnedAsTheyAre) {
  const PairDataset dataset = DatasetOf({DetectionOf(640, 480, {0, 1}), DetectionOf(640, 480)});
  const std::vector<CaptureDetection> detections = DetectCaptures(dataset, {}, 1, nullptr);
  ASSERT_THAT(detections, SizeIs(2));
  EXPECT_THAT(detections[0].detection.ids, ElementsAre(0, 1));
}

TEST(DetectCapturesTest, AnUnknownSizeIsThatOfTheCamera) {
  PairDataset dataset = DatasetOf({DetectionOf(0, 0, {0})});
  EXPECT_THAT(InputErrorOf([&] { DetectCaptures(dataset, {}, 1, nullptr); }),
              HasSubstr("detections.json: does not state the image size; provide a camera that does"));
  dataset.camera = Camera{"pinhole", 800, 600, {600, 600, 400, 300}};
  EXPECT_EQ(DetectCaptures(dataset, {}, 1, nullptr).at(0).width_px, 800);
  EXPECT_EQ(DetectCaptures(dataset, {}, 1, nullptr).at(0).height_px, 600);
}

TEST(DetectCapturesTest, AllImagesHaveOneSize) {
  EXPECT_THAT(InputErrorOf([] {
                DetectCaptures(DatasetOf({DetectionOf(640, 480), DetectionOf(640, 480), DetectionOf(640, 481)}), {}, 1,
                               nullptr);
              }),
              HasSubstr("2.png: is 640 x 481 px, but 0.png is 640 x 480 px; all images must come from one camera"));
}

TEST(FitCameraToImagesTest, FillsInASizeThatTheFileDoesNotState) {
  PairDataset dataset = DatasetOf({DetectionOf(640, 480)});
  FitCameraToImages({DetectionOf(640, 480)}, &dataset);
  EXPECT_FALSE(dataset.camera.has_value());
  dataset.camera = Camera{"pinhole", 0, 0, {600, 600, 320, 240}};
  FitCameraToImages({DetectionOf(640, 480)}, &dataset);
  EXPECT_EQ(dataset.camera->width_px, 640);
  EXPECT_EQ(dataset.camera->height_px, 480);
}

TEST(FitCameraToImagesTest, RefusesTheCameraOfAnotherSize) {
  PairDataset dataset = DatasetOf({DetectionOf(640, 480)});
  dataset.camera = Camera{"pinhole", 640, 400, {600, 600, 320, 200}};
  EXPECT_EQ(InputErrorOf([&] { FitCameraToImages({DetectionOf(640, 480)}, &dataset); }),
            "camera.yaml: is for images of 640 x 400 px, but 0.png is 640 x 480 px; provide the intrinsics of that "
            "resolution");
}

TEST(CheckCamerasByHeaderTest, TheHeaderOfTheFirstImageShowsTheWrongCamera) {
  const TempFolder folder;
  cv::imwrite((folder / "empty.png").string(), cv::Mat(48, 64, CV_8UC1, cv::Scalar(128)));
  PairDataset dataset = DatasetOf({DetectionOf(64, 48)});
  dataset.given_detections.clear();
  dataset.captures[0].image = folder / "empty.png";
  dataset.camera = Camera{"pinhole", 0, 0, {600, 600, 32, 24}};
  CheckCamerasByHeader(AsDataset(dataset));
  EXPECT_EQ(dataset.camera->width_px, 0);
  dataset.camera->width_px = dataset.camera->height_px = 64;
  EXPECT_THAT(InputErrorOf([&] { CheckCamerasByHeader(AsDataset(dataset)); }),
              HasSubstr("is for images of 64 x 64 px, but 0.png is 64 x 48 px"));
  // The images are searched all the same: the doctor names the fault of the camera.
  const DetectFunction detect = [](const std::filesystem::path&, const std::optional<ImageSize>&) {
    return DetectionOf(64, 48);
  };
  EXPECT_THAT(DetectCaptures(dataset, detect, 1, nullptr), SizeIs(1));
}

TEST(ViewsTest, ViewsAreThoseOfTheCapturesInWhichTheTargetWasSeen) {
  PairDataset dataset = DatasetOf({DetectionOf(640, 480), DetectionOf(640, 480, {0, 5})});
  const std::vector<View> views = ViewsOf(dataset, dataset.given_detections);
  ASSERT_THAT(views, SizeIs(1));
  EXPECT_EQ(views[0].name, "1.png");
  EXPECT_EQ(views[0].role, CaptureRole::kRotate);
  EXPECT_THAT(views[0].camera_mount_from_target_mount, IsNearPose(dataset.captures[1].base_from_gripper, 1e-12, 1e-12));
  EXPECT_THAT(views[0].observations.ids, ElementsAre(0, 5));
  // Point 5 is the second one of the second row.
  EXPECT_NEAR((views[0].observations.points_in_target.col(1) - Eigen::Vector3d(0.02, 0.02, 0)).norm(), 0, 1e-12);
  EXPECT_EQ(views[0].observations.pixels.col(1), Eigen::Vector2d(50, 20));
}

TEST(ViewsTest, TheMountOfAnEyeInHandCameraIsTheGripper) {
  PairDataset dataset = DatasetOf({DetectionOf(640, 480, {0})});
  dataset.setup = Setup::kEyeInHand;
  EXPECT_THAT(ViewOf(dataset, 0, {}).camera_mount_from_target_mount,
              IsNearPose(Inverse(dataset.captures[0].base_from_gripper), 1e-12, 1e-12));
}

TEST(OptionsOfTest, OptionsAreThoseOfTheRun) {
  PairDataset dataset = DatasetOf({DetectionOf(640, 480)});
  PairRunOptions run;
  dataset.setup = Setup::kEyeInHand;
  run.methods = {"park"};
  run.seed = "park";
  run.bundle.loss = LossKind::kHuber;
  run.choose.robot_noise = true;
  run.camera_model = "brown5";
  const PairCalibrationOptions options = OptionsOf(dataset, run, 640, 480);
  EXPECT_EQ(options.setup, Setup::kEyeInHand);
  EXPECT_THAT(options.methods, ElementsAre("park"));
  EXPECT_EQ(options.seed, "park");
  EXPECT_EQ(options.bundle.loss, LossKind::kHuber);
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
