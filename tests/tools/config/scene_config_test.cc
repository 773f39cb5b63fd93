#include "tools/config/scene_config.h"

#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "tests/support/input_error.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// The keys that every scene needs.
constexpr const char* kScene =
    "setup: eye_in_hand\n"
    "target: {type: chessboard, rows: 5, columns: 8, square: 20 mm}\n"
    "camera: {model: pinhole, image_size: [640, 480], fx: 600, fy: 601, cx: 320, cy: 240}\n"
    "hand_eye: {translation: [10 mm, 20 mm, 30 mm]}\n"
    "board: {translation: [400 mm, 0 mm, 50 mm], rpy: [0 deg, 0 deg, 90 deg]}\n";

SceneConfig Read(const std::string& more = "") { return ReadScene(ParseYaml(kScene + more, "scene.yaml")); }
std::string ErrorOf(const std::string& more) {
  return InputErrorOf([&] { Read(more); });
}

TEST(SceneConfigTest, ReadsWhatEverySceneStates) {
  const SceneConfig scene = Read();
  EXPECT_EQ(scene.setup, Setup::kEyeInHand);
  EXPECT_EQ(scene.targets[0].target->type(), "chessboard");
  EXPECT_EQ(scene.targets[0].target->points().size(), 40u);
  EXPECT_EQ(scene.targets[0].used["square"].as<std::string>(), "20 mm");
  EXPECT_EQ(scene.problem.cameras[0].camera.model, "pinhole");
  EXPECT_EQ(scene.problem.cameras[0].camera.width_px, 640);
  EXPECT_EQ(scene.problem.cameras[0].camera.height_px, 480);
  EXPECT_THAT(scene.problem.cameras[0].camera.params, ElementsAre(600, 601, 320, 240));
  EXPECT_THAT(HandEyeOf(scene).camera_mount_from_camera,
              IsNearPose(Rigid3d(Eigen::Quaterniond::Identity(), {0.01, 0.02, 0.03}), 1e-9, 1e-9));
  EXPECT_THAT(HandEyeOf(scene).target_mount_from_target,
              IsNearPose(Rigid3d(ExpRotation({0, 0, kPi / 2}), {0.4, 0, 0.05}), 1e-9, 1e-9));
}

TEST(SceneConfigTest, FillsInDefaults) {
  const SceneConfig scene = Read();
  EXPECT_EQ(scene.options.motion.num_captures, MotionOptions().num_captures);
  EXPECT_EQ(scene.options.motion.distance_m, MotionOptions().distance_m);
  EXPECT_EQ(scene.image.blur_sigma_px, RenderOptions().blur_sigma_px);
  EXPECT_EQ(scene.image.noise_sigma_grey, 0);
  EXPECT_EQ(scene.image.depth, GreyDepth::k8Bit);
  EXPECT_THAT(scene.targets[0].printed.params, ElementsAre(1, 1, 0, 0, 0, 0, 0, 0, 0));
  EXPECT_FALSE(scene.two_step.has_value());
  EXPECT_EQ(scene.options.robot_noise.rotation_rad, 0);
  EXPECT_EQ(scene.options.robot_noise.translation_m, 0);
  EXPECT_EQ(scene.pose_format.name, "ros");
  EXPECT_TRUE(scene.give_camera);
  EXPECT_EQ(scene.seed, 1u);
}

TEST(SceneConfigTest, ReadsTheMotion) {
  const MotionOptions motion =
      Read("motion: {captures: 7, distance: 450 mm, depth: 0.3, tilt: 20 deg, spin: 40 deg, spread: 0.1}\n")
          .options.motion;
  EXPECT_EQ(motion.num_captures, 7);
  EXPECT_DOUBLE_EQ(motion.distance_m, 0.45);
  EXPECT_DOUBLE_EQ(motion.depth_ratio, 0.3);
  EXPECT_DOUBLE_EQ(motion.max_tilt_rad, DegToRad(20));
  EXPECT_DOUBLE_EQ(motion.max_spin_rad, DegToRad(40));
  EXPECT_DOUBLE_EQ(motion.spread, 0.1);
}

TEST(SceneConfigTest, ReadsTheTwoStepMotion) {
  const SceneConfig scene = Read("motion: {captures: 0, two_step: {translation: 60 mm, turns: 5, angle: 12 deg}}\n");
  ASSERT_TRUE(scene.two_step.has_value());
  EXPECT_DOUBLE_EQ(scene.two_step->translation_m, 0.06);
  EXPECT_EQ(scene.two_step->num_turns, 5);
  EXPECT_DOUBLE_EQ(scene.two_step->max_turn_rad, DegToRad(12));
  EXPECT_EQ(scene.options.motion.num_captures, 0);
}

TEST(SceneConfigTest, ReadsTheImage) {
  const RenderOptions image = Read(
                                  "image: {blur: 1.5 px, noise: 3 grey, black: 10 grey, white: 240 grey, "
                                  "uneven_light: 0.25, clutter: true, bits: 16}\n")
                                  .image;
  EXPECT_DOUBLE_EQ(image.blur_sigma_px, 1.5);
  EXPECT_DOUBLE_EQ(image.noise_sigma_grey, 3);
  EXPECT_DOUBLE_EQ(image.black_grey, 10);
  EXPECT_DOUBLE_EQ(image.white_grey, 240);
  EXPECT_DOUBLE_EQ(image.light_gradient, 0.25);
  EXPECT_TRUE(image.clutter);
  EXPECT_EQ(image.depth, GreyDepth::k16Bit);
}

TEST(SceneConfigTest, ReadsThePrint) {
  const TargetShape shape =
      Read("print: {scale_x: 1.01, scale_y: 0.99, bend_x: 2 mm, bend_y: -1 mm}\n").targets[0].printed;
  EXPECT_THAT(shape.params, ElementsAre(1.01, 0.99, 2e-3, -1e-3, 0, 0, 0, 0, 0));
  // The bend is that of the rectangle of the points, 140 mm x 80 mm.
  EXPECT_NEAR(shape.half_size_m.x(), 0.07, 1e-12);
  EXPECT_NEAR(shape.half_size_m.y(), 0.04, 1e-12);
}

TEST(SceneConfigTest, ReadsTheRobot) {
  const SceneConfig scene = Read("robot_noise: {rotation: 0.1 deg, translation: 0.3 mm}\npose_format: kuka\n");
  EXPECT_DOUBLE_EQ(scene.options.robot_noise.rotation_rad, DegToRad(0.1));
  EXPECT_DOUBLE_EQ(scene.options.robot_noise.translation_m, 0.3e-3);
  EXPECT_EQ(scene.pose_format.name, "kuka");
}

TEST(SceneConfigTest, ReadsTheArm) {
  const SceneConfig scene = Read(
      "robot: {model: ur5e, offsets: 0.05 deg, lengths: 0.3 mm, angles: 0.03 deg, gravity: 2e-5 rad/(N m), "
      "joint_noise: 0.003 deg, configurations: one, record_joints: true}\nmotion: {captures: 5, repeats: 3}\n"
      "image: {noise: 2 grey}\n");
  ASSERT_TRUE(scene.arms[0].has_value());
  EXPECT_EQ(scene.arms[0]->nominal.name, "ur5e");
  EXPECT_DOUBLE_EQ(scene.arms[0]->sigmas.offset_rad, DegToRad(0.05));
  EXPECT_DOUBLE_EQ(scene.arms[0]->sigmas.length_m, 0.3e-3);
  EXPECT_DOUBLE_EQ(scene.arms[0]->sigmas.angle_rad, DegToRad(0.03));
  EXPECT_DOUBLE_EQ(scene.arms[0]->sigmas.compliance_rad_per_nm, 2e-5);
  EXPECT_DOUBLE_EQ(scene.arms[0]->joint_noise_rad, DegToRad(0.003));
  EXPECT_FALSE(scene.arms[0]->has_several_configurations);
  EXPECT_TRUE(scene.arms[0]->records_joints);
  EXPECT_EQ(scene.num_repeats, 3);
  EXPECT_EQ(Read("robot: {model: ur5e}\n").arms[0]->sigmas.compliance_rad_per_nm, 0);
  EXPECT_EQ(Read().num_repeats, 1);
}

// Each named camera and target states what the short form states of its only ones.
TEST(SceneConfigTest, NamedCamerasAndTargetsHaveTheKeysOfTheShortForm) {
  const SceneConfig scene = ReadScene(ParseYaml(
      "cameras: {left: {mount: world, pose: {translation: [1 m, 0 m, 0.5 m]}, camera: {model: pinhole, image_size: "
      "[640, 480], fx: 600, fy: 600, cx: 320, cy: 240}, moved: {from: 2, by: {translation: [1 mm, 0 mm, 0 mm]}}, "
      "creep: {translation: [0 mm, 2 mm, 0 mm]}}}\n"
      "targets: {plate: {mount: gripper, pose: {translation: [0 m, 0 m, 0.1 m]}, target: {type: chessboard, rows: 5, "
      "columns: 8, square: 20 mm}, print: {scale_x: 1.01, bend_y: 1 mm}}}\n"
      "motion: {captures: 5, repeats: 3}\nimage: {noise: 1 grey}\n",
      "scene.yaml"));
  EXPECT_FALSE(scene.setup.has_value());
  EXPECT_THAT(scene.targets[0].printed.params, ElementsAre(1.01, 1, 0, 1e-3, 0, 0, 0, 0, 0));
  EXPECT_EQ(scene.problem.targets[0].shape.params, TargetShape().params);
  EXPECT_EQ(scene.num_repeats, 3);
  ASSERT_EQ(scene.camera_motions.size(), 1U);
  const SceneConfig only =
      Read("moved: {from: 2, by: {translation: [1 mm, 0 mm, 0 mm]}}\ncreep: {translation: [0 mm, 2 mm, 0 mm]}\n");
  ASSERT_EQ(only.camera_motions.size(), 1U);
  for (const SceneConfig& each : {scene, only}) {
    EXPECT_EQ(each.camera_motions[0].first_capture, 2U);
    EXPECT_NEAR(each.camera_motions[0].before_from_after.translation.x(), 1e-3, 1e-12);
    ASSERT_EQ(each.camera_creeps.size(), 1U);
    EXPECT_NEAR(each.camera_creeps[0].change[1], 2e-3, 1e-12);
  }
}

TEST(SceneConfigTest, ReadsSeedAndGiveCamera) {
  const SceneConfig scene = Read("seed: 7\ngive_camera: false\n");
  EXPECT_EQ(scene.seed, 7u);
  EXPECT_FALSE(scene.give_camera);
}

// The scene as used states every default and names no files: reading it again gives the same scene.
TEST(SceneConfigTest, SceneAsUsedIsAFixedPoint) {
  const std::string motion = "motion: {captures: 1, tilt: 10 deg, two_step: {turns: 5}}\n";
  const std::string rest =
      "image: {bits: 16, noise: 2 grey}\nprint: {bend_x: 1 mm}\nrobot_noise: {translation: 0.1 mm}\n"
      "pose_format: kuka\ngive_camera: false\nseed: 7\n";
  for (const std::string& more : {std::string(), motion + rest}) {
    const SceneConfig scene = Read(more);
    const std::string used = YAML::Dump(scene.used);
    const SceneConfig again = ReadScene(ParseYaml(used, "used.yaml"));
    EXPECT_EQ(YAML::Dump(again.used), used);
    EXPECT_EQ(again.setup, scene.setup);
    EXPECT_EQ(again.problem.cameras[0].camera.params, scene.problem.cameras[0].camera.params);
    EXPECT_THAT(HandEyeOf(again).target_mount_from_target,
                IsNearPose(HandEyeOf(scene).target_mount_from_target, 1e-12, 1e-12));
    EXPECT_EQ(again.two_step.has_value(), scene.two_step.has_value());
    EXPECT_EQ(again.image.depth, scene.image.depth);
    EXPECT_EQ(again.pose_format.name, scene.pose_format.name);
    EXPECT_EQ(again.give_camera, scene.give_camera);
    EXPECT_EQ(again.seed, scene.seed);
  }
}

struct WrongScene {
  std::string name;
  std::string more;     // Lines after those of kScene, so the first is line 6 of the file.
  std::string message;  // The text after "scene.yaml:6: ".
};

class WrongSceneTest : public testing::TestWithParam<WrongScene> {};

TEST_P(WrongSceneTest, IsRefusedWithItsLineAndKey) {
  EXPECT_THAT(ErrorOf(GetParam().more), testing::StartsWith("scene.yaml:6: " + GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    UnknownKeys, WrongSceneTest,
    testing::Values(WrongScene{"Scene", "sed: 2\n", "unknown key 'sed'; did you mean 'seed'?"},
                    WrongScene{"Motion", "motion: {captrues: 3}\n",
                               "motion: unknown key 'captrues'; did you mean 'captures'?"},
                    WrongScene{"TwoStep", "motion: {two_step: {turn: 3}}\n",
                               "motion.two_step: unknown key 'turn'; did you mean 'turns'?"},
                    WrongScene{"Image", "image: {nois: 2 grey}\n", "image: unknown key 'nois'; did you mean 'noise'?"},
                    WrongScene{"Print", "print: {bend_z: 1 mm}\n", "print: unknown key 'bend_z'"},
                    WrongScene{"RobotNoise", "robot_noise: {rotaton: 1 deg}\n", "robot_noise: unknown key 'rotaton'"}),
    [](const auto& wrong) { return wrong.param.name; });

INSTANTIATE_TEST_SUITE_P(
    WrongValues, WrongSceneTest,
    testing::Values(
        WrongScene{"NoCaptures", "motion: {captures: 0}\n", "motion.captures: must be at least 1 without two_step"},
        WrongScene{"FractionalCaptures", "motion: {captures: 2.5}\n",
                   "motion.captures: a whole number is needed, not '2.5'"},
        WrongScene{"LengthWithoutUnit", "motion: {distance: 0.5}\n",
                   "motion.distance: '0.5' has no unit; write a length such as '40 mm'"},
        WrongScene{"ZeroDistance", "motion: {distance: 0 mm}\n", "motion.distance: must be greater than zero"},
        WrongScene{"WholeDepth", "motion: {depth: 1}\n", "motion: the depth ratio must be in [0, 1)"},
        WrongScene{"GrazingTilt", "motion: {tilt: 85 deg}\n", "motion: the tilt must be in [0, 85) deg"},
        WrongScene{"LargeSpread", "motion: {spread: 1.1}\n", "motion: the spread must be in [0, 1]"},
        WrongScene{"OneTurn", "motion: {two_step: {turns: 1}}\n", "motion.two_step.turns: 1 is out of range"},
        WrongScene{"NegativeTwoStepTranslation", "motion: {two_step: {translation: -60 mm}}\n",
                   "motion.two_step.translation: must be greater than zero"},
        WrongScene{"Blur", "image: {blur: 51 px}\n", "image: the blur must be from 0 to 50 px"},
        WrongScene{"Noise", "image: {noise: 300 grey}\n", "image: the noise must be from 0 to 255 grey"},
        WrongScene{"Black", "image: {black: -1 grey}\n", "image: black must be from 0 to 255 grey"},
        WrongScene{"UnevenLight", "image: {uneven_light: 1}\n",
                   "image: the uneven light must be at least 0 and less than 1"},
        WrongScene{"SeveralFaultsOfTheImage", "image: {noise: 300 grey, white: 256 grey}\n",
                   "image: the noise must be from 0 to 255 grey; white must be from 0 to 255 grey"},
        WrongScene{"SeveralFaultsOfTheMotion", "motion: {depth: 1, spread: 2}\n",
                   "motion: the depth ratio must be in [0, 1); the spread must be in [0, 1]"},
        WrongScene{"Clutter", "image: {clutter: yes}\n", "image.clutter: true or false is needed, not 'yes'"},
        WrongScene{"Bits", "image: {bits: 12}\n", "image.bits: '12' is unknown; did you mean '16'? One of: 8, 16"},
        WrongScene{"ManyBits", "image: {bits: 32}\n", "image.bits: '32' is unknown; "},
        WrongScene{"Scale", "print: {scale_y: 2.1}\n", "print.scale_y: must be from 0.5 to 2"},
        WrongScene{"RobotNoise", "robot_noise: {translation: 200 mm}\n",
                   "robot_noise.translation: must be at most 100 mm"},
        WrongScene{"GravityWithoutUnit", "robot: {model: ur5e, gravity: 2e-5}\n",
                   "robot.gravity: '2e-5' has no unit; write a compliance such as '2e-5 rad/(N m)'"},
        WrongScene{"NegativeGravity", "robot: {model: ur5e, gravity: -2e-5 rad/(N m)}\n",
                   "robot.gravity: must not be negative"},
        WrongScene{"GravityWithoutMasses", "robot: {model: abb_irb120, gravity: 2e-5 rad/(N m)}\n",
                   "robot.gravity: the masses of the links of the arm abb_irb120 are not known"},
        WrongScene{"NoRepeats", "motion: {repeats: 0}\n", "motion.repeats: 0 is out of range"},
        WrongScene{"RepeatsWithoutNoise", "motion: {repeats: 2}\n", "motion.repeats: needs image.noise"},
        WrongScene{"RepeatedTwoStep", "motion: {repeats: 2, two_step: {turns: 5}}\n",
                   "motion.repeats: cannot be combined with two_step"},
        WrongScene{"PoseFormat", "pose_format: kuke\n", "pose_format: 'kuke' is unknown"},
        WrongScene{"Seed", "seed: -1\n", "seed: -1 is out of range"}),
    [](const auto& wrong) { return wrong.param.name; });

// A larger bend would be a roll.
TEST(SceneConfigTest, ABendIsAtMostAQuarterOfTheSheetsShorterSide) {
  const SceneConfig scene = Read();
  const Drawing& sheet = scene.targets[0].target->Draw();
  const double most_mm = 250 * (sheet.max_m - sheet.min_m).minCoeff();
  const auto bend = [](const std::string& key, double bend_mm) {
    return "print: {" + key + ": " + Fixed(bend_mm, 3) + " mm}\n";
  };
  for (const std::string key : {"bend_x", "bend_y", "twist", "cubic_xxy"}) {
    EXPECT_EQ(ErrorOf(bend(key, 0.99 * most_mm)), "no error");
    EXPECT_EQ(ErrorOf(bend(key, -1.01 * most_mm)), "scene.yaml:6: print." + key + ": must be at most " +
                                                       Significant(most_mm, 3) +
                                                       " mm, a quarter of the sheet's shorter side");
  }
}

TEST(SceneConfigTest, RefusesAnUnknownSetup) {
  EXPECT_THAT(InputErrorOf([] { ReadScene(ParseYaml("setup: eye_on_hand\n", "scene.yaml")); }),
              HasSubstr("scene.yaml:1: setup: 'eye_on_hand' is unknown; did you mean 'eye_in_hand'? One of: "
                        "eye_to_hand, eye_in_hand"));
}

TEST(SceneConfigTest, NamesMissingKeys) {
  EXPECT_THAT(InputErrorOf([] { ReadScene(ParseYaml("seed: 1\n", "scene.yaml")); }), HasSubstr("'setup' is missing"));
}

class SceneFileTest : public testing::Test {
 protected:
  SceneFileTest() { Write("scene.yaml", std::string(kScene) + "motion: {captures: 7, distance: 450 mm}\n"); }
  void Write(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }

  TempFolder folder_;
};

TEST_F(SceneFileTest, SettingsCountMoreThanTheFileAndItsBase) {
  Write("next.yaml", "base: scene.yaml\nmotion: {captures: 9}\nseed: 3\n");
  const SceneConfig scene = ReadSceneConfig(folder_ / "next.yaml", {"seed=5"});
  EXPECT_EQ(scene.options.motion.num_captures, 9);
  EXPECT_DOUBLE_EQ(scene.options.motion.distance_m, 0.45);
  EXPECT_EQ(scene.seed, 5u);
}

// Another camera model has other coefficients, so they are not mixed with those of the base.
TEST_F(SceneFileTest, ACameraWithAModelReplacesThatOfTheBase) {
  Write("other.yaml", "base: scene.yaml\ncamera: {model: pinhole, image_size: [320, 240], fx: 300}\n");
  EXPECT_THAT(InputErrorOf([&] { ReadSceneConfig(folder_ / "other.yaml"); }), HasSubstr("'fy' is missing"));
  Write("same.yaml", "base: scene.yaml\ncamera: {fx: 300}\n");
  EXPECT_THAT(ReadSceneConfig(folder_ / "same.yaml").problem.cameras[0].camera.params, ElementsAre(300, 601, 320, 240));
}

TEST_F(SceneFileTest, TargetAndCameraMayBeFilesBesideTheScene) {
  Write("board.yaml", "{type: chessboard, rows: 3, columns: 4, square: 10 mm}\n");
  Write("camera.yaml", "{model: pinhole, image_size: [320, 240], fx: 300, fy: 300, cx: 160, cy: 120}\n");
  Write("files.yaml", "base: scene.yaml\ntarget: board.yaml\ncamera: camera.yaml\n");
  const SceneConfig scene = ReadSceneConfig(folder_ / "files.yaml");
  EXPECT_EQ(scene.targets[0].target->points().size(), 12u);
  EXPECT_EQ(scene.targets[0].used["square"].as<std::string>(), "10 mm");
  EXPECT_EQ(scene.problem.cameras[0].camera.width_px, 320);
}

TEST_F(SceneFileTest, RefusesACameraFileWithoutAnImageSize) {
  Write(
      "camera.yaml",
      "%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
      "   data: [ 300., 0., 160., 0., 300., 120., 0., 0., 1. ]\n"
      "distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: [ 0., 0., 0., 0., 0. ]\n");
  Write("files.yaml", "base: scene.yaml\ncamera: camera.yaml\n");
  EXPECT_THAT(InputErrorOf([&] { ReadSceneConfig(folder_ / "files.yaml"); }),
              HasSubstr("files.yaml:2: camera: the camera file has no image size; a simulated camera needs one"));
}

std::vector<std::string> RolesOf(const std::vector<SimulatedPose>& poses) {
  std::vector<std::string> roles;
  for (const SimulatedPose& pose : poses) roles.emplace_back(RoleName(pose.role));
  return roles;
}

TEST(SimulateScenePosesTest, FreeCapturesHaveNoRole) {
  Rng rng(1);
  const Outcome<std::vector<SimulatedPose>> poses = SimulateScenePoses(Read("motion: {captures: 3}\n"), rng);
  ASSERT_TRUE(poses) << poses.reason();
  EXPECT_THAT(RolesOf(*poses), ElementsAre("", "", ""));
}

TEST(SimulateScenePosesTest, TwoStepCapturesPrecedeFreeOnes) {
  Rng rng(1);
  const Outcome<std::vector<SimulatedPose>> poses = SimulateScenePoses(
      Read(
          "motion: {captures: 1, tilt: 10 deg, spread: 0.1, two_step: {translation: 20 mm, turns: 2, angle: 8 deg}}\n"),
      rng);
  ASSERT_TRUE(poses) << poses.reason();
  EXPECT_THAT(RolesOf(*poses), ElementsAre("home", "translate_x", "translate_y", "rotate", "rotate", "free"));
}

TEST(SimulateScenePosesTest, SaysThatTheTargetDoesNotFit) {
  Rng rng(1);
  const Outcome<std::vector<SimulatedPose>> poses =
      SimulateScenePoses(Read("motion: {captures: 1, distance: 100 mm}\n"), rng);
  EXPECT_THAT(poses.reason(), HasSubstr("the target does not fit into the image"));
}

}  // namespace
}  // namespace heba
