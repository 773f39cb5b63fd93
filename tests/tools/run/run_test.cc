// Tests of heba/run.h.
#include "heba/run.h"
#include "heba/displaced_target.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/files.h"
#include "heba/base/units.h"
#include "heba/io/result_file.h"
#include "tests/support/cell_arm_scenes.h"
#include "tests/support/cell_scenes.h"
#include "tests/support/datasets.h"
#include "tests/support/input_error.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"
#include "tools/pages/report.h"
#include "tools/text/result_table.h"
#include "tools/text/run_notes.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

constexpr const char* kTargets[] = {
    "{type: charuco, rows: 7, columns: 9, square: 20 mm, marker: 14 mm, dictionary: DICT_4X4_250}",
    "{type: charuco, rows: 7, columns: 9, square: 20 mm, marker: 14 mm, dictionary: DICT_4X4_250, first_marker: 100}"};

// A simulated rig whose detections are known, so that no image is searched.
class RunTest : public testing::Test {
 protected:
  // Fixed cameras `left` and `right`, a target `plate` on the gripper of the first arm, and a target `wall` on the
  // world or, with two arms, on the gripper of the second.
  CellScene MakeScene(size_t num_arms) {
    Rng rng(4);
    CellScene scene;
    CellSceneSetting setting;
    setting.has_free_intrinsics = false;
    scene.problem.robots = {"one"};
    scene.truth.world_from_base = {Rigid3d()};
    if (num_arms == 2) {
      scene.problem.robots.emplace_back("two");
      scene.truth.world_from_base.emplace_back(ExpRotation({0.05, -0.02, 3.0}), Eigen::Vector3d(1.1, 0.1, 0.02));
    }
    const Eigen::Vector3d middle(0.55, 0, 0.4);
    AddCamera("left", {0, Mount::Part::kBase}, LookingAt({0.5, 0.1, 1.3}, middle, 0.3), setting, &scene);
    AddCamera("right", {0, Mount::Part::kBase}, LookingAt({0.7, 0.3, 1.2}, middle, -0.4), setting, &scene);
    AddTarget("plate", {0, Mount::Part::kGripper}, Rigid3d(ExpRotation({0.3, 0.2, 0.1}), {0.02, 0, 0.1}), &scene);
    const Rigid3d on_world(ExpRotation({kPi, 0, 0}), {0.6, 0, 0.35});
    const Rigid3d on_gripper(ExpRotation({-0.2, 0.3, 0.1}), {0, 0.03, 0.08});
    AddTarget("wall", {num_arms - 1, num_arms == 2 ? Mount::Part::kGripper : Mount::Part::kBase},
              num_arms == 2 ? on_gripper : on_world, &scene);
    for (size_t t = 0; t < 2; ++t) {
      scene.targets[t].points_in_target = AllPoints(*targets_[t]).points_in_target;
      scene.problem.targets[t].shape = DesignedShape(scene.targets[t].points_in_target);
    }
    setting.num_captures = 16;
    Simulate(setting, rng, &scene);
    return scene;
  }

  Dataset DatasetOf(const CellScene& scene) {
    Dataset dataset;
    dataset.name = "cell";
    dataset.rig = scene.problem;
    dataset.rig.captures.clear();
    for (const ProblemCamera& camera : scene.problem.cameras) {
      dataset.has_camera.push_back(true);
      dataset.camera_sources.push_back(camera.name + ".yaml");
    }
    dataset.targets = targets_;
    CellTruth truth{scene.truth.mount_from_camera,
                    {scene.truth.mount_from_target.begin(), scene.truth.mount_from_target.end()},
                    {scene.truth.world_from_base.begin(), scene.truth.world_from_base.end()},
                    std::vector<std::optional<Camera>>(scene.problem.cameras.size())};
    dataset.truth = truth;
    for (size_t i = 0; i < scene.problem.captures.size(); ++i) {
      Recording capture{"capture" + std::to_string(i), scene.problem.captures[i].base_from_gripper, {}};
      for (const ProblemCamera& camera : scene.problem.cameras) {
        capture.images.push_back(folder_ / (camera.name + "_" + std::to_string(i) + ".png"));
      }
      dataset.captures.push_back(std::move(capture));
    }
    return dataset;
  }

  // Returns the observations of a scene as given detections.
  static std::vector<TargetDetection> DetectionsOf(const CellScene& scene) {
    std::vector<TargetDetection> detections;
    for (size_t i = 0; i < scene.problem.captures.size(); ++i) {
      for (size_t c = 0; c < scene.problem.cameras.size(); ++c) {
        const Camera& camera = scene.problem.cameras[c].camera;
        for (size_t t = 0; t < scene.problem.targets.size(); ++t) {
          TargetDetection& found = detections.emplace_back(TargetDetection{i, c, t, {}});
          found.detection.width_px = camera.width_px;
          found.detection.height_px = camera.height_px;
          for (const ProblemImage& image : scene.problem.captures[i].images) {
            if (image.camera != c || image.target != t) continue;
            found.detection.detection.ids = image.observations.ids;
            for (Eigen::Index p = 0; p < image.observations.pixels.cols(); ++p) {
              found.detection.detection.pixels.emplace_back(image.observations.pixels.col(p));
            }
          }
        }
      }
    }
    return detections;
  }

  static Outcome<RunOutput> RunOn(Dataset dataset, const CellScene& scene, int folds = 0) {
    dataset.given_detections = DetectionsOf(scene);
    RunOptions options;
    options.folds = folds;
    return heba::Run(dataset, options);
  }

  // Returns the observations of a target by a camera in a capture.
  static Observations& ImageOf(CellScene* scene, size_t capture, size_t camera, size_t target) {
    for (ProblemImage& image : scene->problem.captures[capture].images) {
      if (image.camera == camera && image.target == target) return image.observations;
    }
    throw InputError("the camera does not see this target");
  }

  static const ImageResult& ResultOf(const RunResult& result, const std::string& capture, const std::string& camera) {
    const auto found = std::find_if(result.images.begin(), result.images.end(), [&](const ImageResult& image) {
      return image.capture == capture && image.camera == camera;
    });
    if (found == result.images.end()) throw InputError("the result has no image " + camera + " of " + capture);
    return *found;
  }

  RunResult WrittenAndRead(const RunResult& result) {
    WriteFileAtomically(folder_ / "result.json", ResultToJson(result));
    return ReadRunResult(folder_ / "result.json");
  }

  const TempFolder folder_;
  std::vector<std::shared_ptr<const Target>> targets_ = {ParseTarget(kTargets[0]), ParseTarget(kTargets[1])};
};

// Counts the folds, and then ends the run.
class FoldCounter : public RunObserver {
 public:
  void OnStage(RunStage stage, int num_steps) override {
    if (stage == RunStage::kHoldOut) num_folds_ = num_steps;
  }
  bool IsCancelled() override { return num_folds_ > 0; }
  int num_folds() const { return num_folds_; }

 private:
  int num_folds_ = 0;
};

TEST_F(RunTest, HasNoMoreFoldsThanCaptures) {
  const CellScene scene = MakeScene(1);
  Dataset dataset = DatasetOf(scene);
  dataset.given_detections = DetectionsOf(scene);
  RunOptions options;
  options.folds = 1000;
  FoldCounter counter;
  const Outcome<RunOutput> run = heba::Run(dataset, options, &counter);
  EXPECT_EQ(run.failure().code, kCancelled);
  EXPECT_EQ(counter.num_folds(), 16);
}

// The result of an earlier run of all cameras is known better with a few captures more.
TEST_F(RunTest, BuildsOnAnEarlierRun) {
  const CellScene scene = MakeScene(2);
  const auto part = [&](size_t first, size_t last) {
    CellScene of_part = scene;
    std::vector<ProblemCapture>& captures = of_part.problem.captures;
    captures = {scene.problem.captures.begin() + static_cast<std::ptrdiff_t>(first),
                scene.problem.captures.begin() + static_cast<std::ptrdiff_t>(last)};
    return of_part;
  };
  const Outcome<RunOutput> earlier = RunOn(DatasetOf(part(0, 12)), part(0, 12));
  ASSERT_TRUE(earlier) << earlier.reason();
  Dataset later = DatasetOf(part(12, 16));
  later.given_detections = DetectionsOf(part(12, 16));
  RunOptions options;
  options.folds = 0;
  options.earlier = EarlierRun{"earlier", std::make_shared<const RunResult>(WrittenAndRead(earlier->result)), {}};
  const Outcome<RunOutput> updated = heba::Run(later, options);
  ASSERT_TRUE(updated) << updated.reason();
  const Outcome<RunOutput> alone = RunOn(DatasetOf(part(12, 16)), part(12, 16));
  ASSERT_TRUE(alone) << alone.reason();
  const auto variance_of = [&](const RunOutput& run) {
    const std::string block = CameraPoseBlock(scene.problem.cameras[1]);
    return PoseCovarianceOf(run.result.solution.covariance_repeatable, block)->diagonal().head<3>().sum();
  };
  EXPECT_LT(variance_of(*updated), variance_of(*earlier));
  EXPECT_LT(variance_of(*updated), 0.5 * variance_of(*alone));
  const std::vector<Finding>& findings = updated->result.verdict.findings;
  const auto prior =
      std::find_if(findings.begin(), findings.end(), [](const Finding& finding) { return finding.code == "prior"; });
  ASSERT_NE(prior, findings.end());
  EXPECT_EQ(prior->grade, Grade::kGood);
}

// The cameras share a clock, which is behind that of the only arm.
TEST_F(RunTest, OffsetOfAStreamIsEstimatedBesideSeveralCameras) {
  constexpr double kOffsetS = 0.4;
  const CellScene scene = MakeScene(1);
  Dataset dataset = OnStream(DatasetOf(scene), kOffsetS);
  const Outcome<RunOutput> run = RunOn(dataset, scene);
  ASSERT_TRUE(run) << run.reason();
  const std::optional<EstimatedTimeOffset> offset = WrittenAndRead(run->result).time_offset;
  ASSERT_TRUE(offset);
  EXPECT_LT(offset->sigma_s, 5e-3);
  EXPECT_NEAR(offset->value_s, kOffsetS, 4 * offset->sigma_s);
  for (size_t c = 0; c < 2; ++c) EXPECT_LT(*run->result.errors[c].truth_mm, 2);
  const std::vector<Finding>& findings = run->result.observations;
  EXPECT_TRUE(std::any_of(findings.begin(), findings.end(),
                          [](const Finding& finding) { return finding.code == "time_offset"; }));
  dataset.rig.robots.emplace_back("two");
  for (Recording& capture : dataset.captures) capture.base_from_gripper.emplace_back();
  EXPECT_THAT(InputErrorOf([&] { (void)heba::Run(dataset, RunOptions()); }), HasSubstr("is for one arm"));
}

// The plate was printed beside its design; the wall was not.
TEST_F(RunTest, PointsOfATargetAreEstimatedIfTheyAreFree) {
  const std::shared_ptr<const Target> designed = targets_[0];
  PointOffsets printed;
  Rng rng(3);
  for (const TargetPoint& point : designed->points()) {
    printed[point.id] = 3e-4 * Eigen::Vector3d{rng.Normal(), rng.Normal(), rng.Normal()};
  }
  targets_[0] = Displaced(designed, printed);
  const CellScene scene = MakeScene(1);
  targets_[0] = designed;
  Dataset dataset = DatasetOf(scene);
  dataset.rig.targets[0].free_shape = {TargetShapeGroup::kPoints};
  dataset.given_detections = DetectionsOf(scene);
  RunOptions options;
  options.folds = 0;
  options.calibration.choose_target_shape = false;
  const Outcome<RunOutput> run = heba::Run(dataset, options);
  ASSERT_TRUE(run) << run.reason();
  ASSERT_EQ(run->result.point_offsets.size(), 2U);
  EXPECT_TRUE(run->result.point_offsets[1].empty());
  double squares = 0;
  double squares_left = 0;
  for (const auto& [id, offset_m] : run->result.point_offsets[0]) {
    squares += printed.at(id).squaredNorm();
    squares_left += (printed.at(id) - offset_m).squaredNorm();
  }
  // The run cannot find the part that is a motion or a stretch of the plate.
  EXPECT_LT(squares_left, 0.35 * squares);
  const auto& findings = run->result.verdict.findings;
  const auto found = std::find_if(findings.begin(), findings.end(),
                                  [](const Finding& finding) { return finding.code == "points_estimated"; });
  ASSERT_NE(found, findings.end());
  EXPECT_EQ(found->Name("of_target"), "plate");
  EXPECT_EQ(WrittenAndRead(run->result).point_offsets, run->result.point_offsets);
}

// A rejected point belongs neither to the error of the camera nor to that of the image.
TEST_F(RunTest, RejectedPointsAreNoErrorsInSample) {
  CellScene scene = MakeScene(1);
  const Outcome<RunOutput> clean = RunOn(DatasetOf(scene), scene);
  ASSERT_TRUE(clean) << clean.reason();
  ImageOf(&scene, 5, 0, 0).pixels.col(7) += Eigen::Vector2d(40, 20);
  const Outcome<RunOutput> run = RunOn(DatasetOf(scene), scene);
  ASSERT_TRUE(run) << run.reason();
  const ImageResult& image = ResultOf(run->result, "capture5", "left");
  EXPECT_TRUE(image.used);
  ASSERT_FALSE(image.targets.empty());
  EXPECT_EQ(image.targets[0].num_rejected, 1);
  EXPECT_NEAR(*image.targets[0].rms_px, *ResultOf(clean->result, "capture5", "left").targets[0].rms_px, 0.05);
  EXPECT_NEAR(*run->result.errors[0].reprojection_rms_px, *clean->result.errors[0].reprojection_rms_px, 0.01);
}

// Each target that is not used has its own reason, after its name.
TEST_F(RunTest, EveryTargetOfAnImageHasItsReason) {
  CellScene scene = MakeScene(1);
  // The plate of another capture, and a single point of the wall that is elsewhere.
  ImageOf(&scene, 6, 0, 0).pixels = ImageOf(&scene, 7, 0, 0).pixels;
  ImageOf(&scene, 6, 0, 0).ids = ImageOf(&scene, 7, 0, 0).ids;
  Observations& wall = ImageOf(&scene, 6, 0, 1);
  const Points2 pixel = wall.pixels.leftCols<1>().array() + 60;
  wall.pixels = pixel;
  wall.ids.resize(1);
  const Outcome<RunOutput> run = RunOn(DatasetOf(scene), scene);
  ASSERT_TRUE(run) << run.reason();
  const ImageResult& image = ResultOf(run->result, "capture6", "left");
  EXPECT_FALSE(image.used);
  EXPECT_THAT(image.reason, AllOf(StartsWith("target plate: "),
                                  HasSubstr("; target wall: none of its points is where the estimate predicts it")));
}

// One image at two poses is named and not used; the other camera's images of these captures are.
TEST_F(RunTest, AnImageAtTwoPosesIsNotUsed) {
  const CellScene scene = MakeScene(1);
  Dataset dataset = DatasetOf(scene);
  dataset.given_detections = DetectionsOf(scene);
  for (TargetDetection& detection : dataset.given_detections) {
    const bool is_copied = detection.camera == 0 && (detection.capture == 3 || detection.capture == 9);
    if (is_copied) detection.detection.image_digest = "copied";
  }
  const Outcome<RunOutput> run = heba::Run(dataset, RunOptions());
  ASSERT_TRUE(run) << run.reason();
  EXPECT_THAT(ResultOf(run->result, "capture3", "left").reason,
              StartsWith("the same image as capture9, byte by byte, but with another pose of the robot"));
  EXPECT_FALSE(ResultOf(run->result, "capture9", "left").used);
  EXPECT_TRUE(ResultOf(run->result, "capture3", "right").used);
  EXPECT_TRUE(ResultOf(run->result, "capture9", "right").used);
}

// Images of one camera that were left out for one reason have one line.
TEST(LeftOutNotesTest, NameTheFirstAndTheLastImage) {
  const auto image = [](const std::string& capture, const std::string& camera, const std::string& target,
                        const std::string& reason) {
    ImageResult result{capture, camera, capture, false, reason.empty() ? "" : "target " + target + ": " + reason, {}};
    TargetInImage& seen = result.targets.emplace_back();
    seen.target = target;
    seen.reason = reason;
    return result;
  };
  ImageResult unseen{"9.png", "left", "9.png", false, "no target was detected", {}};
  EXPECT_THAT(LeftOutNotes({image("1.png", "left", "plate", "was moved"), image("1.png", "right", "plate", "is wrong"),
                            image("2.png", "left", "plate", ""), image("3.png", "left", "wall", "was moved"),
                            image("3.png", "right", "plate", "was moved"), image("4.png", "left", "plate", "was moved"),
                            unseen}),
              testing::ElementsAre("camera left: 3 images, from 1.png to 4.png: targets plate, wall: was moved",
                                   "1.png, camera right: target plate: is wrong",
                                   "3.png, camera right: target plate: was moved"));
}

// The errors of targets and bases by the truth are in the result, in its file and in the table.
TEST_F(RunTest, TruthOfTargetsAndBasesIsCompared) {
  const CellScene scene = MakeScene(2);
  Dataset dataset = DatasetOf(scene);
  const Rigid3d off(Eigen::Quaterniond::Identity(), {0.05, 0, 0});
  dataset.truth->mount_from_target[1] = *dataset.truth->mount_from_target[1] * off;
  const Outcome<RunOutput> run = RunOn(dataset, scene);
  ASSERT_TRUE(run) << run.reason();
  for (const RunResult& result : {run->result, WrittenAndRead(run->result)}) {
    const CellPoses& poses = result.solution.poses;
    ASSERT_EQ(result.truth.targets.size(), 2U);
    EXPECT_NEAR(result.truth.targets[0]->mm,
                1000 * DistanceM(poses.mount_from_target[0], scene.truth.mount_from_target[0]), 1e-6);
    EXPECT_NEAR(result.truth.targets[1]->mm, 50, 1);
    ASSERT_EQ(result.truth.bases.size(), 2U);
    EXPECT_FALSE(result.truth.bases[0].has_value());
    EXPECT_NEAR(result.truth.bases[1]->mm, 1000 * DistanceM(poses.world_from_base[1], scene.truth.world_from_base[1]),
                1e-6);
    EXPECT_LT(result.truth.bases[1]->mm, 2);
    EXPECT_GT(result.truth.bases[1]->mm, 0);
    ASSERT_EQ(result.truth.relative_cameras.size(), 1U);
    EXPECT_LT(result.truth.relative_cameras[0]->mm, 2);
  }
  const std::string table = ResultTable(run->result, Colour::kPlain);
  const std::string base = table.substr(table.find("base of arm two in world"));
  EXPECT_THAT(base.substr(0, base.find("camera ")), HasSubstr("\n  true error "));
}

// A pose that the truth does not know has no error.
TEST_F(RunTest, UnknownTruthIsNoError) {
  const CellScene scene = MakeScene(2);
  Dataset dataset = DatasetOf(scene);
  dataset.truth->mount_from_target[0].reset();
  dataset.truth->world_from_base[1].reset();
  const Outcome<RunOutput> run = RunOn(dataset, scene);
  ASSERT_TRUE(run) << run.reason();
  EXPECT_FALSE(run->result.truth.targets[0].has_value());
  EXPECT_TRUE(run->result.truth.targets[1].has_value());
  EXPECT_FALSE(run->result.truth.bases[1].has_value());
}

// An image with fewer points than determine a pose does not count as one that shows the target.
TEST_F(RunTest, NotesCountImagesThatDetermineAPose) {
  const Dataset dataset = DatasetOf(MakeScene(1));
  std::vector<TargetDetection> detections;
  for (size_t i = 0; i < 5; ++i) {
    TargetDetection& found = detections.emplace_back(TargetDetection{i, 1, 0, {}});
    for (int id = 0; id <= static_cast<int>(i); ++id) {
      found.detection.detection.ids.push_back(id);
      found.detection.detection.pixels.emplace_back(10 * id, 20);
    }
  }
  EXPECT_THAT(DetectionNotes(dataset, detections),
              testing::ElementsAre("cell: camera left sees target plate in 0 of 0 images",
                                   "cell: camera left sees target wall in 0 of 0 images",
                                   "cell: camera right sees target plate in 2 of 5 images",
                                   "cell: camera right sees target wall in 0 of 0 images"));
}

TEST_F(RunTest, WhatIsLeftOutIsListed) {
  const CellScene scene = MakeScene(1);
  Dataset dataset = DatasetOf(scene);
  const size_t num_images = 2 * dataset.captures.size();
  dataset.left_out = {
      {"extra", "left out by captures.exclude", "extra", {folder_ / "left_extra.png", folder_ / "right_extra.png"}},
      {"right/late.png", "the robot's pose is not in the poses file", "", {{}, folder_ / "late.png"}},
      {"two.csv:9", "the pose belongs to no capture of one.csv", "", {}}};
  const Outcome<RunOutput> run = RunOn(dataset, scene);
  ASSERT_TRUE(run) << run.reason();
  for (const RunResult& result : {run->result, WrittenAndRead(run->result)}) {
    ASSERT_EQ(result.images.size(), num_images + 4);
    const auto expect = [&](size_t place, const char* capture, const char* camera, const char* image,
                            const char* reason) {
      const ImageResult& entry = result.images[num_images + place];
      EXPECT_EQ(entry.capture, capture);
      EXPECT_EQ(entry.camera, camera);
      EXPECT_EQ(entry.image, image);
      EXPECT_EQ(entry.reason, reason);
      EXPECT_FALSE(entry.used);
    };
    expect(0, "extra", "left", "left_extra.png", "left out by captures.exclude");
    expect(1, "extra", "right", "right_extra.png", "left out by captures.exclude");
    expect(2, "", "right", "late.png", "the robot's pose is not in the poses file");
    expect(3, "two.csv:9", "", "", "the pose belongs to no capture of one.csv");
    // These entries are no images that the run could have used.
    EXPECT_EQ(CountImages(result, "left"), std::pair(16, 16));
  }
  const std::string page = ReportPage(ReportDataOf(*run), {"", "", "", ""});
  EXPECT_THAT(page, HasSubstr("left out by captures.exclude"));
  EXPECT_THAT(page, HasSubstr("late.png"));
  // A config that is called config has the name of its folder.
  RunOutput named = *run;
  named.result.name = "config";
  EXPECT_THAT(ReportPage(ReportDataOf(named), {"", "/cells/left arm/config.yaml", "", ""}),
              HasSubstr("<h1>left arm</h1>"));
}

// One row of joints belongs to another capture.
TEST_F(RunTest, CaptureWhoseJointsContradictItsPoseIsLeftOut) {
  CellSceneSetting setting;
  setting.num_captures = 20;
  setting.has_free_intrinsics = false;
  CellScene rig = ReachableCell(11, setting);
  for (size_t t = 0; t < targets_.size(); ++t) {
    rig.targets[t].points_in_target = AllPoints(*targets_[t]).points_in_target;
    rig.problem.targets[t].shape = DesignedShape(rig.targets[t].points_in_target);
  }
  const CellArmScene scene = WithArms(std::move(rig), setting, {DegToRad(0.1), 0.5e-3, DegToRad(0.05)}, 12);
  Dataset dataset = DatasetOf(scene.rig);
  dataset.truth.reset();
  dataset.arms = {RobotArm{scene.arms.front()->nominal, scene.arms.front()->tip_from_gripper, {}}};
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    const Eigen::VectorXd& joints = scene.joints[i].front();
    dataset.captures[i].joints = {{joints.begin(), joints.end()}};
  }
  dataset.captures[4].joints = dataset.captures[9].joints;
  const Outcome<RunOutput> run = RunOn(dataset, scene.rig);
  ASSERT_TRUE(run) << run.reason();
  EXPECT_EQ(run->dataset.captures.size(), dataset.captures.size() - 1);
  const ImageResult& left_out = ResultOf(run->result, "capture4", "left");
  EXPECT_FALSE(left_out.used);
  EXPECT_THAT(left_out.reason, HasSubstr("its joints or its pose are wrong"));
  ASSERT_TRUE(run->result.arms.front().has_value());
  EXPECT_TRUE(run->result.arms.front()->is_estimated) << run->result.arms.front()->reason.ToString();
  // The later captures keep their images.
  EXPECT_TRUE(ResultOf(run->result, "capture5", "left").used);
  for (const TargetDetection& detection : run->detections) EXPECT_LT(detection.capture, run->dataset.captures.size());
}

TEST_F(RunTest, HoldOutsOfImagesAddUpToThoseOfTheirCamera) {
  const CellScene scene = MakeScene(1);
  const Outcome<RunOutput> run = RunOn(DatasetOf(scene), scene, 4);
  ASSERT_TRUE(run) << run.reason();
  for (size_t c = 0; c < scene.problem.cameras.size(); ++c) {
    double squares_mm2 = 0;
    int num_targets = 0;
    for (const ImageResult& image : run->result.images) {
      if (image.camera != scene.problem.cameras[c].name || !image.used) continue;
      ASSERT_TRUE(image.holdout_target_mm.has_value()) << image.capture;
      const auto number = static_cast<int>(image.targets.size());
      squares_mm2 += number * *image.holdout_target_mm * *image.holdout_target_mm;
      num_targets += number;
    }
    const double of_camera_mm = *run->result.errors[c].holdout_target_mm;
    EXPECT_NEAR(std::sqrt(squares_mm2 / num_targets), of_camera_mm, 1e-9 * of_camera_mm);
  }
  const fs::path file = folder_ / "result.json";
  WriteFileAtomically(file, ResultToJson(run->result));
  const RunResult read = ReadRunResult(file);
  for (size_t e = 0; e < read.images.size(); ++e) {
    EXPECT_EQ(read.images[e].holdout_target_mm, run->result.images[e].holdout_target_mm);
  }
}

}  // namespace
}  // namespace heba
