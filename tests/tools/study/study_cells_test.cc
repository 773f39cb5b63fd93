#include "tools/study/study_cells.h"

#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
using ::testing::HasSubstr;
using ::testing::SizeIs;

StudyConfig SmallStudy() {
  StudyConfig study;
  study.num_trials = 20;
  study.seed = 1;
  for (int i = 0; i < 2; ++i) {
    StudyCell cell;
    cell.problem = HandEyeProblem(Setup::kEyeToHand, {"pinhole", 640, 480, {600, 600, 320, 240}}, TargetShape());
    cell.poses = HandEyePosesOf({});
    cell.targets.emplace_back().points.ids = {0};
    cell.targets[0].points.points_in_target = Points3::Zero(3, 1);
    cell.captures = {{{CaptureRole::kHome, Rigid3d()}}};
    cell.pixel_sigma_px = 0.1 * (i + 1);
    study.cells.push_back(cell);
    study.labels.emplace_back();
    study.labels.back().scene = "scene" + std::to_string(i);
  }
  StudyCell rig;
  rig.problem.robots = {"arm"};
  rig.problem.cameras = {{"top", {0, Mount::Part::kBase}, Camera{"pinhole", 640, 480, {600, 600, 320, 240}}}};
  rig.problem.targets = {{"plate", {0, Mount::Part::kGripper}, TargetShape()}};
  rig.poses = {{Rigid3d()}, {Rigid3d()}, {Rigid3d()}};
  rig.targets.emplace_back().points.points_in_target = Points3::Zero(3, 4);
  rig.captures = {{{}, {Rigid3d()}}, {{}, {Rigid3d()}}};
  study.cells.emplace_back(rig);
  study.labels.emplace_back();
  return study;
}

StudyCell& CameraCell(StudyConfig* study) { return study->cells[0]; }

std::vector<CellResult> ResultOf(int cell) {
  CellResult result;
  result.cell = cell;
  result.bound = StudyErrors{1e-3, 2e-3, 3e-3, 4e-3, 0.5, 6e-3, std::nullopt};
  MethodSummary method;
  method.method = "park";
  method.num_trials = 20;
  method.num_failed = 3;
  method.rms = StudyErrors{1.0 / 3, 0.2, 0.3, 0.4, std::nullopt, 0.25, 0.35};
  method.axxb_mean_mm = 0.7;
  method.estimated_effects = 0.9;
  method.coverage_inside = 0.94;
  method.coverage_outside = 0.96;
  result.methods.push_back(method);
  method.method = "bundle";
  method.coverage = 0.95;
  method.right_model = 0.9;
  method.pixel_sigma_px = 0.11;
  method.robot_noise = RobotNoise{1e-4, 2e-4};
  result.methods.push_back(method);
  return {result};
}

StudyCell& StudyCellOf(StudyConfig* study) { return study->cells[2]; }

class StudyCellsTest : public testing::Test {
 protected:
  TempFolder folder_;
  StudyConfig study_ = SmallStudy();
};

TEST_F(StudyCellsTest, FindsWhatItKept) {
  const StudyCells cells(folder_ / "study", study_);
  EXPECT_FALSE(cells.Find(1).has_value());
  cells.Keep(ResultOf(1));
  const std::optional<std::vector<CellResult>> results = cells.Find(1);
  ASSERT_TRUE(results.has_value());
  EXPECT_FALSE(cells.Find(0).has_value());
  ASSERT_THAT(*results, SizeIs(1));
  const CellResult* const found = results->data();
  EXPECT_EQ(found->cell, 1);
  EXPECT_EQ(found->labels.scene, "scene1");
  ASSERT_TRUE(found->bound) << found->bound.reason();
  EXPECT_EQ(found->bound->hand_eye_m, 1e-3);
  EXPECT_EQ(found->bound->hand_eye_rad, 2e-3);
  EXPECT_EQ(found->bound->board_m, 3e-3);
  EXPECT_EQ(found->bound->board_rad, 4e-3);
  EXPECT_EQ(found->bound->focal_px, 0.5);
  EXPECT_EQ(found->bound->inside_m, 6e-3);
  EXPECT_FALSE(found->bound->outside_m.has_value());
  ASSERT_THAT(found->methods, SizeIs(2));
  const MethodSummary& park = found->methods[0];
  EXPECT_EQ(park.method, "park");
  EXPECT_EQ(park.num_trials, 20);
  EXPECT_EQ(park.num_failed, 3);
  // Figures keep every digit, so that a study that is continued does not change.
  EXPECT_EQ(park.rms.hand_eye_m, 1.0 / 3);
  EXPECT_FALSE(park.rms.focal_px.has_value());
  EXPECT_EQ(park.axxb_mean_mm, 0.7);
  EXPECT_EQ(park.rms.inside_m, 0.25);
  EXPECT_EQ(park.rms.outside_m, 0.35);
  EXPECT_EQ(park.estimated_effects, 0.9);
  EXPECT_EQ(park.coverage_inside, 0.94);
  EXPECT_EQ(park.coverage_outside, 0.96);
  EXPECT_FALSE(park.coverage.has_value());
  EXPECT_FALSE(park.robot_noise.has_value());
  const MethodSummary& bundle = found->methods[1];
  EXPECT_EQ(bundle.coverage, 0.95);
  EXPECT_EQ(bundle.right_model, 0.9);
  EXPECT_EQ(bundle.pixel_sigma_px, 0.11);
  ASSERT_TRUE(bundle.robot_noise.has_value());
  EXPECT_EQ(bundle.robot_noise->translation_m, 1e-4);
  EXPECT_EQ(bundle.robot_noise->rotation_rad, 2e-4);
}

TEST_F(StudyCellsTest, KeepsWhyThereIsNoBound) {
  const StudyCells cells(folder_ / "study", study_);
  std::vector<CellResult> results = ResultOf(0);
  results[0].bound = Failure{"the captures do not determine the unknowns"};
  cells.Keep(results);
  ASSERT_TRUE(cells.Find(0).has_value());
  EXPECT_EQ(cells.Find(0)->at(0).bound.reason(), "the captures do not determine the unknowns");
}

TEST_F(StudyCellsTest, AnotherObjectFindsThemInTheSameFolder) {
  StudyCells(folder_ / "study", study_).Keep(ResultOf(0));
  EXPECT_TRUE(StudyCells(folder_ / "study", study_).Find(0).has_value());
}

struct Change {
  std::string name;
  std::function<void(StudyConfig* study)> apply;
};

class ChangedStudyTest : public StudyCellsTest, public testing::WithParamInterface<Change> {};

TEST_P(ChangedStudyTest, DoesNotReuseTheCell) {
  StudyCells(folder_ / "study", study_).Keep(ResultOf(0));
  GetParam().apply(&study_);
  EXPECT_FALSE(StudyCells(folder_ / "study", study_).Find(0).has_value());
}

INSTANTIATE_TEST_SUITE_P(
    , ChangedStudyTest,
    testing::Values(
        Change{"Trials", [](StudyConfig* study) { study->num_trials = 21; }},
        Change{"Seed", [](StudyConfig* study) { study->seed = 2; }},
        Change{"PixelNoise", [](StudyConfig* study) { CameraCell(study).pixel_sigma_px = 0.11; }},
        Change{"RobotNoise", [](StudyConfig* study) { CameraCell(study).robot_noise.rotation_rad = 1e-9; }},
        Change{"Outliers", [](StudyConfig* study) { CameraCell(study).outlier_points = 0.01; }},
        Change{"WrongCaptures", [](StudyConfig* study) { CameraCell(study).wrong_captures = 0.01; }},
        Change{"Camera", [](StudyConfig* study) { CameraCell(study).problem.cameras[0].camera.params[0] += 1e-6; }},
        Change{"CameraModel",
               [](StudyConfig* study) { CameraCell(study).problem.cameras[0].camera.model = "rational8"; }},
        Change{"HandEye", [](StudyConfig* study) { CameraCell(study).poses.mount_from_camera[0].translation.x() = 1; }},
        Change{"Pose",
               [](StudyConfig* study) { CameraCell(study).captures[0].seen.camera_from_target.translation.x() = 1; }},
        Change{"Role", [](StudyConfig* study) { CameraCell(study).captures[0].seen.role = CaptureRole::kNone; }},
        Change{"Points", [](StudyConfig* study) { CameraCell(study).targets[0].points.points_in_target(0, 0) = 1; }},
        Change{"Radii",
               [](StudyConfig* study) { CameraCell(study).targets[0].points.radii_m = Eigen::VectorXd::Ones(1); }},
        Change{"Shape", [](StudyConfig* study) { CameraCell(study).shape_params[0] = 1.01; }},
        Change{"Methods", [](StudyConfig* study) { CameraCell(study).options.methods = {"park"}; }},
        Change{"Loss", [](StudyConfig* study) { CameraCell(study).options.bundle.loss = LossKind::kHuber; }},
        Change{"Setup",
               [](StudyConfig* study) { CameraCell(study).problem.cameras[0].mount.part = Mount::Part::kGripper; }},
        Change{"RobotModel",
               [](StudyConfig* study) {
                 CameraCell(study).options.choose.robot_noise = !CameraCell(study).options.choose.robot_noise;
               }},
        Change{"Intrinsics",
               [](StudyConfig* study) {
                 CameraCell(study).problem.cameras[0].free_intrinsics = {ParameterGroup::kFocal};
               }},
        Change{"GivenCamera", [](StudyConfig* study) { CameraCell(study).gives_cameras = false; }}),
    [](const auto& change) { return change.param.name; });

TEST_F(StudyCellsTest, FindsThePosesOfARigInTheirOrder) {
  const StudyCells cells(folder_ / "study", study_);
  std::vector<CellResult> results;
  for (const char* pose : {"camera top in world", "camera side in camera top"}) {
    results.push_back(ResultOf(2)[0]);
    results.back().labels.pose = pose;
  }
  StudyErrors bound;
  bound.hand_eye_m = 1e-3;
  results[0].bound = bound;
  cells.Keep(results);
  const std::optional<std::vector<CellResult>> found = cells.Find(2);
  ASSERT_TRUE(found.has_value());
  ASSERT_THAT(*found, SizeIs(2));
  EXPECT_EQ(found->at(0).labels.pose, "camera top in world");
  EXPECT_EQ(found->at(1).labels.pose, "camera side in camera top");
  EXPECT_EQ(found->at(0).bound->hand_eye_m, 1e-3);
  EXPECT_FALSE(found->at(0).bound->board_m.has_value());
}

class ChangedCellStudyTest : public StudyCellsTest, public testing::WithParamInterface<Change> {};

TEST_P(ChangedCellStudyTest, DoesNotReuseTheCell) {
  StudyCells(folder_ / "study", study_).Keep(ResultOf(2));
  ASSERT_TRUE(StudyCells(folder_ / "study", study_).Find(2).has_value());
  GetParam().apply(&study_);
  EXPECT_FALSE(StudyCells(folder_ / "study", study_).Find(2).has_value());
}

INSTANTIATE_TEST_SUITE_P(
    , ChangedCellStudyTest,
    testing::Values(
        Change{"PixelNoise", [](StudyConfig* study) { StudyCellOf(study).pixel_sigma_px = 0.2; }},
        Change{"RobotNoise", [](StudyConfig* study) { StudyCellOf(study).robot_noise.rotation_rad = 1e-9; }},
        Change{"Margin", [](StudyConfig* study) { StudyCellOf(study).margin_px += 1; }},
        Change{"Camera", [](StudyConfig* study) { StudyCellOf(study).problem.cameras[0].camera.params[0] += 1e-6; }},
        Change{"Name", [](StudyConfig* study) { StudyCellOf(study).problem.cameras[0].name = "side"; }},
        Change{"Mount",
               [](StudyConfig* study) { StudyCellOf(study).problem.targets[0].mount.part = Mount::Part::kBase; }},
        Change{"CameraPose",
               [](StudyConfig* study) { StudyCellOf(study).poses.mount_from_camera[0].translation.x() = 1; }},
        Change{"TargetPose",
               [](StudyConfig* study) { StudyCellOf(study).poses.mount_from_target[0].translation.x() = 1; }},
        Change{"Arm", [](StudyConfig* study) { StudyCellOf(study).captures[1].arms[0].translation.x() = 1; }},
        Change{"Points", [](StudyConfig* study) { StudyCellOf(study).targets[0].points.points_in_target(0, 0) = 1; }},
        Change{"Intrinsics",
               [](StudyConfig* study) {
                 StudyCellOf(study).problem.cameras[0].free_intrinsics = {ParameterGroup::kFocal};
               }},
        Change{"GivenCamera", [](StudyConfig* study) { StudyCellOf(study).gives_cameras = false; }},
        Change{"RobotModel",
               [](StudyConfig* study) { StudyCellOf(study).options.bundle.robot = BundleOptions::Robot::kGivenNoise; }},
        Change{"Loss", [](StudyConfig* study) { StudyCellOf(study).options.bundle.loss = LossKind::kNone; }},
        Change{"Shape", [](StudyConfig* study) { StudyCellOf(study).options.choose.target_shape = false; }},
        Change{"Estimators", [](StudyConfig* study) { StudyCellOf(study).estimators = {StudyEstimator::kOneByOne}; }}),
    [](const auto& change) { return change.param.name; });

// The content of a cell decides, not its neighbours.
TEST_F(StudyCellsTest, AChangeOfAnotherCellDoesNotMatter) {
  StudyCells(folder_ / "study", study_).Keep(ResultOf(0));
  study_.cells[1].pixel_sigma_px = 5;
  study_.cells.push_back(study_.cells[1]);
  study_.labels.push_back(study_.labels[1]);
  EXPECT_TRUE(StudyCells(folder_ / "study", study_).Find(0).has_value());
}

TEST_F(StudyCellsTest, ADamagedFileIsNoResult) {
  const StudyCells cells(folder_ / "study", study_);
  cells.Keep(ResultOf(0));
  const std::filesystem::path file = folder_ / "study/cells/0.json";
  ASSERT_TRUE(std::filesystem::exists(file));
  std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
  EXPECT_FALSE(cells.Find(0).has_value());
}

TEST_F(StudyCellsTest, RefusesAFolderWithOtherFiles) {
  std::filesystem::create_directory(folder_ / "photos");
  std::ofstream(folder_ / "photos/holiday.jpg") << "x";
  EXPECT_THAT(InputErrorOf([&] { StudyCells(folder_ / "photos", study_); }),
              HasSubstr("photos: holds other files (no study.csv); name a new or empty folder"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "photos/cells"));
  std::ofstream(folder_ / "photos/study.csv") << "x";
  EXPECT_EQ(InputErrorOf([&] { StudyCells(folder_ / "photos", study_); }), "no error");
}

TEST_F(StudyCellsTest, RefusesAPathThatIsAFile) {
  std::ofstream(folder_ / "file") << "x";
  EXPECT_THAT(InputErrorOf([&] { StudyCells(folder_ / "file", study_); }), HasSubstr("cannot be created"));
}

}  // namespace
}  // namespace heba
