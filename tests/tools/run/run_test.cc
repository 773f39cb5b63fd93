// Tests of heba/run.h.
#include "heba/run.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/rng.h"
#include "heba/base/units.h"
#include "heba/config/yaml_reader.h"
#include "heba/data/prediction.h"
#include "tests/support/input_error.h"
#include "tests/support/matchers.h"

namespace heba {
namespace {
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;

const HandEye kHandEye = {Rigid3d(ExpRotation({0.1, -0.2, 0.3}), {0.05, -0.02, 0.1}),
                          Rigid3d(ExpRotation({0.2, 0.1, -0.3}), {0.6, 0.1, 0.02})};

// Returns the captures of a carried camera with their detections, with a noise of 0.1 px.
Dataset SimulatedDataset() {
  Dataset dataset;
  dataset.name = "cell";
  dataset.setup = Setup::kEyeInHand;
  MapReader reader(ParseYaml("{type: chessboard, rows: 6, columns: 9, square: 20 mm}", "target.yaml"));
  dataset.target = CreateTarget(reader);
  dataset.camera = Camera{"pinhole", 1280, 960, {1000, 1000, 640, 480}};
  const Observations points = AllPoints(*dataset.target);
  Rng rng(5);
  for (int i = 0; i < 14; ++i) {
    const auto uniform = [&] { return 2 * rng.Uniform() - 1; };
    const Rigid3d camera_from_target(ExpRotation({0.4 * uniform(), 0.4 * uniform(), uniform()}),
                                     {-0.08 + 0.03 * uniform(), -0.05 + 0.03 * uniform(), 0.5 + 0.1 * uniform()});
    // M of an eye-in-hand camera is gripper_from_base.
    const Rigid3d gripper_from_base =
        kHandEye.camera_mount_from_camera * camera_from_target * Inverse(kHandEye.target_mount_from_target);
    const std::string name = std::to_string(i) + ".png";
    dataset.captures.push_back({name, "", {}, Inverse(gripper_from_base)});
    CaptureDetection detection;
    detection.width_px = 1280;
    detection.height_px = 960;
    for (Eigen::Index k = 0; k < points.size(); ++k) {
      const Eigen::Vector3d in_camera = camera_from_target * Eigen::Vector3d(points.points_in_target.col(k));
      const std::optional<Eigen::Vector2d> pixel = ProjectPoint(*dataset.camera, in_camera);
      detection.detection.ids.push_back(points.ids[static_cast<size_t>(k)]);
      detection.detection.pixels.push_back(*pixel + 0.1 * Eigen::Vector2d(rng.Normal(), rng.Normal()));
    }
    detection.image_digest = name;
    dataset.given_detections.push_back(std::move(detection));
  }
  return dataset;
}

RunOptions FixedCamera() {
  RunOptions options;
  options.bundle.free_intrinsics = {};
  return options;
}

// Writes down what it is told.
class Recorder : public RunObserver {
 public:
  void OnStage(RunStage stage, int total) override {
    events.push_back("stage " + std::to_string(static_cast<int>(stage)) + " of " + std::to_string(total));
  }
  void OnStep(RunStage /*stage*/) override { ++num_steps; }
  void OnStageEnd(RunStage stage) override { events.push_back("end " + std::to_string(static_cast<int>(stage))); }
  void OnDetected(const LeftOutCaptures& left_out, int num_seen, int num_images) override {
    events.push_back("seen " + std::to_string(num_seen) + " of " + std::to_string(num_images) + ", left out " +
                     std::to_string(left_out.indices.size()));
  }
  void OnCalibrated(const Calibration& calibration) override {
    events.emplace_back(calibration.refined ? "calibrated" : "failed");
  }
  void OnHoldOuts(const std::vector<HoldOut>& hold_outs) override {
    events.emplace_back(hold_outs.empty() ? "no hold-outs" : "hold-outs");
  }
  bool IsCancelled() override { return num_steps >= cancel_after; }

  std::vector<std::string> events;
  int num_steps = 0;
  int cancel_after = 1000;
};

TEST(RunTest, FindsTheHandEyePoseAndItsErrors) {
  Dataset dataset = SimulatedDataset();
  dataset.truth = Truth{kHandEye.camera_mount_from_camera, kHandEye.target_mount_from_target, dataset.camera};
  const Outcome<RunOutput> run = heba::Run(dataset, FixedCamera());
  ASSERT_TRUE(run.ok()) << run.reason();
  const Estimate* const refined = FindRefined(run->result);
  ASSERT_NE(refined, nullptr);
  EXPECT_THAT(refined->hand_eye.camera_mount_from_camera, IsNearPose(kHandEye.camera_mount_from_camera, 5e-4, 1e-3));
  ASSERT_TRUE(refined->errors.truth.has_value());
  EXPECT_LT(refined->errors.truth->hand_eye_mm, 0.5);
  EXPECT_GT(refined->errors.truth->hand_eye_mm, 0);
  ASSERT_TRUE(refined->errors.holdout_rms_px.has_value());
  EXPECT_NEAR(*refined->errors.holdout_rms_px, 0.141, 0.02);  // 0.1 px in each of two coordinates.
  EXPECT_EQ(run->result.name, "cell");
  EXPECT_THAT(run->result.captures, SizeIs(14));
  EXPECT_FALSE(run->result.verdict.findings.empty());
  EXPECT_GT(run->result.timing.total_s, 0);
}

TEST(RunTest, TellsItsObserverWhatItDoes) {
  Recorder recorder;
  RunOptions options = FixedCamera();
  options.folds = 4;
  ASSERT_TRUE(heba::Run(SimulatedDataset(), options, &recorder).ok());
  EXPECT_THAT(recorder.events,
              ElementsAre("seen 14 of 14, left out 0", "calibrated", "stage 2 of 4", "end 2", "hold-outs"));
  EXPECT_EQ(recorder.num_steps, 4);
}

TEST(RunTest, EndsWhenItIsCancelled) {
  Recorder recorder;
  recorder.cancel_after = 2;
  const Outcome<RunOutput> run = heba::Run(SimulatedDataset(), FixedCamera(), &recorder);
  EXPECT_FALSE(run.ok());
  EXPECT_EQ(run.reason(), kCancelled);
  EXPECT_THAT(recorder.events, Not(testing::Contains("hold-outs")));
  recorder.cancel_after = 0;
  recorder.events.clear();
  EXPECT_EQ(heba::Run(SimulatedDataset(), FixedCamera(), &recorder).reason(), kCancelled);
  EXPECT_THAT(recorder.events, Not(testing::Contains("calibrated")));
}

TEST(RunTest, CapturesWithOneImageCountOnce) {
  Dataset dataset = SimulatedDataset();
  dataset.captures.push_back(dataset.captures[3]);
  dataset.captures.back().name = "again.png";
  dataset.given_detections.push_back(dataset.given_detections[3]);
  Recorder recorder;
  const Outcome<RunOutput> run = heba::Run(dataset, FixedCamera(), &recorder);
  ASSERT_TRUE(run.ok()) << run.reason();
  EXPECT_EQ(recorder.events.front(), "seen 14 of 14, left out 1");
  EXPECT_THAT(run->result.captures, SizeIs(15));
  EXPECT_EQ(run->result.captures.back().repeat_of, "3.png");
  EXPECT_THAT(run->dataset.captures, SizeIs(14));
  EXPECT_THAT(run->detections, SizeIs(14));
}

TEST(RunTest, CalibratesFromPosesOfTheTarget) {
  Dataset dataset = SimulatedDataset();
  for (const Capture& capture : dataset.captures) {
    dataset.target_poses.push_back(
        CameraFromTarget(kHandEye, CameraMountFromTargetMount(dataset.setup, capture.base_from_gripper)));
  }
  dataset.given_detections.clear();
  dataset.camera.reset();
  dataset.target.reset();
  const Outcome<RunOutput> run = heba::Run(dataset, RunOptions());
  ASSERT_TRUE(run.ok()) << run.reason();
  ASSERT_TRUE(run->calibration.chain.ok());
  EXPECT_THAT(run->calibration.chain->hand_eye.camera_mount_from_camera,
              IsNearPose(kHandEye.camera_mount_from_camera, 1e-7, 1e-7));
  EXPECT_THAT(run->detections, SizeIs(0));
}

TEST(RunTest, FailsWhereNothingWasDetected) {
  Dataset dataset = SimulatedDataset();
  for (CaptureDetection& capture : dataset.given_detections) capture.detection = {};
  EXPECT_THAT(heba::Run(dataset, FixedCamera()).reason(), HasSubstr("not detected in any of the 14 images"));
}

TEST(RunTest, RefusesACameraOfAnotherSize) {
  Dataset dataset = SimulatedDataset();
  dataset.camera->width_px = 640;
  EXPECT_THAT(InputErrorOf([&] { (void)heba::Run(dataset, FixedCamera()); }),
              HasSubstr("camera: is for images of 640 x 960 px"));
}

}  // namespace
}  // namespace heba
