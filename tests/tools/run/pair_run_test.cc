// Tests of runs of one camera, one target and one arm: heba/run.h.
#include "heba/run.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/rng.h"
#include "heba/base/units.h"
#include "heba/displaced_target.h"
#include "tests/support/datasets.h"
#include "tests/support/input_error.h"
#include "tests/support/matchers.h"

namespace heba {
namespace {
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Matcher;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::Truly;

// A carried camera, with a noise of 0.1 px.
TestSceneOptions SimulatedOptions(const Target& target) {
  TestSceneOptions options;
  options.setup = Setup::kEyeInHand;
  options.camera = {"pinhole", 1280, 960, {1000, 1000, 640, 480}};
  options.num_captures = 14;
  options.noise_px = 0.1;
  options.points = AllPoints(target).points_in_target;
  return options;
}

TestScene SimulatedScene(const Target& target) { return MakeTestScene(5, SimulatedOptions(target)); }

std::shared_ptr<const Target> Chessboard() {
  return ParseTarget("{type: chessboard, rows: 6, columns: 9, square: 20 mm}");
}

// Returns the data set of a scene, with images named 0.png, 1.png, ... that have different digests.
Dataset NamedDatasetOf(const TestScene& scene, const std::shared_ptr<const Target>& target) {
  Dataset dataset = DatasetOf(scene, Setup::kEyeInHand, target);
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    dataset.captures[i].name = dataset.given_detections[i].detection.image_digest = std::to_string(i) + ".png";
    dataset.captures[i].images = {dataset.captures[i].name};
  }
  return dataset;
}

// Returns a data set whose camera is taken as it is given.
Dataset SimulatedDataset() {
  const std::shared_ptr<const Target> target = Chessboard();
  return WithFixedCamera(NamedDatasetOf(SimulatedScene(*target), target));
}

HandEye TrueHandEye() { return SimulatedScene(*Chessboard()).hand_eye; }

// Writes down what it is told.
class Recorder : public RunObserver {
 public:
  void OnStage(RunStage stage, int total) override {
    events.push_back("stage " + std::to_string(static_cast<int>(stage)) + " of " + std::to_string(total));
  }
  void OnStep(RunStage /*stage*/) override { ++num_steps; }
  void OnStageEnd(RunStage stage) override { events.push_back("end " + std::to_string(static_cast<int>(stage))); }
  void OnDetected(const std::vector<std::string>& notes, int num_seen, int num_images) override {
    events.push_back("seen " + std::to_string(num_seen) + " of " + std::to_string(num_images) + ", notes " +
                     std::to_string(notes.size()));
  }
  void OnCalibrated(const PairCalibration& calibration) override {
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

// The camera is moved by 4 mm on the gripper after 12 of 20 captures.
TEST(PairRunTest, LeavesOutTheCapturesBesideAMotionOfTheCamera) {
  constexpr size_t kFirstAfter = 12;
  const std::shared_ptr<const Target> target = Chessboard();
  TestSceneOptions scene_options = SimulatedOptions(*target);
  scene_options.num_captures = 20;
  const TestScene scene = MakeTestScene(5, scene_options);
  Dataset dataset = WithFixedCamera(NamedDatasetOf(scene, target));
  const RunOptions options = WithoutFolds();
  const Outcome<RunOutput> still = heba::Run(dataset, options);
  ASSERT_TRUE(still.ok()) << still.reason();
  EXPECT_THAT(still->result.verdict.findings,
              Each(Truly([](const Finding& finding) { return finding.code != "camera_moved"; })));

  // The images are the same if the gripper is where the motion is undone.
  const Rigid3d motion(ExpRotation({0, 0.002, 0}), {0.004, 0, 0});
  for (size_t i = kFirstAfter; i < dataset.captures.size(); ++i) {
    Rigid3d& pose = dataset.captures[i].base_from_gripper.front();
    pose = pose * Inverse(motion);
  }
  const Outcome<RunOutput> moved = heba::Run(dataset, options);
  ASSERT_TRUE(moved.ok()) << moved.reason();
  const RunResult& result = moved->result;
  EXPECT_EQ(result.verdict.grade, Grade::kBad);
  ASSERT_FALSE(result.verdict.findings.empty());
  const Finding& finding = result.verdict.findings.front();
  EXPECT_EQ(finding.code, "camera_moved");
  EXPECT_EQ(finding.Name("last_capture"), "11.png");
  EXPECT_EQ(finding.Name("first_capture"), "12.png");
  EXPECT_NEAR(finding.Number("moved_mm").value_or(0), 4, 0.3);
  EXPECT_NEAR(finding.Number("moved_deg").value_or(0), RadToDeg(0.002), 0.02);
  EXPECT_LT((FindRefined(result)->hand_eye.camera_mount_from_camera.translation -
             scene.hand_eye.camera_mount_from_camera.translation)
                .norm(),
            2e-4);
  for (size_t i = 0; i < result.images.size(); ++i) {
    EXPECT_EQ(result.images[i].used, i < kFirstAfter) << i;
    const Matcher<std::string> expected = i < kFirstAfter ? Matcher<std::string>("") : HasSubstr("moved before");
    EXPECT_THAT(result.images[i].reason, expected);
  }
}

TEST(PairRunTest, FindsTheHandEyePoseAndItsErrors) {
  Dataset dataset = SimulatedDataset();
  dataset.truth = CellTruth{{TrueHandEye().camera_mount_from_camera},
                            {TrueHandEye().target_mount_from_target},
                            {Rigid3d()},
                            {dataset.rig.cameras[0].camera}};
  const Outcome<RunOutput> run = heba::Run(dataset, RunOptions());
  ASSERT_TRUE(run.ok()) << run.reason();
  const Estimate* const refined = FindRefined(run->result);
  ASSERT_NE(refined, nullptr);
  EXPECT_THAT(refined->hand_eye.camera_mount_from_camera,
              IsNearPose(TrueHandEye().camera_mount_from_camera, 5e-4, 1e-3));
  ASSERT_TRUE(refined->errors.truth.has_value());
  EXPECT_LT(refined->errors.truth->hand_eye_mm, 0.5);
  EXPECT_GT(refined->errors.truth->hand_eye_mm, 0);
  ASSERT_TRUE(refined->errors.holdout_rms_px.has_value());
  EXPECT_NEAR(*refined->errors.holdout_rms_px, 0.141, 0.02);  // 0.1 px in each of two coordinates.
  EXPECT_EQ(run->result.name, "cell");
  EXPECT_THAT(run->result.images, SizeIs(14));
  EXPECT_FALSE(run->result.verdict.findings.empty());
  EXPECT_GT(run->result.timing.total_s, 0);
}

TEST(PairRunTest, TellsItsObserverWhatItDoes) {
  Recorder recorder;
  RunOptions options;
  options.folds = 4;
  ASSERT_TRUE(heba::Run(SimulatedDataset(), options, &recorder).ok());
  EXPECT_THAT(recorder.events,
              ElementsAre("seen 14 of 14, notes 0", "calibrated", "stage 2 of 4", "end 2", "hold-outs"));
  EXPECT_EQ(recorder.num_steps, 4);
}

TEST(PairRunTest, EndsWhenItIsCancelled) {
  Recorder recorder;
  recorder.cancel_after = 2;
  const Outcome<RunOutput> run = heba::Run(SimulatedDataset(), RunOptions(), &recorder);
  EXPECT_FALSE(run.ok());
  EXPECT_EQ(run.failure().code, kCancelled);
  EXPECT_THAT(recorder.events, Not(testing::Contains("hold-outs")));
  recorder.cancel_after = 0;
  recorder.events.clear();
  EXPECT_EQ(heba::Run(SimulatedDataset(), RunOptions(), &recorder).failure().code, kCancelled);
  EXPECT_THAT(recorder.events, Not(testing::Contains("calibrated")));
}

// Every point of the board was printed beside its design.
TEST(PairRunTest, PointsOfTheTargetAreEstimatedIfTheyAreFree) {
  const std::shared_ptr<const Target> target = Chessboard();
  PointOffsets printed;
  Rng rng(2);
  for (const TargetPoint& point : target->points()) {
    printed[point.id] = 3e-4 * Eigen::Vector3d{rng.Normal(), rng.Normal(), rng.Normal()};
  }
  const TestScene scene = SimulatedScene(*Displaced(target, printed));
  Dataset dataset = WithFixedCamera(NamedDatasetOf(scene, target));
  RunOptions options = WithoutFolds();
  options.calibration.choose_target_shape = false;
  const Outcome<RunOutput> designed = heba::Run(dataset, options);
  ASSERT_TRUE(designed) << designed.reason();
  EXPECT_TRUE(designed->result.point_offsets.empty());
  dataset.rig.targets[0].free_shape = {TargetShapeGroup::kPoints};
  const Outcome<RunOutput> run = heba::Run(dataset, options);
  ASSERT_TRUE(run) << run.reason();
  ASSERT_THAT(run->result.point_offsets, SizeIs(1));
  EXPECT_THAT(run->result.point_offsets[0], SizeIs(target->points().size()));
  EXPECT_THAT(run->result.model.target_shape, ElementsAre("points"));
  const std::vector<Finding>& findings = run->result.verdict.findings;
  const auto found = std::find_if(findings.begin(), findings.end(),
                                  [](const Finding& finding) { return finding.code == "points_estimated"; });
  ASSERT_NE(found, findings.end());
  EXPECT_NEAR(*found->Number("sigma_mm"), 0.3, 0.08);
  // The pixels have the noise of the detector again.
  EXPECT_GT(FindRefined(designed->result)->solution->pixel_sigma_px, 0.25);
  EXPECT_NEAR(FindRefined(run->result)->solution->pixel_sigma_px, 0.1, 0.02);
}

// The target of this cell was entered 1.2 % too large, as if it had been measured to .1 %.
struct EnteredTooLarge {
  TestScene scene;
  Dataset dataset;
};

EnteredTooLarge MakeEnteredTooLarge() {
  TestSceneOptions options = SimulatedOptions(*Chessboard());
  options.robot_translation_m = 5e-5;
  options.robot_rotation_rad = 1e-4;
  const TestScene scene = MakeTestScene(6, options);
  const std::shared_ptr<const Target> larger =
      ParseTarget("{type: chessboard, rows: 6, columns: 9, square: 20.24 mm, scale_sigma: 0.1 %}");
  return {scene, WithFixedCamera(NamedDatasetOf(scene, larger))};
}

// The wrong size is named and not taken for errors of the robot, which follow the pose smoothly.
TEST(PairRunTest, SizeThatContradictsItsStatedSigmaIsNamed) {
  const auto [scene, dataset] = MakeEnteredTooLarge();
  const Outcome<RunOutput> run = heba::Run(dataset, WithoutFolds());
  ASSERT_TRUE(run) << run.reason();
  const std::vector<Finding>& findings = run->result.verdict.findings;
  const auto found = std::find_if(findings.begin(), findings.end(),
                                  [](const Finding& finding) { return finding.code == "target_scale"; });
  ASSERT_NE(found, findings.end());
  EXPECT_NE(found->grade, Grade::kGood);
  EXPECT_NEAR(*found->Number("scale_x"), 1 / 1.012, 2e-3);
  EXPECT_THAT(FindRefined(run->result)->hand_eye.camera_mount_from_camera,
              IsNearPose(scene.hand_eye.camera_mount_from_camera, 5e-4, 1e-3));
}

// If the lengths of the robot are known less well than the target, the contradiction is one of the robot: the target
// keeps its size, and the sigma of the pose contains the doubt.
TEST(PairRunTest, SizeIsBelievedBesideARobotOfUnknownLengths) {
  auto [scene, dataset] = MakeEnteredTooLarge();
  dataset.robot_scale_sigmas = {0.01};
  const Outcome<RunOutput> run = heba::Run(dataset, WithoutFolds());
  ASSERT_TRUE(run) << run.reason();
  const Solution& solution = run->result.solution;
  EXPECT_NEAR(solution.shapes[0].params[0], 1, 3e-3);
  const double error_m = DistanceM(solution.poses.mount_from_camera[0], scene.hand_eye.camera_mount_from_camera);
  EXPECT_GT(error_m, 2e-3);
  const auto covariance = PoseCovarianceOf(solution.covariance, CameraPoseBlock(run->result.rig.cameras[0]));
  ASSERT_TRUE(covariance.has_value());
  EXPECT_LT(error_m, 2.5 * std::sqrt(covariance->topLeftCorner<3, 3>().trace()));
}

TEST(PairRunTest, PointsOfASymmetricTargetAreRefused) {
  Dataset dataset = SimulatedDataset();
  dataset.targets = {ParseTarget("{type: chessboard, rows: 7, columns: 9, square: 20 mm}")};
  dataset.given_detections.front().detection.detection.ids.clear();
  dataset.given_detections.front().detection.detection.pixels.clear();
  dataset.rig.targets[0].free_shape = {TargetShapeGroup::kPoints};
  EXPECT_THAT(InputErrorOf([&] { (void)heba::Run(dataset, RunOptions()); }),
              HasSubstr("the target looks the same in several orientations"));
}

TEST(PairRunTest, CapturesWithOneImageCountOnce) {
  Dataset dataset = SimulatedDataset();
  dataset.given_detections.push_back({14, 0, 0, dataset.given_detections[3].detection});
  dataset.captures.push_back(dataset.captures[3]);
  dataset.captures.back().name = "again.png";
  dataset.captures.back().images = {"again.png"};
  Recorder recorder;
  const Outcome<RunOutput> run = heba::Run(dataset, RunOptions(), &recorder);
  ASSERT_TRUE(run.ok()) << run.reason();
  EXPECT_EQ(recorder.events.front(), "seen 14 of 14, notes 1");
  EXPECT_THAT(run->result.images, SizeIs(15));
  EXPECT_EQ(run->result.images.back().repeat_of, "3.png");
  EXPECT_EQ(run->result.images.back().reason, "the same image as 3.png, byte by byte");
  EXPECT_FALSE(run->result.images.back().used);
  EXPECT_EQ(NumUsedCaptures(run->result), 14);
}

TEST(PairRunTest, CalibratesFromPosesOfTheTarget) {
  Dataset dataset = SimulatedDataset();
  for (const Recording& capture : dataset.captures) {
    dataset.target_poses.push_back(CameraFromTarget(
        TrueHandEye(), CameraMountFromTargetMount(Setup::kEyeInHand, capture.base_from_gripper.front())));
  }
  dataset.given_detections.clear();
  dataset.has_camera = {false};
  dataset.targets = {nullptr};
  const Outcome<RunOutput> run = heba::Run(dataset, RunOptions());
  ASSERT_TRUE(run.ok()) << run.reason();
  ASSERT_TRUE(run->calibration.pairs[0].calibration->chain.ok());
  EXPECT_THAT(run->calibration.pairs[0].calibration->chain->hand_eye.camera_mount_from_camera,
              IsNearPose(TrueHandEye().camera_mount_from_camera, 1e-7, 1e-7));
  EXPECT_THAT(run->detections, SizeIs(0));
}

TEST(PairRunTest, WrongPosesOfTheTargetAreLeftOutAndNamed) {
  Dataset dataset = SimulatedDataset();
  for (const Recording& capture : dataset.captures) {
    dataset.target_poses.push_back(CameraFromTarget(
        TrueHandEye(), CameraMountFromTargetMount(Setup::kEyeInHand, capture.base_from_gripper.front())));
  }
  // One of the two poses of a flat target, turned.
  dataset.target_poses[6] = dataset.target_poses[6] * Rigid3d(ExpRotation({0.5, 0, 0}), Eigen::Vector3d::Zero());
  const Outcome<RunOutput> run = heba::Run(dataset, RunOptions());
  ASSERT_TRUE(run.ok()) << run.reason();
  EXPECT_THAT(run->calibration.pairs[0].calibration->chain->hand_eye.camera_mount_from_camera,
              IsNearPose(TrueHandEye().camera_mount_from_camera, 1e-7, 1e-7));
  ASSERT_THAT(run->result.images, SizeIs(14));
  for (size_t i = 0; i < 14; ++i) EXPECT_EQ(run->result.images[i].used, i != 6) << i;
  EXPECT_THAT(run->result.images[6].reason, HasSubstr("contradicts the other captures"));
  EXPECT_THAT(run->result.images[6].reason, HasSubstr("29 deg from where they predict it"));
}

// The ids of each row of the board count from its other end.
TEST(PairRunTest, MirroredIdsAreNamed) {
  Dataset dataset = SimulatedDataset();
  const std::vector<TargetPoint>& points = dataset.targets[0]->points();
  const auto mirrored = [&](int id) {
    const Eigen::Vector3d& at = points[static_cast<size_t>(id)].in_target;
    const Eigen::Vector3d other(points.front().in_target.x() + points.back().in_target.x() - at.x(), at.y(), 0);
    return std::find_if(points.begin(), points.end(),
                        [&](const TargetPoint& point) { return (point.in_target - other).norm() < 1e-6; })
        ->id;
  };
  const Outcome<RunOutput> right = heba::Run(dataset, WithoutFolds());
  for (TargetDetection& seen : dataset.given_detections) {
    for (int& id : seen.detection.detection.ids) id = mirrored(id);
  }
  const Outcome<RunOutput> turned = heba::Run(dataset, WithoutFolds());
  ASSERT_TRUE(right) << right.reason();
  ASSERT_TRUE(turned) << turned.reason();
  const auto names = [](const RunOutput& run) {
    const std::vector<Finding>& findings = run.result.verdict.findings;
    return std::any_of(findings.begin(), findings.end(),
                       [](const Finding& finding) { return finding.code == "seen_from_behind"; });
  };
  EXPECT_FALSE(names(*right));
  EXPECT_TRUE(names(*turned));
  EXPECT_NE(turned->result.verdict.grade, Grade::kGood);
  EXPECT_THAT(FindRefined(turned->result)->hand_eye.camera_mount_from_camera,
              IsNearPose(FindRefined(right->result)->hand_eye.camera_mount_from_camera, 1e-6, 1e-6));
}

TEST(PairRunTest, FailsWhereNothingWasDetected) {
  Dataset dataset = SimulatedDataset();
  for (TargetDetection& given : dataset.given_detections) given.detection.detection = {};
  EXPECT_THAT(heba::Run(dataset, RunOptions()).reason(), HasSubstr("nothing_detected (images 14, image "));
}

TEST(PairRunTest, RefusesAnIncompleteDataset) {
  const auto error_of = [](const auto& spoil) {
    Dataset dataset = SimulatedDataset();
    spoil(&dataset);
    return InputErrorOf([&] { (void)heba::Run(dataset, RunOptions()); });
  };
  EXPECT_EQ(error_of([](Dataset* dataset) { dataset->captures.clear(); }), "the data set has no captures");
  EXPECT_EQ(error_of([](Dataset* dataset) { dataset->targets = {nullptr}; }), "the data set has no target");
  EXPECT_EQ(error_of([](Dataset* dataset) { dataset->given_detections.back().capture = 14; }),
            "detections: has a detection in an image that no capture has");
  EXPECT_EQ(error_of([](Dataset* dataset) { dataset->captures[2].images = {""}; }),
            "detections: has a detection in an image that no capture has");
  EXPECT_EQ(error_of([](Dataset* dataset) { dataset->captures[2].images.clear(); }),
            "capture 2.png needs one pose for each arm and one image for each camera");
  EXPECT_EQ(error_of([](Dataset* dataset) { dataset->target_poses.resize(3); }),
            "the data set has 14 captures, but 3 poses of the target");
}

TEST(PairRunTest, RefusesACameraOfAnotherSize) {
  Dataset dataset = SimulatedDataset();
  dataset.rig.cameras[0].camera.width_px = 640;
  EXPECT_THAT(InputErrorOf([&] { (void)heba::Run(dataset, RunOptions()); }),
              HasSubstr("camera: is for images of 640 x 960 px"));
}

}  // namespace
}  // namespace heba
