#include "tools/config/study_config.h"

#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include "heba/base/units.h"
#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr const char* kScene =
    "{setup: eye_to_hand, target: {type: chessboard, rows: 5, columns: 8, square: 20 mm}, camera: {model: pinhole, "
    "image_size: [640, 480], fx: 600, fy: 601, cx: 320, cy: 240}, hand_eye: {translation: [500 mm, 0 mm, 600 mm]}, "
    "board: {translation: [0 mm, 0 mm, 50 mm]}, motion: {captures: 6}}\n";

const StudyCell& CameraCell(const StudyConfig& study, size_t cell) { return study.cells.at(cell); }

class StudyConfigTest : public testing::Test {
 protected:
  void Write(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }
  // Reads a study of the scene `plain`, and of whatever `more` states.
  StudyConfig Read(const std::string& more = "") const {
    Write("noise.yaml", std::string("scenes:\n  plain: ") + kScene + more);
    return ReadStudyConfig(folder_ / "noise.yaml");
  }
  std::string ErrorOf(const std::string& more) const {
    return InputErrorOf([&] { Read(more); });
  }

  TempFolder folder_;
};

TEST_F(StudyConfigTest, FillsInDefaults) {
  const StudyConfig study = Read();
  EXPECT_EQ(study.name, "noise");
  EXPECT_EQ(study.num_trials, 300);
  EXPECT_EQ(study.seed, 1u);
  EXPECT_EQ(study.output, folder_ / "studies" / "noise");
  ASSERT_THAT(study.cells, SizeIs(1));
  ASSERT_THAT(study.labels, SizeIs(1));
  const StudyLabels& labels = study.labels[0];
  EXPECT_EQ(labels.scene, "plain");
  EXPECT_EQ(labels.setup, Setup::kEyeToHand);
  EXPECT_EQ(labels.num_captures, 6);
  EXPECT_EQ(labels.num_points, 40);
  EXPECT_EQ(labels.pixel_sigma_px, 0.1);
  EXPECT_EQ(labels.robot_noise.translation_m, 0);
  EXPECT_THAT(labels.shape_params, ElementsAre(1, 1, 0, 0, 0, 0, 0, 0, 0));
  EXPECT_EQ(labels.robot_model, "auto");
  const StudyCell& cell = CameraCell(study, 0);
  EXPECT_THAT(cell.captures, SizeIs(6));
  EXPECT_EQ(cell.pixel_sigma_px, 0.1);
  EXPECT_EQ(cell.outlier_points, 0);
  EXPECT_EQ(cell.wrong_captures, 0);
  EXPECT_THAT(cell.options.methods, IsEmpty());
  EXPECT_EQ(cell.options.seed, "best");
  EXPECT_EQ(cell.options.bundle.loss, LossKind::kTruncated);
  EXPECT_THAT(cell.problem.cameras[0].free_intrinsics, IsEmpty());
  EXPECT_TRUE(cell.options.choose.robot_noise);
  EXPECT_TRUE(cell.options.choose.target_shape);
  EXPECT_EQ(cell.problem.cameras[0].camera.width_px, 640);
  EXPECT_TRUE(cell.gives_cameras);
}

TEST_F(StudyConfigTest, ReadsTheOptionsOfTheEstimators) {
  const StudyConfig study = Read(
      "name: sweep\ntrials: 20\nseed: 9\nmethods: [tsai, park]\nstart: park\nloss: huber\n"
      "intrinsics: [focal, distortion]\nshape_model: none\ngive_camera: false\noutput: results/sweep\n");
  EXPECT_EQ(study.name, "sweep");
  EXPECT_EQ(study.num_trials, 20);
  EXPECT_EQ(study.seed, 9u);
  EXPECT_EQ(study.output, folder_ / "results" / "sweep");
  const PairCalibrationOptions& options = CameraCell(study, 0).options;
  EXPECT_THAT(options.methods, ElementsAre("tsai", "park"));
  EXPECT_EQ(options.seed, "park");
  EXPECT_EQ(options.bundle.loss, LossKind::kHuber);
  EXPECT_THAT(CameraCell(study, 0).problem.cameras[0].free_intrinsics,
              ElementsAre(ParameterGroup::kFocal, ParameterGroup::kDistortion));
  EXPECT_FALSE(options.choose.target_shape);
  EXPECT_FALSE(CameraCell(study, 0).gives_cameras);
}

TEST_F(StudyConfigTest, ReadsTheNoiseOfACell) {
  const StudyConfig study = Read(
      "pixel_noise: 0.3 px\nrobot_noise: {translation: 0.2 mm, rotation: 0.1 deg}\noutlier_points: 0.05\n"
      "wrong_captures: 0.1\ntarget_shape: {scale_x: 1.01, bend_y: 2 mm}\nrobot_model: given\n");
  ASSERT_THAT(study.cells, SizeIs(1));
  const StudyCell& cell = CameraCell(study, 0);
  const StudyLabels& labels = study.labels[0];
  EXPECT_DOUBLE_EQ(cell.pixel_sigma_px, 0.3);
  EXPECT_DOUBLE_EQ(labels.pixel_sigma_px, 0.3);
  EXPECT_DOUBLE_EQ(cell.robot_noise.translation_m, 0.2e-3);
  EXPECT_DOUBLE_EQ(cell.robot_noise.rotation_rad, DegToRad(0.1));
  EXPECT_DOUBLE_EQ(labels.robot_noise.translation_m, 0.2e-3);
  EXPECT_DOUBLE_EQ(cell.options.bundle.robot_noise.translation_m, 0.2e-3);
  EXPECT_DOUBLE_EQ(cell.outlier_points, 0.05);
  EXPECT_DOUBLE_EQ(labels.outlier_points, 0.05);
  EXPECT_DOUBLE_EQ(cell.wrong_captures, 0.1);
  EXPECT_DOUBLE_EQ(labels.wrong_captures, 0.1);
  EXPECT_THAT(cell.shape_params, ElementsAre(1.01, 1, 0, 2e-3, 0, 0, 0, 0, 0));
  EXPECT_THAT(labels.shape_params, ElementsAre(1.01, 1, 0, 2e-3, 0, 0, 0, 0, 0));
  // The estimators know the design only.
  EXPECT_THAT(cell.problem.targets[0].shape.params, ElementsAre(1, 1, 0, 0, 0, 0, 0, 0, 0));
  EXPECT_EQ(cell.options.bundle.robot, BundleOptions::Robot::kGivenNoise);
  EXPECT_FALSE(cell.options.choose.robot_noise);
}

TEST_F(StudyConfigTest, RobotModelsSetTheRefinement) {
  const StudyConfig study = Read("robot_model: [exact, given, estimated, auto]\n");
  ASSERT_THAT(study.cells, SizeIs(4));
  EXPECT_EQ(CameraCell(study, 0).options.bundle.robot, BundleOptions::Robot::kExact);
  EXPECT_EQ(CameraCell(study, 1).options.bundle.robot, BundleOptions::Robot::kGivenNoise);
  EXPECT_EQ(CameraCell(study, 2).options.bundle.robot, BundleOptions::Robot::kEstimatedNoise);
  for (size_t i = 0; i < 3; ++i) EXPECT_FALSE(CameraCell(study, i).options.choose.robot_noise) << i;
  EXPECT_TRUE(CameraCell(study, 3).options.choose.robot_noise);
}

TEST_F(StudyConfigTest, CellsAreAllCombinationsOfTheLists) {
  Write("second.yaml", kScene);
  Write("noise.yaml", std::string("scenes:\n  plain: ") + kScene +
                          "  second: second.yaml\ncaptures: [4, 5]\npixel_noise: [0.1 px, 0.2 px]\n");
  const StudyConfig study = ReadStudyConfig(folder_ / "noise.yaml");
  std::vector<std::string> cells;
  for (size_t i = 0; i < study.cells.size(); ++i) {
    const StudyLabels& labels = study.labels[i];
    EXPECT_EQ(CameraCell(study, i).captures.size(), static_cast<size_t>(labels.num_captures));
    EXPECT_EQ(CameraCell(study, i).pixel_sigma_px, labels.pixel_sigma_px);
    cells.push_back(labels.scene + " " + std::to_string(labels.num_captures) + " " +
                    (labels.pixel_sigma_px < 0.15 ? "0.1" : "0.2"));
  }
  EXPECT_THAT(cells, ElementsAre("plain 4 0.1", "plain 4 0.2", "plain 5 0.1", "plain 5 0.2", "second 4 0.1",
                                 "second 4 0.2", "second 5 0.1", "second 5 0.2"));
}

// The requested number includes the captures of the two-step motion, of which the scene has five here.
TEST_F(StudyConfigTest, CapturesIncludeTheTwoStepMotion) {
  std::string scene = kScene;
  const std::string motion = "motion: {captures: 6}";
  scene.replace(scene.find(motion), motion.size(),
                "motion: {captures: 6, tilt: 10 deg, spread: 0.1, two_step: {translation: 20 mm, turns: 2, angle: 8 "
                "deg}}");
  Write("noise.yaml", "scenes:\n  steps: " + scene + "captures: [5, 8]\n");
  const StudyConfig study = ReadStudyConfig(folder_ / "noise.yaml");
  ASSERT_THAT(study.cells, SizeIs(2));
  EXPECT_THAT(CameraCell(study, 0).captures, SizeIs(5));
  EXPECT_THAT(CameraCell(study, 1).captures, SizeIs(8));
  EXPECT_EQ(CameraCell(study, 1).captures[4].seen.role, CaptureRole::kRotate);
  EXPECT_EQ(CameraCell(study, 1).captures[5].seen.role, CaptureRole::kFree);
  Write("noise.yaml", "scenes:\n  steps: " + scene + "captures: 4\n");
  EXPECT_THAT(InputErrorOf([&] { ReadStudyConfig(folder_ / "noise.yaml"); }),
              HasSubstr("scenes.steps: has more captures in its two-step motion than requested"));
}

// A scene without its camera stays without it unless the study decides otherwise.
TEST_F(StudyConfigTest, TheSceneDecidesOnTheCameraUnlessTheStudyDoes) {
  std::string scene = kScene;
  scene.replace(scene.find("motion:"), 0, "give_camera: false, ");
  Write("noise.yaml", "scenes:\n  plain: " + scene);
  EXPECT_FALSE(CameraCell(ReadStudyConfig(folder_ / "noise.yaml"), 0).gives_cameras);
  Write("noise.yaml", "scenes:\n  plain: " + scene + "give_camera: true\n");
  EXPECT_TRUE(CameraCell(ReadStudyConfig(folder_ / "noise.yaml"), 0).gives_cameras);
}

TEST_F(StudyConfigTest, StudyAsUsedReadsBackAsTheSameCells) {
  const StudyConfig study = Read("captures: [4, 5]\npixel_noise: [0.1 px, 0.2 px]\ntrials: 20\n");
  Write("used.yaml", study.used);
  const StudyConfig again = ReadStudyConfig(folder_ / "used.yaml");
  EXPECT_EQ(again.name, "noise");
  EXPECT_EQ(again.num_trials, 20);
  ASSERT_EQ(again.cells.size(), 4u);
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(again.labels[i].num_captures, study.labels[i].num_captures);
    EXPECT_EQ(again.labels[i].pixel_sigma_px, study.labels[i].pixel_sigma_px);
  }
  EXPECT_EQ(again.used, study.used);
}

TEST_F(StudyConfigTest, StudyAsUsedStatesEveryDefault) {
  const YAML::Node used = YAML::Load(Read().used);
  const auto text_of = [&](const char* key) {
    YAML::Emitter emitter;
    emitter.SetSeqFormat(YAML::Flow);
    emitter.SetMapFormat(YAML::Flow);
    emitter << used[key];
    return std::string(emitter.c_str());
  };
  EXPECT_EQ(text_of("name"), "noise");
  EXPECT_EQ(text_of("trials"), "300");
  EXPECT_EQ(text_of("seed"), "1");
  EXPECT_EQ(text_of("pixel_noise"), "[0.1 px]");
  EXPECT_EQ(text_of("robot_noise"), "[{translation: 0 m, rotation: 0 rad}]");
  EXPECT_EQ(text_of("outlier_points"), "[0]");
  EXPECT_EQ(text_of("wrong_captures"), "[0]");
  EXPECT_EQ(text_of("robot_model"), "[auto]");
  EXPECT_EQ(
      text_of("target_shape"),
      "[{scale_x: 1, scale_y: 1, bend_x: 0 m, bend_y: 0 m, twist: 0 m, cubic_xxx: 0 m, cubic_xxy: 0 m, cubic_xyy: 0 m, "
      "cubic_yyy: 0 m}]");
  EXPECT_EQ(text_of("shape_model"), "auto");
  EXPECT_EQ(text_of("methods"), "all");
  EXPECT_EQ(text_of("start"), "best");
  EXPECT_EQ(text_of("loss"), "truncated");
  EXPECT_EQ(text_of("intrinsics"), "[]");
  EXPECT_EQ(text_of("output"), (folder_ / "studies" / "noise").string());
  // The scene states its number of captures and whether its camera is known.
  EXPECT_EQ(used["scenes"]["plain"]["motion"]["captures"].as<int>(), 6);
  EXPECT_TRUE(used["scenes"]["plain"]["give_camera"].as<bool>());
}

// The study is written into its output folder, beside which there are no scenes, targets and cameras.
TEST_F(StudyConfigTest, StudyAsUsedCanBeReadFromItsOutputFolder) {
  std::string scene = kScene;
  const size_t target = scene.find("{type");
  scene.replace(target, scene.find('}') + 1 - target, "board.yaml");
  const size_t camera = scene.find("{model");
  scene.replace(camera, scene.find('}', camera) + 1 - camera, "camera.yaml");
  Write("board.yaml", "{type: chessboard, rows: 5, columns: 8, square: 20 mm}\n");
  Write("camera.yaml", "{model: pinhole, image_size: [640, 480], fx: 600, fy: 601, cx: 320, cy: 240}\n");
  Write("second.yaml", scene);
  Write("noise.yaml", "scenes:\n  first: " + scene + "  second: second.yaml\n" +
                          "robot_noise: {translation: 0.2 mm, rotation: 0.1 deg}\nmethods: [tsai]\ngive_camera: false\n"
                          "target_shape: [{}, {bend_y: 2 mm}]\nintrinsics: [focal]\noutlier_points: 0.05\n");
  const StudyConfig study = ReadStudyConfig(folder_ / "noise.yaml");
  std::filesystem::create_directories(study.output);
  Write("studies/noise/config.yaml", study.used);
  const StudyConfig again = ReadStudyConfig(study.output / "config.yaml");
  EXPECT_EQ(again.used, study.used);
  EXPECT_EQ(again.name, study.name);
  EXPECT_EQ(again.output, study.output);
  ASSERT_THAT(again.cells, SizeIs(4));
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(again.labels[i].scene, study.labels[i].scene);
    EXPECT_EQ(again.labels[i].shape_params, study.labels[i].shape_params);
    EXPECT_EQ(again.labels[i].outlier_points, 0.05);
    EXPECT_EQ(CameraCell(again, i).robot_noise.rotation_rad, CameraCell(study, i).robot_noise.rotation_rad);
    EXPECT_EQ(CameraCell(again, i).problem.cameras[0].camera.params,
              CameraCell(study, i).problem.cameras[0].camera.params);
    EXPECT_EQ(CameraCell(again, i).targets[0].points.points_in_target,
              CameraCell(study, i).targets[0].points.points_in_target);
    EXPECT_THAT(CameraCell(again, i).options.methods, ElementsAre("tsai"));
    EXPECT_THAT(CameraCell(again, i).problem.cameras[0].free_intrinsics, ElementsAre(ParameterGroup::kFocal));
    EXPECT_FALSE(CameraCell(again, i).gives_cameras);
    ASSERT_EQ(CameraCell(again, i).captures.size(), CameraCell(study, i).captures.size());
    EXPECT_EQ(CameraCell(again, i).captures[0].seen.camera_from_target.translation,
              CameraCell(study, i).captures[0].seen.camera_from_target.translation);
  }
}

// Two cameras beside an arm, whose first one may have more keys.
std::string CellSceneWith(const std::string& of_left = "") {
  const std::string camera = "camera: {model: pinhole, image_size: [1280, 960], fx: 1200, fy: 1200, cx: 640, cy: 480}";
  return "{cameras: {left: {mount: world, pose: {translation: [500 mm, 0 mm, 900 mm], rpy: [180 deg, 0 deg, 0 deg]}, " +
         camera + of_left +
         "}, right: {mount: world, pose: {translation: [600 mm, 0 mm, 900 mm], rpy: [180 deg, 0 deg, " + "0 deg]}, " +
         camera +
         "}}, targets: {plate: {mount: gripper, pose: {translation: [0 mm, 0 mm, 50 mm]}, target: {type: chessboard, "
         "rows: 5, columns: 8, square: 20 mm}}}, motion: {captures: 6, distance: 600 mm}}\n";
}

class CellStudyConfigTest : public StudyConfigTest {
 protected:
  StudyConfig ReadLongForm(const std::string& more, const std::string& scene = CellSceneWith()) const {
    Write("rig.yaml", "scenes:\n  pair: " + scene + more);
    return ReadStudyConfig(folder_ / "rig.yaml");
  }
};

TEST_F(CellStudyConfigTest, CellsAreAllCombinationsOfTheLists) {
  const StudyConfig study = ReadLongForm(
      "captures: [4, 5]\npixel_noise: [0.1 px, 0.2 px]\nrobot_noise: {translation: 1 mm, rotation: 0.1 deg}\n"
      "intrinsics: [[], [focal]]\nestimators: one_by_one\nrobot_model: given\nshape_model: none\nloss: none\n"
      "give_camera: false\n");
  ASSERT_THAT(study.cells, SizeIs(8));
  for (size_t i = 0; i < study.cells.size(); ++i) {
    const StudyCell& cell = study.cells[i];
    const StudyLabels& labels = study.labels[i];
    EXPECT_EQ(labels.rig, "2 cameras, 1 target, 1 arm");
    EXPECT_EQ(labels.num_points, 40);
    EXPECT_EQ(labels.num_captures, i < 4 ? 4 : 5);
    EXPECT_EQ(cell.captures.size(), static_cast<size_t>(labels.num_captures));
    EXPECT_EQ(cell.pixel_sigma_px, labels.pixel_sigma_px);
    EXPECT_DOUBLE_EQ(labels.pixel_sigma_px, i % 4 < 2 ? 0.1 : 0.2);
    EXPECT_DOUBLE_EQ(cell.robot_noise.translation_m, 1e-3);
    EXPECT_DOUBLE_EQ(cell.options.bundle.robot_noise.translation_m, 1e-3);
    EXPECT_EQ(cell.options.bundle.robot, BundleOptions::Robot::kGivenNoise);
    EXPECT_EQ(cell.options.bundle.loss, LossKind::kNone);
    EXPECT_FALSE(cell.options.choose.target_shape);
    EXPECT_FALSE(cell.gives_cameras);
    EXPECT_THAT(cell.estimators, ElementsAre(StudyEstimator::kOneByOne));
    for (const ProblemCamera& camera : cell.problem.cameras) {
      EXPECT_EQ(camera.free_intrinsics.size(), i % 2);
      EXPECT_EQ(camera.free_intrinsics, labels.free_intrinsics);
    }
  }
}

// The scene in the study as used needs no other file, and a study of both kinds of scenes can be read.
TEST_F(CellStudyConfigTest, TheStudyAsUsedReadsBackAsTheSame) {
  Write("plate.yaml", "{type: chessboard, rows: 5, columns: 8, square: 20 mm}\n");
  std::string scene = CellSceneWith();
  const std::string target = "{type: chessboard, rows: 5, columns: 8, square: 20 mm}";
  scene.replace(scene.find(target), target.size(), "plate.yaml");
  Write("pair.yaml", scene);
  Write("rig.yaml", std::string("scenes: {pair: pair.yaml, single: ") + kScene + "}\nintrinsics: [[], [focal]]\n");
  const StudyConfig study = ReadStudyConfig(folder_ / "rig.yaml");
  std::filesystem::create_directory(folder_ / "elsewhere");
  Write("elsewhere/again.yaml", study.used);
  const StudyConfig again = ReadStudyConfig(folder_ / "elsewhere/again.yaml");
  ASSERT_THAT(study.cells, SizeIs(4));
  ASSERT_THAT(again.cells, SizeIs(4));
  for (size_t i = 0; i < 2; ++i) {
    const StudyCell& one = study.cells[i];
    const StudyCell& other = again.cells[i];
    EXPECT_EQ(one.targets[0].points.points_in_target, other.targets[0].points.points_in_target);
    EXPECT_EQ(one.problem.cameras[1].camera.params, other.problem.cameras[1].camera.params);
    EXPECT_EQ(again.labels[i].free_intrinsics, study.labels[i].free_intrinsics);
    ASSERT_EQ(one.captures.size(), other.captures.size());
    // A rotation is written as a quaternion, which is normalised when it is read.
    constexpr double kRoundOffM = 1e-12;
    EXPECT_LT((one.captures[5].arms[0].translation - other.captures[5].arms[0].translation).norm(), kRoundOffM);
    EXPECT_THAT(CameraCell(again, 2 + i).problem.cameras[0].free_intrinsics, SizeIs(i));
  }
}

TEST_F(CellStudyConfigTest, HasTheErrorsOfASingleCamera) {
  std::string repeated = CellSceneWith();
  repeated.replace(repeated.find("captures: 6"), 11, "captures: 6, repeats: 2");
  repeated.insert(1, "image: {noise: 1 grey}, ");
  const StudyConfig study =
      ReadLongForm("outlier_points: 0.1\nwrong_captures: [0, 0.2]\ntarget_shape: {scale_x: 1.01}\n", repeated);
  ASSERT_THAT(study.cells, SizeIs(2));
  EXPECT_EQ(study.cells[1].num_repeats, 2);
  EXPECT_EQ(study.cells[1].outlier_points, 0.1);
  EXPECT_EQ(study.cells[1].wrong_captures, 0.2);
  EXPECT_EQ(study.labels[1].wrong_captures, 0.2);
  EXPECT_THAT(study.cells[1].shape_params, ElementsAre(1.01, 1, 0, 0, 0, 0, 0, 0, 0));
}

TEST_F(CellStudyConfigTest, RefusesWhatARigDoesNotHave) {
  const auto error_of = [&](const std::string& more, const std::string& scene = CellSceneWith()) {
    return InputErrorOf([&] { ReadLongForm(more, scene); });
  };
  for (const char* line : {"kinematics: offsets", "methods: [tsai]", "start: park"}) {
    const std::string key = std::string(line).substr(0, std::string(line).find(':'));
    EXPECT_THAT(error_of(std::string(line) + "\n"),
                HasSubstr("rig.yaml:3: " + key + ": is for scenes of one camera; scene 'pair' is a rig"));
  }
  EXPECT_THAT(error_of("", CellSceneWith(", moved: {from: 3, by: {translation: [1 mm, 0 mm, 0 mm]}}")),
              HasSubstr("rig.yaml:2: scenes.pair: moves camera left during the captures, which a study does not"));
  std::string near = CellSceneWith();
  near.replace(near.find("distance: 600 mm"), 16, "distance: 60 mm");
  EXPECT_THAT(error_of("", near), HasSubstr("rig.yaml:2: scenes.pair: the target does not fit into the image"));
  std::string loose = CellSceneWith();
  loose.replace(loose.find("mount: gripper"), 14, "mount: griper");
  EXPECT_THAT(error_of("", loose), HasSubstr("scenes.pair.targets.plate.mount: 'griper' is unknown"));
}

struct WrongStudy {
  std::string name;
  std::string more;     // Lines after the scene, so the first is line 3 of the file.
  std::string message;  // The text after "noise.yaml:3: ".
};

class WrongStudyTest : public StudyConfigTest, public testing::WithParamInterface<WrongStudy> {};

TEST_P(WrongStudyTest, IsRefusedWithItsLineAndKey) {
  EXPECT_THAT(ErrorOf(GetParam().more), HasSubstr("noise.yaml:3: " + GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    , WrongStudyTest,
    testing::Values(
        WrongStudy{"UnknownKey", "trails: 3\n", "unknown key 'trails'; did you mean 'trials'?"},
        WrongStudy{"NoTrials", "trials: 0\n", "trials: 0 is out of range"},
        WrongStudy{"PathAsName", "name: a/b\n", "name: 'a/b' cannot name a folder"},
        WrongStudy{"ControlCharacterInTheName", "name: \"a\\nb\"\n", "name: 'a?b' cannot name a folder"},
        WrongStudy{"ZeroPixelNoise", "pixel_noise: [0.1 px, 0 px]\n", "pixel_noise[1]: must be greater than zero"},
        WrongStudy{"PixelNoiseWithoutUnit", "pixel_noise: 0.1\n", "pixel_noise: '0.1' has no unit"},
        WrongStudy{"EmptyList", "pixel_noise: []\n", "pixel_noise: the list is empty"},
        WrongStudy{"FewCaptures", "captures: 2\n", "captures: 2 is out of range; from 3 to 10000 is possible"},
        WrongStudy{"Share", "outlier_points: 1.5\n", "outlier_points: a share from 0 to 1 is needed"},
        WrongStudy{"WrongCaptures", "wrong_captures: [-0.1]\n", "wrong_captures[0]: a share from 0 to 1 is needed"},
        WrongStudy{"RobotNoiseKey", "robot_noise: {translation: 1 mm, rotaton: 1 deg}\n",
                   "robot_noise: 'rotation' is missing"},
        WrongStudy{"RobotModel", "robot_model: exakt\n", "robot_model: 'exakt' is unknown"},
        WrongStudy{"Scale", "target_shape: {scale_x: 3}\n", "target_shape.scale_x: must be from 0.5 to 2"},
        WrongStudy{"Bend", "target_shape: {bend_y: 101 mm}\n", "target_shape.bend_y: must be at most 100 mm"},
        WrongStudy{"ShapeKey", "target_shape: {bend_z: 1 mm}\n", "target_shape: unknown key 'bend_z'"},
        WrongStudy{"ShapeModel", "shape_model: bend\n", "shape_model: 'bend' is unknown; one of: none, auto"},
        WrongStudy{"Method", "methods: [tsay]\n", "methods[0]: 'tsay' is unknown"},
        WrongStudy{"RepeatedMethod", "methods: [tsai, park, tsai]\n", "methods[2]: 'tsai' is listed twice"},
        WrongStudy{"NoMethod", "methods: []\n", "methods: the list is empty"},
        WrongStudy{"RepeatedIntrinsics", "intrinsics: [focal, focal]\n", "intrinsics[1]: is listed twice"},
        WrongStudy{"Loss", "loss: hubber\n", "loss: 'hubber' is unknown"},
        WrongStudy{"Intrinsics", "intrinsics: [focus]\n", "intrinsics[0]: 'focus' is unknown"},
        WrongStudy{"VariedIntrinsics", "intrinsics: [[focal], [focus]]\n", "intrinsics[1][0]: 'focus' is unknown"},
        WrongStudy{"MixedIntrinsics", "intrinsics: [[focal], focal]\n", "intrinsics[1]: a list is needed"},
        WrongStudy{"EstimatorsWithoutACell", "estimators: [jointly]\n", "estimators: is for rigs; no scene has"},
        WrongStudy{"Estimator", "estimators: [joint]\n", "estimators[0]: 'joint' is unknown"},
        WrongStudy{"RepeatedEstimator", "estimators: [jointly, jointly]\n", "estimators[1]: is listed twice"}),
    [](const auto& wrong) { return wrong.param.name; });

TEST_F(StudyConfigTest, RefusesACameraThatMoves) {
  std::string scene = kScene;
  scene.replace(scene.find("motion: {"), 9, "moved: {from: 3, by: {translation: [1 mm, 0 mm, 0 mm]}}, motion: {");
  Write("noise.yaml", "scenes:\n  moved: " + scene);
  EXPECT_THAT(InputErrorOf([&] { ReadStudyConfig(folder_ / "noise.yaml"); }),
              HasSubstr("noise.yaml:2: scenes.moved: moves its camera during the captures, which a study does not"));
}

TEST_F(StudyConfigTest, NamesTheSceneThatDoesNotFit) {
  std::string scene = kScene;
  scene.replace(scene.find("motion: {"), 9, "motion: {distance: 100 mm, ");
  Write("noise.yaml", "scenes:\n  near: " + scene);
  EXPECT_THAT(InputErrorOf([&] { ReadStudyConfig(folder_ / "noise.yaml"); }),
              HasSubstr("noise.yaml:2: scenes.near: the target does not fit into the image"));
}

TEST_F(StudyConfigTest, NeedsAScene) {
  Write("noise.yaml", "scenes: {}\n");
  EXPECT_THAT(InputErrorOf([&] { ReadStudyConfig(folder_ / "noise.yaml"); }),
              HasSubstr("scenes: a mapping from names to scenes is needed"));
  Write("noise.yaml", "trials: 3\n");
  EXPECT_THAT(InputErrorOf([&] { ReadStudyConfig(folder_ / "noise.yaml"); }), HasSubstr("'scenes' is missing"));
}

}  // namespace
}  // namespace heba
