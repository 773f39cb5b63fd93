#include "tools/run/captures.h"

#include <cstdlib>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "heba/base/units.h"
#include "heba/image_detection.h"
#include "heba/run.h"
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

// Returns a data set of captures whose detections are given, one each.
Dataset DatasetOf(const std::vector<CaptureDetection>& detections, Setup setup = Setup::kEyeToHand) {
  Dataset dataset = DatasetOf(setup, ParseTarget(kTarget));
  dataset.detections_source = "detections.json";
  dataset.camera_sources = {"camera.yaml"};
  for (size_t i = 0; i < detections.size(); ++i) {
    const Rigid3d base_from_gripper(ExpRotation({0.1, 0, 0}), {static_cast<double>(i), 0, 1});
    const std::string name = std::to_string(i) + ".png";
    dataset.captures.push_back(
        {name, {base_from_gripper}, {name}, {}, i == 0 ? CaptureRole::kHome : CaptureRole::kRotate});
    dataset.given_detections.push_back({i, 0, 0, detections[i]});
  }
  return dataset;
}

void SetCamera(const Camera& camera, Dataset* dataset) {
  dataset->has_camera = {true};
  dataset->rig.cameras[0].camera = camera;
}

std::vector<TargetDetection> Detect(const Dataset& dataset) { return DetectDataset(dataset, {}, 1, nullptr); }

TEST(DetectDatasetTest, GivenDetectionsAreReturnedAsTheyAre) {
  const std::vector<TargetDetection> detections =
      Detect(DatasetOf({DetectionOf(640, 480, {0, 1}), DetectionOf(640, 480)}));
  ASSERT_THAT(detections, SizeIs(2));
  EXPECT_THAT(detections[0].detection.detection.ids, ElementsAre(0, 1));
}

TEST(DetectDatasetTest, AnUnknownSizeIsThatOfTheCamera) {
  Dataset dataset = DatasetOf({DetectionOf(0, 0, {0})});
  EXPECT_FALSE(IsImageSizeKnown(dataset));
  EXPECT_THAT(InputErrorOf([&] { Detect(dataset); }),
              HasSubstr("detections.json: does not state the image size; provide a camera that does"));
  SetCamera({"pinhole", 800, 600, {600, 600, 400, 300}}, &dataset);
  EXPECT_TRUE(IsImageSizeKnown(dataset));
  EXPECT_EQ(Detect(dataset).at(0).detection.width_px, 800);
  EXPECT_EQ(Detect(dataset).at(0).detection.height_px, 600);
}

TEST(DetectDatasetTest, AllImagesHaveOneSize) {
  EXPECT_THAT(InputErrorOf([] {
                Detect(DatasetOf({DetectionOf(640, 480), DetectionOf(640, 480), DetectionOf(640, 481)}));
              }),
              HasSubstr("2.png: is 640 x 481 px, but 0.png is 640 x 480 px; all images must come from one camera"));
}

TEST(RigOfImagesTest, FillsInASizeThatTheFileDoesNotState) {
  Dataset dataset = DatasetOf({DetectionOf(640, 480)});
  SetCamera({"pinhole", 0, 0, {600, 600, 320, 240}}, &dataset);
  const Problem rig = WithImageSizes(dataset, dataset.given_detections);
  EXPECT_EQ(rig.cameras[0].camera.width_px, 640);
  EXPECT_EQ(rig.cameras[0].camera.height_px, 480);
}

TEST(RigOfImagesTest, RefusesTheCameraOfAnotherSize) {
  Dataset dataset = DatasetOf({DetectionOf(640, 480)});
  SetCamera({"pinhole", 640, 400, {600, 600, 320, 200}}, &dataset);
  EXPECT_EQ(InputErrorOf([&] { WithImageSizes(dataset, dataset.given_detections); }),
            "camera.yaml: is for images of 640 x 400 px, but 0.png is 640 x 480 px; provide the intrinsics of that "
            "resolution");
}

TEST(CheckCamerasByHeaderTest, TheHeaderOfTheFirstImageShowsTheWrongCamera) {
  const TempFolder folder;
  cv::imwrite((folder / "empty.png").string(), cv::Mat(48, 64, CV_8UC1, cv::Scalar(128)));
  Dataset dataset = DatasetOf({DetectionOf(64, 48)});
  dataset.given_detections.clear();
  dataset.captures[0].images = {folder / "empty.png"};
  SetCamera({"pinhole", 0, 0, {600, 600, 32, 24}}, &dataset);
  CheckCamerasByHeader(dataset);
  EXPECT_EQ(dataset.rig.cameras[0].camera.width_px, 0);
  SetCamera({"pinhole", 64, 64, {600, 600, 32, 24}}, &dataset);
  EXPECT_THAT(InputErrorOf([&] { CheckCamerasByHeader(dataset); }),
              HasSubstr("is for images of 64 x 64 px, but 0.png is 64 x 48 px"));
  // The images are searched all the same: the doctor names the fault of the camera.
  const DetectFunction detect = [](const std::filesystem::path&, const std::optional<ImageSize>&) {
    return DetectionOf(64, 48);
  };
  EXPECT_THAT(DetectDataset(dataset, {detect}, 1, nullptr), SizeIs(1));
}

TEST(WithoutCapturesTest, LeavesOutTheirPosesAndDetections) {
  Dataset dataset = DatasetOf({DetectionOf(640, 480, {0}), DetectionOf(640, 480, {1}), DetectionOf(640, 480, {2})});
  dataset.target_poses = {Rigid3d(), Rigid3d(), Rigid3d(Eigen::Quaterniond::Identity(), {1, 2, 3})};
  const Dataset rest = WithoutCaptures(dataset, {{1, "it is wrong"}});
  ASSERT_THAT(rest.captures, SizeIs(2));
  EXPECT_EQ(rest.captures[1].name, "2.png");
  ASSERT_THAT(rest.given_detections, SizeIs(2));
  EXPECT_EQ(rest.given_detections[1].capture, 1U);
  EXPECT_THAT(rest.given_detections[1].detection.detection.ids, ElementsAre(2));
  ASSERT_THAT(rest.target_poses, SizeIs(2));
  EXPECT_EQ(rest.target_poses[1].translation.z(), 3);
  ASSERT_THAT(rest.left_out, SizeIs(1));
  EXPECT_EQ(rest.left_out[0].capture, "1.png");
  EXPECT_EQ(rest.left_out[0].reason, "it is wrong");
}

TEST(ViewsTest, ViewsAreThoseOfTheCapturesInWhichTheTargetWasSeen) {
  const Dataset dataset = DatasetOf({DetectionOf(640, 480), DetectionOf(640, 480, {0, 5})});
  const std::vector<View> views = ViewsOf(dataset, dataset.given_detections);
  ASSERT_THAT(views, SizeIs(1));
  EXPECT_EQ(views[0].name, "1.png");
  EXPECT_EQ(views[0].capture, 1U);
  EXPECT_EQ(views[0].role, CaptureRole::kRotate);
  EXPECT_THAT(views[0].camera_mount_from_target_mount,
              IsNearPose(dataset.captures[1].base_from_gripper[0], 1e-12, 1e-12));
  EXPECT_THAT(views[0].observations.ids, ElementsAre(0, 5));
  // Point 5 is the second one of the second row.
  EXPECT_NEAR((views[0].observations.points_in_target.col(1) - Eigen::Vector3d(0.02, 0.02, 0)).norm(), 0, 1e-12);
  EXPECT_EQ(views[0].observations.pixels.col(1), Eigen::Vector2d(50, 20));
}

TEST(ViewsTest, TheMountOfAnEyeInHandCameraIsTheGripper) {
  const Dataset dataset = DatasetOf({DetectionOf(640, 480, {0})}, Setup::kEyeInHand);
  EXPECT_THAT(ViewOf(dataset, 0, {}).camera_mount_from_target_mount,
              IsNearPose(Inverse(dataset.captures[0].base_from_gripper[0]), 1e-12, 1e-12));
}

TEST(OptionsOfTest, OptionsAreThoseOfTheRun) {
  Dataset dataset = DatasetOf({DetectionOf(640, 480)}, Setup::kEyeInHand);
  dataset.rig.cameras[0].camera = {"brown5", 640, 480, {}};
  RunOptions run;
  run.methods = {"park"};
  run.seed = "park";
  run.calibration.adjustment.loss = LossKind::kHuber;
  const PairCalibrationOptions options = OptionsOf(dataset, run);
  EXPECT_EQ(options.setup, Setup::kEyeInHand);
  EXPECT_THAT(options.methods, ElementsAre("park"));
  EXPECT_EQ(options.seed, "park");
  EXPECT_EQ(options.bundle.loss, LossKind::kHuber);
  EXPECT_TRUE(options.choose.robot_noise);
  EXPECT_EQ(options.camera_model, "brown5");
  EXPECT_FALSE(options.choose_camera_model);
  EXPECT_EQ(options.width_px, 640);
  EXPECT_EQ(options.height_px, 480);
  EXPECT_FALSE(options.camera.has_value());
  // Three rows and four columns of corners have no symmetry.
  EXPECT_THAT(options.symmetries, SizeIs(1));
  EXPECT_NEAR(options.shape.half_size_m.x(), 0.03, 1e-12);
  EXPECT_NEAR(options.shape.half_size_m.y(), 0.02, 1e-12);
}

// The noise of the robot is chosen unless the run says more of it than that it is to be estimated.
TEST(OptionsOfTest, TheNoiseOfTheRobotIsChosenUnlessMoreIsSaid) {
  using Robot = BundleOptions::Robot;
  const Dataset dataset = DatasetOf({DetectionOf(640, 480)});
  const auto options_of = [&](const auto& change) {
    RunOptions run;
    change(&run);
    return OptionsOf(dataset, run);
  };
  EXPECT_TRUE(options_of([](RunOptions*) {}).choose.robot_noise);
  EXPECT_TRUE(options_of([](RunOptions*) {}).choose_camera_model);
  const PairCalibrationOptions exact =
      options_of([](RunOptions* run) { run->calibration.adjustment.robot = Robot::kExact; });
  EXPECT_FALSE(exact.choose.robot_noise);
  EXPECT_EQ(exact.bundle.robot, Robot::kExact);
  const PairCalibrationOptions smooth =
      options_of([](RunOptions* run) { run->calibration.smooth = SmoothPoseErrors::kAlways; });
  EXPECT_FALSE(smooth.choose.robot_noise);
  EXPECT_EQ(smooth.bundle.robot, Robot::kEstimatedNoise);
  EXPECT_FALSE(options_of([](RunOptions* run) { run->joint_noise = true; }).choose.robot_noise);
  const PairCalibrationOptions known = options_of([](RunOptions* run) {
    run->calibration.adjustment.robot_noise_prior = RobotNoisePrior{{1e-4, 1e-4}, 0.3};
  });
  EXPECT_FALSE(known.choose.robot_noise);
  EXPECT_TRUE(known.bundle.robot_noise_prior.has_value());
}

}  // namespace
}  // namespace heba
