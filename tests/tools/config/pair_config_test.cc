#include "tools/config/pair_config.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
using ::testing::HasSubstr;

// A data set of two poses, whose images are never opened here.
class PairConfigTest : public testing::Test {
 protected:
  PairConfigTest() {
    std::filesystem::create_directory(folder_ / "images");
    Write("images/a.png", "x");
    Write("images/b.png", "x");
    Write("poses.csv", "image,x,y,z,qx,qy,qz,qw\na.png,0,0,1,0,0,0,1\nb.png,0.1,0,1,0,0,0,1\n");
    Write("cell.yaml", kCell);
  }
  void Write(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }
  PairConfig Read(const std::string& name, const std::vector<std::string>& settings = {}) const {
    return ReadPairConfig(folder_ / name, settings);
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

TEST_F(PairConfigTest, GravityNeedsTheMassesOfTheLinks) {
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

TEST_F(PairConfigTest, TakesTheCameraOfAChainThatIsNamed) {
  const auto entry = [](const std::string& focal) {
    return "{intrinsics: [" + focal +
           ", 500, 320, 240], distortion_model: radtan, distortion_coeffs: [0.1, 0, 0, 0], "
           "resolution: [640, 480]}\n";
  };
  Write("chain.yaml", "cam0: " + entry("500") + "cam1: " + entry("510"));
  const std::string cell = kCell;
  Write("named.yaml", cell + "camera: {intrinsics: {file: chain.yaml, camera: cam1}}\n");
  const PairConfig named = Read("named.yaml");
  EXPECT_EQ(named.data.camera->params[0], 510);
  EXPECT_EQ(named.data.camera->model, "brown4");
  // The config as used names it too.
  Write("used.yaml", named.used);
  EXPECT_EQ(Read("used.yaml").data.camera->params[0], 510);
  EXPECT_EQ(Read("named.yaml", {"camera.intrinsics.camera=cam0"}).data.camera->params[0], 500);
  EXPECT_EQ(Read("named.yaml", {"camera.model=brown5"}).data.camera->params.size(), 9U);
  EXPECT_THAT(ErrorOf(cell + "camera: {intrinsics: chain.yaml}\n"), HasSubstr("several cameras, cam0, cam1"));
  EXPECT_THAT(ErrorOf(cell + "camera: {intrinsics: {file: chain.yaml}}\n"),
              HasSubstr("wrong.yaml:4: camera.intrinsics: 'camera' is missing"));
  EXPECT_THAT(ErrorOf(cell + "camera: {intrinsics: {file: chain.yaml, camera: cam1, cam: 1}}\n"),
              HasSubstr("unknown key 'cam'"));
}

TEST_F(PairConfigTest, RobotNoiseNamesItsModel) {
  const std::string cell = kCell;
  const auto with = [&](const std::string& noise, const std::string& robot = "") {
    Write("noise.yaml", cell + robot + "refine: {robot_noise: " + noise + "}\n");
    return Read("noise.yaml").options;
  };
  EXPECT_EQ(with("auto").smooth, SmoothPoseErrors::kAuto);
  EXPECT_TRUE(with("white").choose.robot_noise);
  EXPECT_EQ(with("white").smooth, SmoothPoseErrors::kNone);
  EXPECT_EQ(with("none").smooth, SmoothPoseErrors::kNone);
  EXPECT_EQ(with("{rotation: 0.02 deg, translation: 0.1 mm}").smooth, SmoothPoseErrors::kNone);
  const PairRunOptions smooth = with("smooth");
  EXPECT_EQ(smooth.smooth, SmoothPoseErrors::kAlways);
  EXPECT_FALSE(smooth.choose.robot_noise);
  EXPECT_EQ(smooth.bundle.robot, BundleOptions::Robot::kEstimatedNoise);
  const PairRunOptions joints = with("{joints: auto}", "robot: {model: ur5e}\n");
  EXPECT_TRUE(joints.joint_noise);
  EXPECT_EQ(joints.bundle.robot, BundleOptions::Robot::kEstimatedNoise);
  EXPECT_THAT(ErrorOf(cell + "refine: {robot_noise: {joints: auto}}\n"),
              HasSubstr("wrong.yaml:4: refine.robot_noise: the noise of joints needs an arm (robot.model)"));
  EXPECT_THAT(ErrorOf(cell + "refine: {robot_noise: smoth}\n"), HasSubstr("smooth"));
  EXPECT_THAT(ErrorOf(cell + "robot: {model: ur5e}\nrefine: {robot_noise: {joint: auto}}\n"),
              HasSubstr("{joints: auto}"));
}

TEST_F(PairConfigTest, ReadsThePayload) {
  const std::string cell = kCell;
  Write("payload.yaml", cell + "robot: {model: ur5e, payload: {mass: 1.2 kg, centre: [0 mm, 10 mm, 80 mm]}}\n");
  const Arm arm = Read("payload.yaml").data.robot->arm;
  EXPECT_DOUBLE_EQ(arm.load->links.back().mass_kg, 0.365 + 1.2);
  EXPECT_DOUBLE_EQ(arm.load->links.back().centre_m.y(), 1.2 * 0.01 / (0.365 + 1.2));
  EXPECT_THAT(ErrorOf(cell + "robot: {model: ur30, payload: {mass: 1.2 kg, centre: [0 m, 0 m, 0 m]}}\n"),
              HasSubstr("wrong.yaml:4: robot.payload: the masses of the links of the arm ur30 are not known"));
  EXPECT_THAT(ErrorOf(cell + "robot: {model: ur5e, payload: {mass: 1.2, centre: [0 m, 0 m, 0 m]}}\n"),
              HasSubstr("write a mass such as '1.2 kg'"));
}

TEST_F(PairConfigTest, FillsInDefaults) {
  const PairConfig config = Read("cell.yaml");
  EXPECT_EQ(config.data.name, "cell");
  EXPECT_EQ(config.data.setup, Setup::kEyeInHand);
  EXPECT_EQ(config.data.captures.size(), 2u);
  EXPECT_EQ(config.options.bundle.loss, LossKind::kTruncated);
  EXPECT_TRUE(config.options.choose.robot_noise);
  EXPECT_TRUE(config.options.choose.target_shape);
  EXPECT_TRUE(config.options.choose_camera_model);
  EXPECT_EQ(config.options.folds, 5);
  EXPECT_FALSE(config.data.camera.has_value());
}

TEST_F(PairConfigTest, MethodsAreAllOrAList) {
  EXPECT_TRUE(Read("cell.yaml").options.methods.empty());
  EXPECT_THAT(Read("cell.yaml").used, HasSubstr("methods: all\n"));
  EXPECT_TRUE(Read("cell.yaml", {"methods=all"}).options.methods.empty());
  EXPECT_EQ(Read("cell.yaml", {"methods=[tsai, park]"}).options.methods, (std::vector<std::string>{"tsai", "park"}));
}

// The config as used states every default: reading it again gives the same config.
TEST_F(PairConfigTest, ConfigAsUsedIsAFixedPoint) {
  const PairConfig config = Read("cell.yaml");
  Write("used.yaml", config.used);
  EXPECT_EQ(Read("used.yaml").used, config.used);
}

TEST_F(PairConfigTest, SettingsCountMoreThanTheFileAndItsBase) {
  Write("next.yaml", "base: cell.yaml\nrefine: {loss: huber}\nevaluate: {folds: 3}\n");
  EXPECT_EQ(Read("next.yaml").options.bundle.loss, LossKind::kHuber);
  const PairConfig config = Read("next.yaml", {"refine.loss=cauchy", "refine.robot_noise=none"});
  EXPECT_EQ(config.options.bundle.loss, LossKind::kCauchy);
  EXPECT_EQ(config.options.folds, 3);
  EXPECT_FALSE(config.options.choose.robot_noise);
}

TEST_F(PairConfigTest, LeavesExcludedAndMissingImagesOut) {
  Write("poses.csv", "image,x,y,z,qx,qy,qz,qw\na.png,0,0,1,0,0,0,1\nb.png,0.1,0,1,0,0,0,1\ngone.png,0,0,1,0,0,0,1\n");
  Write("some.yaml", "base: cell.yaml\ncaptures: {exclude: [b.png]}\n");
  const PairConfig config = Read("some.yaml");
  ASSERT_EQ(config.data.captures.size(), 1u);
  EXPECT_EQ(config.data.captures[0].name, "a.png");
  EXPECT_EQ(config.data.left_out.size(), 2u);
}

// Keys that are set one by one are merged with those of a mapping, but not with those of a file.
TEST_F(PairConfigTest, SingleKeysOfATargetFileCannotBeSet) {
  Write("sheet.yaml", "{type: chessboard, rows: 5, columns: 8, square: 20 mm}\n");
  Write("with_file.yaml",
        "setup: eye_in_hand\ntarget: sheet.yaml\ncaptures: {images: images, poses: poses.csv, pose_format: ros}\n");
  EXPECT_EQ(
      InputErrorOf([&] { Read("with_file.yaml", {"target.square=25 mm"}); }),
      "--set: target: the target is the file " + (folder_ / "sheet.yaml").string() + ", whose keys are edited there");
  EXPECT_EQ(Read("cell.yaml", {"target.square=25 mm"}).data.target->points()[1].in_target.x(), 0.025);
  EXPECT_EQ(Read("with_file.yaml", {"target={type: chessboard, rows: 5, columns: 8, square: 25 mm}"})
                .data.target->points()[1]
                .in_target.x(),
            0.025);
}

TEST_F(PairConfigTest, FaultsNameTheLineAndTheKey) {
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
