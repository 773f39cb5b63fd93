#include "tools/config/run_config.h"

#include <limits>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/files.h"
#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"
#include "tools/config/scene_config.h"

namespace heba {
namespace {
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr const char* kTarget =
    "{type: charuco, rows: 6, columns: 8, square: 22 mm, marker: 16 mm, dictionary: DICT_4X4_250}";

// Two arms with poses that differ in x, and the images of two cameras, which are never opened here.
class RunConfigTest : public testing::Test {
 protected:
  RunConfigTest() {
    for (const char* camera : {"top", "side"}) {
      for (const char* image : {"1.png", "2.png", "3.png"}) Write(std::string(camera) + "/" + image, "x");
    }
    Write("cell.yaml",
          "robots:\n  left: {poses: left.csv}\n  right: {poses: right.csv}\n"
          "cameras:\n  top: {mount: world, images: top}\n  side: {mount: world, images: side}\n"
          "targets:\n  plate: {mount: left.gripper, target: " +
              std::string(kTarget) + "}\n");
  }

  void Write(const std::string& name, const std::string& text) {
    std::filesystem::create_directories((folder_ / name).parent_path());
    WriteFileAtomically(folder_ / name, text);
  }
  // Writes a poses file: each row has the texts of `columns`, and x.
  void WritePoses(const std::string& name, const std::string& columns,
                  const std::vector<std::pair<std::string, int>>& rows) {
    std::string text = (columns.empty() ? "" : columns + ",") + "x,y,z,qx,qy,qz,qw\n";
    for (const auto& [texts, x] : rows) {
      text += (texts.empty() ? "" : texts + ",") + std::to_string(x) + ",0,0,0,0,0,1\n";
    }
    Write(name, text);
  }
  RunConfig Read(const std::vector<std::string>& settings = {}) {
    return ReadRunConfig(folder_ / "cell.yaml", settings);
  }
  // Returns x of an arm in each capture.
  static std::vector<double> XOf(const RunConfig& config, size_t arm) {
    std::vector<double> all;
    for (const Recording& capture : config.data.captures) {
      all.push_back(capture.base_from_gripper[arm].translation.x());
    }
    return all;
  }
  static std::vector<std::string> LeftOutOf(const RunConfig& config) {
    std::vector<std::string> texts;
    for (const LeftOutImages& entry : config.data.left_out) texts.push_back(entry.name + ": " + entry.reason);
    return texts;
  }

  const TempFolder folder_;
};

TEST_F(RunConfigTest, SigmasOfACameraFileAreAPriorUnlessAKeySaysNone) {
  WritePoses("left.csv", "image", {{"1.png", 1}, {"2.png", 2}, {"3.png", 3}});
  WritePoses("right.csv", "image", {{"1.png", 10}, {"2.png", 20}, {"3.png", 30}});
  const std::string camera = "model: pinhole\nimage_size: [640, 480]\nfx: 600\nfy: 601\ncx: 320\ncy: 240\n";
  Write("plain.yaml", camera);
  Write("sigmas.yaml", camera + "std: {fx: 1.5, fy: 1.4, cx: 2.5, cy: 2.4}\n");
  const std::string plain = "cameras.top.intrinsics=" + (folder_ / "plain.yaml").string();
  const std::string with_sigmas = "cameras.side.intrinsics=" + (folder_ / "sigmas.yaml").string();
  const auto priors = [&](std::vector<std::string> settings) {
    settings.insert(settings.begin(), {plain, with_sigmas});
    const RunConfig config = Read(settings);
    std::vector<bool> has_prior;
    for (const ProblemCamera& of_rig : config.data.rig.cameras) has_prior.push_back(of_rig.prior.has_value());
    return has_prior;
  };
  const RunConfig config = Read({plain, with_sigmas});
  ASSERT_TRUE(config.data.rig.cameras[1].prior.has_value());
  EXPECT_THAT(config.data.rig.cameras[1].prior->params, ElementsAre(600, 601, 320, 240));
  EXPECT_THAT(config.data.rig.cameras[1].prior->sigmas, ElementsAre(1.5, 1.4, 2.5, 2.4));
  EXPECT_THAT(config.used, HasSubstr("intrinsics_prior: file"));
  EXPECT_THAT(priors({}), ElementsAre(false, true));
  EXPECT_THAT(priors({"refine.intrinsics_prior=file"}), ElementsAre(false, true));
  EXPECT_THAT(priors({"refine.intrinsics_prior=none"}), ElementsAre(false, false));
  EXPECT_THAT(priors({"cameras.side.refine.intrinsics_prior=none"}), ElementsAre(false, false));
  EXPECT_THAT(priors({"refine.intrinsics_prior=none", "cameras.side.refine.intrinsics_prior=file"}),
              ElementsAre(false, true));
  EXPECT_THAT(priors({"cameras.side.refine.intrinsics=[]"}), ElementsAre(false, false));
  EXPECT_THAT(
      InputErrorOf([&] { priors({"cameras.top.refine.intrinsics_prior=file"}); }),
      HasSubstr("cameras.top.refine.intrinsics_prior: needs sigmas, which " + (folder_ / "plain.yaml").string()));
  EXPECT_THAT(InputErrorOf([&] { Read({"cameras.top.refine.intrinsics_prior=file"}); }),
              HasSubstr("needs a camera file (cameras.top.intrinsics)"));
  EXPECT_THAT(InputErrorOf([&] { Read({"refine.intrinsics_prior=file"}); }),
              HasSubstr("refine.intrinsics_prior: no file of a camera with free intrinsics has sigmas (std)"));
  // The only prior may be switched off, and parameters that the file's model does not have are unknown.
  EXPECT_THAT(priors({"refine.intrinsics_prior=file", "cameras.side.refine.intrinsics_prior=none"}),
              ElementsAre(false, false));
  const RunConfig converted = Read({with_sigmas, "cameras.side.model=brown4"});
  ASSERT_TRUE(converted.data.rig.cameras[1].prior.has_value());
  constexpr double kUnknown = std::numeric_limits<double>::infinity();
  EXPECT_THAT(converted.data.rig.cameras[1].prior->sigmas,
              ElementsAre(1.5, 1.4, 2.5, 2.4, kUnknown, kUnknown, kUnknown, kUnknown));
}

TEST_F(RunConfigTest, RowsOfArmsBelongTogetherByTheColumnImage) {
  WritePoses("left.csv", "image", {{"1.png", 1}, {"2.png", 2}, {"3.png", 3}});
  WritePoses("right.csv", "image", {{"3.png", 30}, {"1.png", 10}, {"2.png", 20}});
  EXPECT_THAT(XOf(Read(), 1), ElementsAre(10, 20, 30));
}

TEST_F(RunConfigTest, AColumnOfTimesStatesTheOrder) {
  WritePoses("left.csv", "image,time", {{"1.png,30", 1}, {"2.png,10", 2}, {"3.png,20", 3}});
  WritePoses("right.csv", "image", {{"3.png", 30}, {"1.png", 10}, {"2.png", 20}});
  const RunConfig config = Read();
  EXPECT_THAT(XOf(config, 0), ElementsAre(2, 3, 1));
  EXPECT_THAT(XOf(config, 1), ElementsAre(20, 30, 10));
  EXPECT_EQ(config.data.captures.front().images[0].filename(), "2.png");
  EXPECT_EQ(config.arms[1].numbers.front().front(), 20);
}

TEST_F(RunConfigTest, RowsOfArmsBelongTogetherByTheColumnsOfTheCameras) {
  WritePoses("left.csv", "image.top,image.side", {{"1.png,2.png", 1}, {"2.png,3.png", 2}, {"3.png,1.png", 3}});
  WritePoses("right.csv", "image.top,image.side", {{"3.png,1.png", 30}, {"2.png,3.png", 20}, {"1.png,2.png", 10}});
  const RunConfig config = Read();
  EXPECT_THAT(XOf(config, 0), ElementsAre(1, 2, 3));
  EXPECT_THAT(XOf(config, 1), ElementsAre(10, 20, 30));
  EXPECT_THAT(LeftOutOf(config), IsEmpty());
}

// The first arm has no names, so that its rows have the images by order; the other names them.
TEST_F(RunConfigTest, RowsThatNameImagesBelongToThem) {
  WritePoses("left.csv", "", {{"", 1}, {"", 2}, {"", 3}});
  WritePoses("right.csv", "image", {{"3.png", 30}, {"2.png", 20}, {"1.png", 10}});
  EXPECT_THAT(XOf(Read(), 1), ElementsAre(10, 20, 30));
}

TEST_F(RunConfigTest, RowsWithoutNamesBelongTogetherByOrder) {
  WritePoses("left.csv", "image", {{"2.png", 2}, {"1.png", 1}, {"3.png", 3}});
  WritePoses("right.csv", "", {{"", 20}, {"", 10}, {"", 30}});
  EXPECT_THAT(XOf(Read(), 1), ElementsAre(20, 10, 30));
  WritePoses("right.csv", "", {{"", 20}, {"", 10}});
  EXPECT_THAT(InputErrorOf([&] { Read(); }), HasSubstr("right.csv: has 2 rows, but"));
}

TEST_F(RunConfigTest, RowsThatNameOtherImagesAreRefused) {
  WritePoses("left.csv", "image.top,image.side", {{"1.png,1.png", 1}, {"2.png,2.png", 2}});
  WritePoses("right.csv", "image.top,image.side", {{"1.png,1.png", 10}, {"3.png,3.png", 30}});
  EXPECT_THAT(InputErrorOf([&] { Read(); }),
              HasSubstr("right.csv: has no row for the capture 2.png of " + (folder_ / "left.csv").string()));
  WritePoses("right.csv", "image.top,image.side", {{"1.png,2.png", 10}, {"2.png,1.png", 20}});
  EXPECT_THAT(InputErrorOf([&] { Read(); }), HasSubstr("right.csv:2: names the image 2.png, but the capture of " +
                                                       (folder_ / "left.csv").string() + ":2 has 1.png"));
  WritePoses("right.csv", "image.top,image.side", {{"1.png,1.png", 10}, {"1.png,2.png", 20}});
  EXPECT_THAT(InputErrorOf([&] { Read(); }), HasSubstr("right.csv:3: names the image 1.png again, after"));
}

TEST_F(RunConfigTest, WhatBelongsToNoCaptureIsListed) {
  WritePoses("left.csv", "image", {{"1.png", 1}, {"2.png", 2}, {"9.png", 9}});
  WritePoses("right.csv", "image", {{"8.png", 80}, {"1.png", 10}, {"2.png", 20}});
  const RunConfig config = Read({"captures.exclude=[2.png]"});
  EXPECT_THAT(XOf(config, 1), ElementsAre(10));
  EXPECT_THAT(
      LeftOutOf(config),
      ElementsAre("top/3.png: the robot's pose is not in the poses file",
                  "side/3.png: the robot's pose is not in the poses file", "2.png: left out by captures.exclude",
                  "9.png: no camera has an image of it", "right.csv:2: the pose belongs to no capture of left.csv"));
  const LeftOutImages& excluded = config.data.left_out[2];
  EXPECT_EQ(excluded.capture, "2.png");
  EXPECT_THAT(excluded.images, ElementsAre(folder_ / "top/2.png", folder_ / "side/2.png"));
}

// Each file is named after the key that asks for it, and the likely name follows.
TEST_F(RunConfigTest, FilesThatDoNotExistAreNamedWithTheirKeys) {
  WritePoses("left.csv", "image", {{"1.png", 1}});
  WritePoses("right.csv", "image", {{"1.png", 10}});
  Write("missing.yaml",
        "robots:\n  left: {poses: left.csv}\n  right: {poses: rigth.csv}\n"
        "cameras:\n  top: {mount: world, images: top}\n"
        "targets:\n  plate: {mount: left.gripper, target: " +
            std::string(kTarget) + "}\n");
  const std::string folder = (folder_ / "").string();
  EXPECT_EQ(InputErrorOf([&] { ReadRunConfig(folder_ / "missing.yaml", std::vector<std::string>()); }),
            folder + "missing.yaml:3: robots.right.poses: " + folder +
                "rigth.csv: there is no such file; did you mean 'right.csv'?");
  for (const auto& [key, name] :
       {std::pair{"robots.left.poses", "none.csv"}, std::pair{"cameras.top.images", "none"},
        std::pair{"cameras.top.intrinsics", "none.yaml"}, std::pair{"cameras.top.intrinsics.file", "none.yaml"},
        std::pair{"targets.plate.target", "none.yaml"}}) {
    std::vector<std::string> settings = {std::string(key) + "=" + folder + name};
    if (std::string(key).ends_with(".file")) settings.emplace_back("cameras.top.intrinsics.camera=cam0");
    EXPECT_THAT(InputErrorOf([&] { Read(settings); }),
                testing::AllOf(testing::StartsWith("--set: " + std::string(key) + ": "), HasSubstr("there is no "),
                               HasSubstr(folder + name)));
  }
}

TEST_F(RunConfigTest, NamesThatMakeOneFrameAreRefused) {
  WritePoses("left.csv", "image", {{"1.png", 1}});
  WritePoses("right.csv", "image", {{"1.png", 10}});
  EXPECT_THAT(InputErrorOf([&] {
                Read({"cameras.side-a={mount: world, images: " + (folder_ / "side").string() + "}",
                      "cameras.side_a={mount: world, images: " + (folder_ / "side").string() + "}"});
              }),
              HasSubstr("by - and _ only"));
  EXPECT_THAT(
      InputErrorOf([&] { Read({"cameras.cameras={mount: world, images: " + (folder_ / "side").string() + "}"}); }),
      HasSubstr("cameras.cameras: a camera cannot have this name"));
}

// The base of the first arm is the world, in which the others move.
TEST_F(RunConfigTest, DriftsAreOfBodiesByTheirNames) {
  WritePoses("left.csv", "image", {{"1.png", 1}});
  WritePoses("right.csv", "image", {{"1.png", 10}});
  EXPECT_TRUE(Read().options.drift.is_tested);
  const RunConfig config = Read({"refine.drift=[right.base, side, plate]"});
  EXPECT_FALSE(config.options.drift.is_tested);
  ASSERT_EQ(config.options.drift.wanted.size(), 3U);
  EXPECT_EQ(config.options.drift.wanted[0], (DriftBody{DriftBody::Kind::kBase, 1}));
  EXPECT_EQ(config.data.rig.cameras[config.options.drift.wanted[1].index].name, "side");
  EXPECT_EQ(config.options.drift.wanted[2], (DriftBody{DriftBody::Kind::kTarget, 0}));
  EXPECT_THAT(config.used, HasSubstr("drift:\n    - right.base\n    - side\n    - plate\n"));
  EXPECT_THAT(InputErrorOf([&] { Read({"refine.drift=[left.base]"}); }), HasSubstr("refine.drift"));
  EXPECT_THAT(InputErrorOf([&] { Read({"refine.drift=[side, side]"}); }), HasSubstr("is listed twice"));
}

// Two arms with kinematics, of which the first has recorded joints.
class CellArmConfigTest : public RunConfigTest {
 protected:
  CellArmConfigTest() {
    WritePoses("left.csv", "image", {{"1.png", 1}, {"2.png", 2}, {"3.png", 3}});
    WritePoses("right.csv", "image", {{"1.png", 10}, {"2.png", 20}, {"3.png", 30}});
    Write("joints.csv", "image,j1,j2,j3,j4,j5,j6\n2.png,20,0,0,0,0,0\n1.png,10,0,0,0,0,0\n3.png,30,0,0,0,0,0\n");
  }

  // Returns the message about a config with these settings.
  std::string ErrorOf(const std::vector<std::string>& settings) {
    return InputErrorOf([&] { Read(settings); });
  }
  // The settings of the first arm's joints.
  std::vector<std::string> WithJoints(const std::vector<std::string>& more = {}) {
    std::vector<std::string> settings = {"robots.left.model=ur10e",
                                         "robots.left.joints=" + (folder_ / "joints.csv").string(),
                                         "robots.left.joint_angle=deg"};
    settings.insert(settings.end(), more.begin(), more.end());
    return settings;
  }
};

TEST_F(CellArmConfigTest, JointsBelongToTheRowsOfTheirArm) {
  const RunConfig config = Read(WithJoints({"robots.right.model=ur5e"}));
  ASSERT_EQ(config.data.captures.size(), 3);
  EXPECT_NEAR(config.data.captures[1].joints[0][0], 20 * std::numbers::pi / 180, 1e-12);
  EXPECT_THAT(config.data.captures[1].joints[1], IsEmpty());
  EXPECT_EQ(config.data.arms[0]->arm.name, "ur10e");
  EXPECT_EQ(config.data.arms[1]->arm.name, "ur5e");
  EXPECT_TRUE(config.arms[0].joints_are_deg);
  EXPECT_FALSE(config.arms[1].joints_are_deg);
  for (const std::optional<RobotArm>& arm : Read().data.arms) EXPECT_FALSE(arm);
}

TEST_F(CellArmConfigTest, ErrorsNameTheFileAndTheKeyOfTheArm) {
  EXPECT_THAT(ErrorOf({"robots.right.model=ur99"}),
              HasSubstr("robots.right.model: 'ur99' is unknown; did you mean 'ur3'? One of: ur3,"));
  EXPECT_THAT(ErrorOf({"robots.right.joints=" + (folder_ / "joints.csv").string()}),
              HasSubstr("robots.right.joints: needs an arm (robots.right.model)"));
  EXPECT_THAT(ErrorOf({"robots.right.model=ur5e", "robots.right.joint_angle=deg"}),
              HasSubstr("robots.right.joint_angle: needs a file of joints (robots.right.joints)"));
  EXPECT_THAT(ErrorOf({"robot.model=ur5e"}),
              HasSubstr("robot: with 'robots', the keys of an arm are beside its poses: robots.NAME.model"));
  EXPECT_THAT(ErrorOf({"refine.kinematics=[offsets]"}),
              HasSubstr("refine.kinematics: needs an arm (robots.NAME.model)"));
  EXPECT_THAT(ErrorOf(WithJoints({"robots.right.model=fanuc_m10ia", "refine.kinematics=[offsets, geometry, gravity]"})),
              HasSubstr("refine.kinematics: gravity needs the masses of the links of the arm fanuc_m10ia"));
  Write("joints.csv", "image,j1,j2,j3,j4,j5\n1.png,10,0,0,0,0\n2.png,20,0,0,0,0\n3.png,30,0,0,0,0\n");
  EXPECT_THAT(ErrorOf(WithJoints()), HasSubstr("joints.csv:1: column 'j6' is missing"));
  Write("joints.csv", "image,j1,j2,j3,j4,j5,j6\n1.png,10,0,0,0,0,0\n");
  EXPECT_THAT(ErrorOf(WithJoints()), HasSubstr("joints.csv: has no row for the capture 2.png"));
}

// The only arm of a config without `robots` is described as that of a single camera.
TEST_F(CellArmConfigTest, TheOnlyArmHasASectionOfItsOwn) {
  const std::vector<std::string> only = {"robots=", "captures.poses=" + (folder_ / "left.csv").string(),
                                         "targets.plate.mount=gripper"};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.begin(), only.begin(), only.end());
    return more;
  };
  const std::string joints = "captures.joints=" + (folder_ / "joints.csv").string();
  const RunConfig config = Read(with({"robot.model=ur10e", joints}));
  EXPECT_EQ(config.data.arms[0]->arm.name, "ur10e");
  EXPECT_EQ(config.data.captures[2].joints[0][0], 30);
  EXPECT_THAT(ErrorOf(with({joints})), HasSubstr("captures.joints: needs an arm (robot.model)"));
  EXPECT_THAT(ErrorOf(with({"captures.model=ur10e"})),
              HasSubstr("captures.model: the kinematics of the only arm are in a section of their own: robot.model"));
  EXPECT_THAT(ErrorOf(with({"robot.model=ur10e", "captures.joint_angle=deg"})),
              HasSubstr("captures.joint_angle: needs a file of joints (captures.joints)"));
  EXPECT_THAT(ErrorOf(with({"refine.kinematics=[offsets]"})),
              HasSubstr("refine.kinematics: needs an arm (robot.model)"));
}

// The file of a camera that is called config would be that of the data set's config.
TEST_F(RunConfigTest, ASceneHasNoCameraWithTheNameOfItsConfig) {
  Write(
      "scene.yaml",
      "cameras:\n  config:\n    mount: world\n    pose: {translation: [500 mm, 600 mm, 700 mm], rpy: [-110 deg, 0 deg, "
      "175 deg]}\n    camera: {model: pinhole, image_size: [640, 480], fx: 600, fy: 600, cx: 320, cy: 240}\n"
      "targets:\n  plate:\n    mount: gripper\n    pose: {translation: [0 mm, 0 mm, 80 mm], rpy: [0 deg, 0 deg, 0 "
      "deg]}\n    target: " +
          std::string(kTarget) + "\nmotion: {captures: 3, distance: 600 mm, tilt: 30 deg}\n");
  EXPECT_THAT(InputErrorOf([&] { ReadSceneConfig(folder_ / "scene.yaml"); }),
              HasSubstr("cameras.config: a camera cannot have this name"));
}

}  // namespace
}  // namespace heba
