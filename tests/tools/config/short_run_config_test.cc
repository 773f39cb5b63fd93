// Tests of configs in the short form: tools/config/run_config.h.
#include "tools/config/run_config.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/data/hand_eye.h"
#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
using ::testing::HasSubstr;

// A data set of two poses, whose images are never opened here.
class ShortRunConfigTest : public testing::Test {
 protected:
  ShortRunConfigTest() {
    std::filesystem::create_directory(folder_ / "images");
    Write("images/a.png", "x");
    Write("images/b.png", "x");
    Write("poses.csv", "image,x,y,z,qx,qy,qz,qw\na.png,0,0,1,0,0,0,1\nb.png,0.1,0,1,0,0,0,1\n");
    Write("cell.yaml", kCell);
  }
  void Write(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }
  RunConfig Read(const std::string& name, const std::vector<std::string>& settings = {}) const {
    return ReadShortRunConfig(folder_ / name, settings);
  }
  std::string ErrorOf(const std::string& text) const {
    Write("wrong.yaml", text);
    return InputErrorOf([&] { Read("wrong.yaml"); });
  }

  static constexpr const char* kCell =
      "setup: eye_in_hand\n"
      "target: {type: chessboard, rows: 5, columns: 8, square: 20 mm}\n"
      "captures: {images: images, poses: poses.csv, pose_format: ros}\n";
  TempFolder folder_;
};

TEST_F(ShortRunConfigTest, GravityNeedsTheMassesOfTheLinks) {
  const std::string cell = kCell;
  const auto with = [&](const std::string& model, const std::string& parts) {
    return cell + "robot: {model: " + model + "}\nrefine: {kinematics: " + parts + "}\n";
  };
  Write("gravity.yaml", with("ur5e", "[offsets, geometry, gravity]"));
  EXPECT_EQ(Read("gravity.yaml").options.kinematics, Kinematics::kGravity);
  EXPECT_THAT(ErrorOf(with("ur30", "[offsets, geometry, gravity]")),
              HasSubstr("wrong.yaml:5: refine.kinematics: gravity needs the masses of the links of the arm ur30"));
  EXPECT_THAT(ErrorOf(with("ur5e", "[offsets, gravity]")), HasSubstr("gravity needs geometry beside it"));
  EXPECT_THAT(ErrorOf(with("ur5e", "[offsets, offsets]")), HasSubstr("'offsets' is listed twice"));
}

TEST_F(ShortRunConfigTest, OffsetOfAStreamIsEstimatedOrStated) {
  Write("images/1.png", "x");
  Write("images/2.png", "x");
  Write("robot.csv", "time,x,y,z,qx,qy,qz,qw\n0,0,0,1,0,0,0,1\n10,10,0,1,0,0,0,1\n");
  const std::string cell =
      "setup: eye_in_hand\n"
      "target: {type: chessboard, rows: 5, columns: 8, square: 20 mm}\n"
      "captures: {images: [images/1.png, images/2.png], stream: robot.csv, pose_format: ros}\n";
  Write("stream.yaml", cell);
  EXPECT_TRUE(Read("stream.yaml").options.estimates_time_offset);
  const RunConfig stated = Read("stream.yaml", {"refine.time_offset=0.5"});
  EXPECT_FALSE(stated.options.estimates_time_offset);
  EXPECT_NEAR(stated.data.captures[0].base_from_gripper[0].translation.x(), 1.5, 1e-9);
  EXPECT_THAT(ErrorOf(cell + "refine: {time_offset: soon}\n"), HasSubstr("neither auto nor a number of seconds"));
  EXPECT_THAT(ErrorOf(std::string(kCell) + "refine: {time_offset: auto}\n"), HasSubstr("there is no stream of poses"));
}

TEST_F(ShortRunConfigTest, TakesTheCameraOfAChainThatIsNamed) {
  const auto entry = [](const std::string& focal) {
    return "{intrinsics: [" + focal +
           ", 500, 320, 240], distortion_model: radtan, distortion_coeffs: [0.1, 0, 0, 0], "
           "resolution: [640, 480]}\n";
  };
  Write("chain.yaml", "cam0: " + entry("500") + "cam1: " + entry("510"));
  const std::string cell = kCell;
  Write("named.yaml", cell + "camera: {intrinsics: {file: chain.yaml, camera: cam1}}\n");
  const RunConfig named = Read("named.yaml");
  EXPECT_EQ(named.data.rig.cameras[0].camera.params[0], 510);
  EXPECT_EQ(named.data.rig.cameras[0].camera.model, "brown4");
  // The config as used names it too.
  Write("used.yaml", named.used);
  EXPECT_EQ(Read("used.yaml").data.rig.cameras[0].camera.params[0], 510);
  EXPECT_EQ(Read("named.yaml", {"camera.intrinsics.camera=cam0"}).data.rig.cameras[0].camera.params[0], 500);
  EXPECT_EQ(Read("named.yaml", {"camera.model=brown5"}).data.rig.cameras[0].camera.params.size(), 9U);
  EXPECT_THAT(ErrorOf(cell + "camera: {intrinsics: chain.yaml}\n"), HasSubstr("several cameras, cam0, cam1"));
  EXPECT_THAT(ErrorOf(cell + "camera: {intrinsics: {file: chain.yaml}}\n"),
              HasSubstr("wrong.yaml:4: camera.intrinsics: 'camera' is missing"));
  EXPECT_THAT(ErrorOf(cell + "camera: {intrinsics: {file: chain.yaml, camera: cam1, cam: 1}}\n"),
              HasSubstr("unknown key 'cam'"));
}

TEST_F(ShortRunConfigTest, RobotNoiseNamesItsModel) {
  const std::string cell = kCell;
  const auto with = [&](const std::string& noise, const std::string& robot = "") {
    Write("noise.yaml", cell + robot + "refine: {robot_noise: " + noise + "}\n");
    return Read("noise.yaml").options;
  };
  EXPECT_EQ(with("auto").calibration.smooth, SmoothPoseErrors::kAuto);
  EXPECT_EQ(with("white").calibration.adjustment.robot, BundleOptions::Robot::kEstimatedNoise);
  EXPECT_EQ(with("none").calibration.adjustment.robot, BundleOptions::Robot::kExact);
  EXPECT_EQ(with("white").calibration.smooth, SmoothPoseErrors::kNone);
  EXPECT_EQ(with("none").calibration.smooth, SmoothPoseErrors::kNone);
  EXPECT_EQ(with("{rotation: 0.02 deg, translation: 0.1 mm}").calibration.smooth, SmoothPoseErrors::kNone);
  const RunOptions smooth = with("smooth");
  EXPECT_EQ(smooth.calibration.smooth, SmoothPoseErrors::kAlways);
  EXPECT_EQ(smooth.calibration.adjustment.robot, BundleOptions::Robot::kEstimatedNoise);
  const RunOptions joints = with("{joints: auto}", "robot: {model: ur5e}\n");
  EXPECT_TRUE(joints.joint_noise);
  EXPECT_EQ(joints.calibration.adjustment.robot, BundleOptions::Robot::kEstimatedNoise);
  EXPECT_THAT(ErrorOf(cell + "refine: {robot_noise: {joints: auto}}\n"),
              HasSubstr("wrong.yaml:4: refine.robot_noise: the noise of joints needs an arm (robot.model)"));
  EXPECT_THAT(ErrorOf(cell + "refine: {robot_noise: smoth}\n"), HasSubstr("smooth"));
  EXPECT_THAT(ErrorOf(cell + "robot: {model: ur5e}\nrefine: {robot_noise: {joint: auto}}\n"),
              HasSubstr("{joints: auto}"));
}

TEST_F(ShortRunConfigTest, ReadsThePayload) {
  const std::string cell = kCell;
  Write("payload.yaml", cell + "robot: {model: ur5e, payload: {mass: 1.2 kg, centre: [0 mm, 10 mm, 80 mm]}}\n");
  const Arm arm = Read("payload.yaml").data.arms[0]->arm;
  EXPECT_DOUBLE_EQ(arm.load->links.back().mass_kg, 0.365 + 1.2);
  EXPECT_DOUBLE_EQ(arm.load->links.back().centre_m.y(), 1.2 * 0.01 / (0.365 + 1.2));
  EXPECT_THAT(ErrorOf(cell + "robot: {model: ur30, payload: {mass: 1.2 kg, centre: [0 m, 0 m, 0 m]}}\n"),
              HasSubstr("wrong.yaml:4: robot.payload: the masses of the links of the arm ur30 are not known"));
  EXPECT_THAT(ErrorOf(cell + "robot: {model: ur5e, payload: {mass: 1.2, centre: [0 m, 0 m, 0 m]}}\n"),
              HasSubstr("write a mass such as '1.2 kg'"));
}

TEST_F(ShortRunConfigTest, FillsInDefaults) {
  const RunConfig config = Read("cell.yaml");
  EXPECT_EQ(config.data.name, "cell");
  EXPECT_EQ(SetupOf(config.data.rig.cameras[0].mount), Setup::kEyeInHand);
  EXPECT_EQ(config.data.rig.cameras[0].name, "");
  EXPECT_EQ(config.data.captures.size(), 2u);
  EXPECT_EQ(config.options.calibration.adjustment.loss, LossKind::kTruncated);
  EXPECT_EQ(config.options.calibration.adjustment.robot, BundleOptions::Robot::kEstimatedNoise);
  EXPECT_TRUE(config.options.calibration.choose_target_shape);
  EXPECT_EQ(config.data.rig.cameras[0].camera.model, "");
  EXPECT_EQ(config.options.folds, 5);
  EXPECT_FALSE(config.data.has_camera[0]);
}

TEST_F(ShortRunConfigTest, PointsAreAGroupOfTheShape) {
  const RunConfig config = Read("cell.yaml", {"refine.target_shape=[bend, points]"});
  EXPECT_FALSE(config.options.calibration.choose_target_shape);
  EXPECT_EQ(
      config.data.rig.targets[0].free_shape,
      (std::vector<TargetShapeGroup>{TargetShapeGroup::kBend, TargetShapeGroup::kTwist, TargetShapeGroup::kPoints}));
}

TEST_F(ShortRunConfigTest, PointsOfASymmetricTargetAreRefused) {
  EXPECT_THAT(InputErrorOf([&] {
                Read("cell.yaml", {"refine.target_shape=[points]", "target.columns=9"});
              }),
              HasSubstr("refine.target_shape: the target looks the same in several orientations"));
}

TEST_F(ShortRunConfigTest, MethodsAreAllOrAList) {
  EXPECT_TRUE(Read("cell.yaml").options.methods.empty());
  EXPECT_THAT(Read("cell.yaml").used, HasSubstr("methods: all\n"));
  EXPECT_TRUE(Read("cell.yaml", {"methods=all"}).options.methods.empty());
  EXPECT_EQ(Read("cell.yaml", {"methods=[tsai, park]"}).options.methods, (std::vector<std::string>{"tsai", "park"}));
}

// The config as used states every default: reading it again gives the same config.
TEST_F(ShortRunConfigTest, ConfigAsUsedIsAFixedPoint) {
  const RunConfig config = Read("cell.yaml");
  Write("used.yaml", config.used);
  EXPECT_EQ(Read("used.yaml").used, config.used);
}

TEST_F(ShortRunConfigTest, SettingsCountMoreThanTheFileAndItsBase) {
  Write("next.yaml", "base: cell.yaml\nrefine: {loss: huber}\nevaluate: {folds: 3}\n");
  EXPECT_EQ(Read("next.yaml").options.calibration.adjustment.loss, LossKind::kHuber);
  const RunConfig config = Read("next.yaml", {"refine.loss=cauchy", "refine.robot_noise=none"});
  EXPECT_EQ(config.options.calibration.adjustment.loss, LossKind::kCauchy);
  EXPECT_EQ(config.options.folds, 3);
  EXPECT_EQ(config.options.calibration.adjustment.robot, BundleOptions::Robot::kExact);
}

TEST_F(ShortRunConfigTest, LeavesExcludedAndMissingImagesOut) {
  Write("poses.csv", "image,x,y,z,qx,qy,qz,qw\na.png,0,0,1,0,0,0,1\nb.png,0.1,0,1,0,0,0,1\ngone.png,0,0,1,0,0,0,1\n");
  Write("some.yaml", "base: cell.yaml\ncaptures: {exclude: [b.png]}\n");
  const RunConfig config = Read("some.yaml");
  ASSERT_EQ(config.data.captures.size(), 1u);
  EXPECT_EQ(config.data.captures[0].name, "a.png");
  EXPECT_EQ(config.data.left_out.size(), 2u);
}

// Keys that are set one by one are merged with those of a mapping, but not with those of a file.
TEST_F(ShortRunConfigTest, SingleKeysOfATargetFileCannotBeSet) {
  Write("sheet.yaml", "{type: chessboard, rows: 5, columns: 8, square: 20 mm}\n");
  Write("with_file.yaml",
        "setup: eye_in_hand\ntarget: sheet.yaml\ncaptures: {images: images, poses: poses.csv, pose_format: ros}\n");
  EXPECT_EQ(
      InputErrorOf([&] { Read("with_file.yaml", {"target.square=25 mm"}); }),
      "--set: target: the target is the file " + (folder_ / "sheet.yaml").string() + ", whose keys are edited there");
  EXPECT_EQ(Read("cell.yaml", {"target.square=25 mm"}).data.targets[0]->points()[1].in_target.x(), 0.025);
  EXPECT_EQ(Read("with_file.yaml", {"target={type: chessboard, rows: 5, columns: 8, square: 25 mm}"})
                .data.targets[0]
                ->points()[1]
                .in_target.x(),
            0.025);
}

TEST_F(ShortRunConfigTest, FaultsNameTheLineAndTheKey) {
  const std::string unknown = ErrorOf(std::string(kCell) + "refne: {}\n");
  EXPECT_THAT(unknown, HasSubstr("wrong.yaml:4: unknown key 'refne'"));
  EXPECT_THAT(unknown, HasSubstr("did you mean 'refine'"));
  EXPECT_THAT(ErrorOf(std::string(kCell) + "seed: tsay\n"), HasSubstr("did you mean 'tsai'"));
  EXPECT_THAT(ErrorOf(std::string(kCell) + "evaluate: {folds: 1}\n"), HasSubstr("evaluate.folds"));
  EXPECT_THAT(ErrorOf("target: {type: chessboard, rows: 5, columns: 8, square: 20 mm}\n"),
              HasSubstr("'captures' is missing"));
}

}  // namespace
}  // namespace heba
