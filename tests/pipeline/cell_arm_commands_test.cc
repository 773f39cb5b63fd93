// The commands of the program with rigs whose arms have estimated errors.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <tuple>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/io/pose_file.h"
#include "tests/pipeline/cli.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using Json = nlohmann::json;
using testing::HasSubstr;
using testing::StartsWith;

constexpr size_t kNumPoints = 35;  // Each target has as many.

// A cell with two arms that have errors of their own, each with a target, and a fixed camera and one on the second arm.
// The captures are in one configuration of the first arm, and in several of the second, whose joints are recorded.
class CellArmCommandsTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new fs::path(TestFolder("rig_arm_commands"));
    WriteAll(
        *folder_ / "scene.yaml",
        "robots:\n"
        "  left: {model: ur10e, offsets: 0.05 deg, lengths: 0.3 mm, angles: 0.03 deg, configurations: one}\n"
        "  right:\n    world_from_base: {translation: [1300 mm, 100 mm, 0 mm], rpy: [0 deg, 0 deg, 170 deg]}\n"
        "    model: ur10e\n    offsets: 0.05 deg\n    lengths: 0.3 mm\n    angles: 0.03 deg\n"
        "    configurations: several\n"
        "cameras:\n"
        "  top:\n    mount: world\n"
        "    pose: {translation: [650 mm, 700 mm, 700 mm], rpy: [-110 deg, 0 deg, 180 deg]}\n"
        "    camera: &camera {model: brown5, image_size: [640, 480], fx: 600, fy: 600, cx: 320, cy: 240, distortion: "
        "[-0.08, 0.05, 0, 0, 0]}\n"
        "  wrist:\n    mount: right.gripper\n"
        "    pose: {translation: [60 mm, 0 mm, 40 mm], rpy: [5 deg, -5 deg, 90 deg]}\n    camera: *camera\n"
        "targets:\n"
        "  plate:\n    mount: left.gripper\n"
        "    pose: &held {translation: [0 mm, -50 mm, 80 mm], rpy: [90 deg, 0 deg, 0 deg]}\n"
        "    target: {type: charuco, rows: 6, columns: 8, square: 22 mm, marker: 16 mm, dictionary: DICT_4X4_250}\n"
        "  disk:\n    mount: right.gripper\n    pose: *held\n"
        "    target: {type: charuco, rows: 6, columns: 8, square: 22 mm, marker: 16 mm, dictionary: DICT_4X4_250, "
        "first_marker: 50}\n"
        "  wall:\n    mount: world\n    pose: {translation: [900 mm, -400 mm, 200 mm], rpy: [180 deg, 0 deg, 0 deg]}\n"
        "    target: {type: charuco, rows: 6, columns: 8, square: 30 mm, marker: 22 mm, dictionary: DICT_4X4_250, "
        "first_marker: 100}\n"
        "motion: {captures: 24, distance: 600 mm, tilt: 30 deg}\nimage: {noise: 2 grey}\n"
        "robot_noise: {translation: 0.02 mm, rotation: 0.004 deg}\nseed: 2\n");
    const CommandResult simulated = RunHeba({"simulate", Path("scene.yaml"), "--out", Path("cell"), "--quiet"});
    ASSERT_EQ(simulated.status, 0) << simulated.err;
    const CommandResult run = RunHeba({"run", Path("cell/config.yaml"), "--out", Path("run"), "--quiet", "--set",
                                       "evaluate.folds=0", "--set", "evaluate.truth=" + Path("cell/truth.json")});
    ASSERT_EQ(run.status, 0) << run.err;
  }
  static void TearDownTestSuite() { delete folder_; }
  static std::string Path(const std::string& name) { return (*folder_ / name).string(); }

  // Returns the numbers of a capture in a file of the cell.
  static std::string NumbersOf(const std::string& file, const std::string& image) {
    const std::string text = ReadAll(Path("cell/" + file));
    const size_t at = text.find("\n" + image + ",");
    if (at == std::string::npos) return "";
    const size_t begin = at + image.size() + 2;
    return text.substr(begin, text.find('\n', begin) - begin);
  }
  // Returns the first capture in which the camera on the wrist sees the whole wall.
  static std::string CaptureOfWall() {
    const Json result = Json::parse(ReadAll(Path("run/result.json")));
    for (const Json& entry : result["captures"]) {
      if (entry["camera"] != "wrist") continue;
      for (const Json& target : entry["targets"]) {
        if (target["target"] == "wall" && target["points"] == kNumPoints) return entry["capture"];
      }
    }
    return "";
  }
  static Json LocateWall(const std::vector<std::string>& flags) {
    const std::string image = CaptureOfWall();
    std::vector<std::string> words = {"locate", Path("run"), "wrist=" + Path("cell/wrist/" + image),
                                      "--pose=right=" + NumbersOf("right.csv", image), "--json"};
    words.insert(words.end(), flags.begin(), flags.end());
    const CommandResult located = RunHeba(words);
    EXPECT_EQ(located.status, 0) << located.err;
    return Json::parse(located.out);
  }
  static const Json& Wall(const Json& document) {
    const Json& targets = document["targets"];
    const auto wall = std::find_if(targets.begin(), targets.end(), [](const Json& t) { return t["target"] == "wall"; });
    CHECK(wall != targets.end());
    return *wall;
  }
  // Returns the distance of the located wall from the true one.
  static double ErrorMm(const Json& document) {
    const Json& at = Wall(document)["pose"]["translation_m"];
    return 1000 * std::hypot(at[0].get<double>() - 0.9, at[1].get<double>() + 0.4, at[2].get<double>() - 0.2);
  }

  static fs::path* folder_;
};
fs::path* CellArmCommandsTest::folder_ = nullptr;

TEST_F(CellArmCommandsTest, BothArmsAreEstimated) {
  const Json robots = Json::parse(ReadAll(Path("run/result.json")))["robots"];
  EXPECT_EQ(robots["left"]["robot"]["decision"], "estimated");
  EXPECT_EQ(robots["right"]["robot"]["decision"], "estimated");
  EXPECT_EQ(robots["right"]["robot"]["angles"], "recorded");
}

TEST_F(CellArmCommandsTest, LocateCorrectsThePoseOfTheArmThatCarriesTheCamera) {
  const std::string image = CaptureOfWall();
  const std::string joints = NumbersOf("right_joints.csv", image);
  const Json corrected = LocateWall({"--joints=right=" + joints});
  ASSERT_EQ(corrected["robots"].size(), 1U);
  const Json& right = corrected["robots"]["right"];
  EXPECT_EQ(right["arm"], "ur10e");
  EXPECT_EQ(right["reason"], "");
  EXPECT_FALSE(right["corrected"].is_null());
  // The captures are in several configurations: the pose alone does not tell the joints.
  const Json plain = LocateWall({});
  EXPECT_TRUE(plain["robots"]["right"]["corrected"].is_null());
  EXPECT_THAT(plain["robots"]["right"]["reason"].get<std::string>(), HasSubstr("several configurations"));
  EXPECT_EQ(plain["robots"]["right"]["stated"], right["stated"]);
  // Three sigmas of the position.
  double variance_mm2 = 0;
  for (const Json& sigma : Wall(corrected)["sigma"]["total"]["mm"]) variance_mm2 += std::pow(sigma.get<double>(), 2);
  EXPECT_LT(ErrorMm(corrected), 3 * std::sqrt(variance_mm2));
  EXPECT_LT(ErrorMm(corrected), 0.5 * ErrorMm(plain));
  const std::string wrist = "wrist=" + Path("cell/wrist/" + image);
  const std::string pose = "--pose=right=" + NumbersOf("right.csv", image);
  EXPECT_THAT(RunHeba({"locate", Path("run"), wrist, pose, "--joints=right=" + joints}).out,
              HasSubstr("the pose of the arm right was corrected by its estimated errors, by "));
  EXPECT_THAT(Unbroken(RunHeba({"locate", Path("run"), wrist, pose}).out),
              HasSubstr("the pose of the arm right was not corrected by its estimated errors, whose uncertainty is "));
}

// Each arm has the poses to command in its own base, and the joints of the arm that is named in its place.
TEST_F(CellArmCommandsTest, LocateStatesThePosesToCommand) {
  const std::string joints = "--joints=right=" + NumbersOf("right_joints.csv", CaptureOfWall());
  const Json located = Wall(LocateWall({joints, "--robot=right=ur10e"}));
  ASSERT_EQ(located["reach"].size(), 2U);
  // The captures of the first arm are in one configuration, and those of the second in several.
  const Json& left = located["reach"]["left"];
  EXPECT_EQ(left["command_reason"], "");
  EXPECT_TRUE(left["commands"].is_null());
  EXPECT_GT(left["command"]["sigma"]["total_mm"][0], 0);
  const Json& right = located["reach"]["right"];
  EXPECT_TRUE(right["command"].is_null());
  ASSERT_FALSE(right["commands"].empty());
  // The commands differ from the pose by the errors of the arm. The base of the second arm is not the world.
  constexpr double kMostMm = 10;
  for (const Json& command : right["commands"]) {
    if (command["reason"] != "") continue;
    EXPECT_GT(command["from_target_mm"], 0);
    EXPECT_LT(command["from_target_mm"], kMostMm);
    const double x_m = command["base_from_gripper"]["translation_m"][0];
    EXPECT_GT(std::abs(x_m - located["pose"]["translation_m"][0].get<double>()), 0.1);
  }
  const Json& postures = located["poses"][0]["postures"];
  ASSERT_EQ(postures.size(), 1U);
  EXPECT_EQ(postures["right"]["arm"], "ur10e");
  EXPECT_FALSE(postures["right"]["postures"].empty());
  // Without the joints of the pose, the target is located with an uncorrected pose.
  const Json plain = Wall(LocateWall({}));
  EXPECT_THAT(plain["reach"]["left"]["command_reason"].get<std::string>(), HasSubstr("a pose that was not corrected"));
  EXPECT_TRUE(plain["poses"][0]["postures"].empty());
}

TEST_F(CellArmCommandsTest, WrongJointsAreRefusedInOneLine) {
  const std::string image = CaptureOfWall();
  const std::string joints = NumbersOf("right_joints.csv", image);
  struct Call {
    std::string joints;
    std::string fault;
  };
  const Call calls[] = {{joints, "--joints: "},
                        {"left=" + joints, "--joints: the arm left carries none of the cameras"},
                        {"right=1,2", "--joints: 2 numbers; the arm ur10e has 6 joints"},
                        {"right=0,0,0,0,0,0", "--joints: arm right: the joints are not those of the pose"},
                        {"right=" + joints + ";right=" + joints, "--joints: the arm right is named twice"},
                        {"right=", "--joints: 'right=': ARM=NUMBERS is needed"},
                        {"rigth=" + joints, "--joints: 'rigth' is unknown"}};
  for (const Call& call : calls) {
    const CommandResult located = RunHeba({"locate", Path("run"), "wrist=" + Path("cell/wrist/" + image),
                                           "--pose=right=" + NumbersOf("right.csv", image), "--joints=" + call.joints});
    EXPECT_EQ(located.status, 2) << call.fault;
    EXPECT_THAT(located.err, StartsWith("heba: error: " + call.fault));
    EXPECT_EQ(std::count(located.err.begin(), located.err.end(), '\n'), 1) << located.err;
  }
}

TEST_F(CellArmCommandsTest, CorrectTakesTheArmByItsName) {
  const auto correct = [](const std::string& poses, const std::string& out, const std::vector<std::string>& flags) {
    std::vector<std::string> words = {"correct", Path("run"), poses, "--out", Path(out)};
    words.insert(words.end(), flags.begin(), flags.end());
    return RunHeba(words);
  };
  const CommandResult unnamed = correct(Path("cell/left.csv"), "none.csv", {});
  EXPECT_EQ(unnamed.status, 2);
  EXPECT_THAT(unnamed.err, HasSubstr("the rig has several arms, one of which is needed: left, right"));
  const CommandResult unknown = correct(Path("cell/left.csv"), "none.csv", {"--arm", "lefd"});
  EXPECT_EQ(unknown.status, 2);
  EXPECT_THAT(unknown.err, HasSubstr("--arm: 'lefd' is unknown; did you mean 'left'? One of: left, right"));
  EXPECT_FALSE(fs::exists(Path("none.csv")));

  const CommandResult left = correct(Path("cell/left.csv"), "left_true.csv", {"--arm", "left"});
  ASSERT_EQ(left.status, 0) << left.err;
  ASSERT_EQ(correct(Path("left_true.csv"), "left_back.csv", {"--arm", "left", "--inverse"}).status, 0);
  const PoseFormat& ros = *FindPoseFormat("ros");
  const std::vector<PoseRow> stated = ReadPoseFile(Path("cell/left.csv"), ros);
  const std::vector<PoseRow> corrected = ReadPoseFile(Path("left_true.csv"), ros);
  const std::vector<PoseRow> back = ReadPoseFile(Path("left_back.csv"), ros);
  ASSERT_EQ(back.size(), stated.size());
  double largest_m = 0;
  for (size_t i = 0; i < stated.size(); ++i) {
    EXPECT_LT(DistanceM(back[i].pose, stated[i].pose), 1e-8);
    EXPECT_LT(AngleRad(back[i].pose, stated[i].pose), 1e-8);
    largest_m = std::max(largest_m, DistanceM(corrected[i].pose, stated[i].pose));
  }
  EXPECT_GT(largest_m, 1e-4);

  // The poses of the other arm need its joints. With them, its pose is the one that `heba locate` states.
  const CommandResult without = correct(Path("cell/right.csv"), "none.csv", {"--arm", "right"});
  EXPECT_EQ(without.status, 1);
  EXPECT_THAT(without.err, HasSubstr("a pose alone does not tell the joints of the arm ur10e"));
  const std::string image = CaptureOfWall();
  const std::string joints = NumbersOf("right_joints.csv", image);
  WriteAll(Path("right_one.csv"),
           "x,y,z,qx,qy,qz,qw,j1,j2,j3,j4,j5,j6\n" + NumbersOf("right.csv", image) + "," + joints + "\n");
  ASSERT_EQ(correct(Path("right_one.csv"), "right_true.csv", {"--arm", "right"}).status, 0);
  const Rigid3d pose = ReadPoseFile(Path("right_true.csv"), ros, {"j1", "j2", "j3", "j4", "j5", "j6"}).front().pose;
  const Json located = LocateWall({"--joints=right=" + joints})["robots"]["right"]["corrected"]["translation_m"];
  for (Eigen::Index i = 0; i < 3; ++i) {
    EXPECT_NEAR(pose.translation[i], located[static_cast<size_t>(i)].get<double>(), 1e-12);
  }
}

TEST_F(CellArmCommandsTest, EachCalibratedArmIsExported) {
  for (const auto& [format, file, part] : {std::tuple{"robot_urdf", "robot.urdf", "flange_joint"},
                                           std::tuple{"ur_kinematics", "ur_kinematics.yaml", "forearm:"},
                                           std::tuple{"dh_csv", "arm_dh.csv", "joint,theta_rad"}}) {
    const CommandResult refused = RunHeba({"export", Path("run"), "--to", format});
    EXPECT_EQ(refused.status, 2) << format;
    EXPECT_THAT(refused.err, HasSubstr("each of the 2 arms has a file of its own; --out FOLDER is needed"));
    const CommandResult exported = RunHeba({"export", Path("run"), "--to", format, "--out", Path("arms")});
    ASSERT_EQ(exported.status, 0) << exported.err;
    const std::string left = ReadAll(Path("arms/left." + std::string(file)));
    EXPECT_THAT(left, HasSubstr(part));
    EXPECT_NE(left, ReadAll(Path("arms/right." + std::string(file))));
  }
}

// Errors of arms that were not estimated are stated as such, and the two results are compared.
TEST_F(CellArmCommandsTest, ArmsWithoutEstimatedErrorsAreRefused) {
  const CommandResult run = RunHeba({"run", Path("cell/config.yaml"), "--out", Path("plain"), "--quiet", "--set",
                                     "evaluate.folds=0", "--set", "refine.kinematics=none"});
  ASSERT_EQ(run.status, 0) << run.err;
  const CommandResult exported = RunHeba({"export", Path("plain"), "--to", "robot_urdf"});
  EXPECT_EQ(exported.status, 1);
  EXPECT_THAT(exported.err, HasSubstr("the kinematics of the arm left were not estimated (refine.kinematics is none); "
                                      "the kinematics of the arm right were not estimated"));
  const CommandResult corrected =
      RunHeba({"correct", Path("plain"), Path("cell/left.csv"), "--out", Path("none.csv"), "--arm", "left"});
  EXPECT_EQ(corrected.status, 1);
  EXPECT_THAT(corrected.err,
              HasSubstr("the kinematics of the arm left were not estimated (refine.kinematics is none)"));
  const std::string image = CaptureOfWall();
  const CommandResult located =
      RunHeba({"locate", Path("plain"), "wrist=" + Path("cell/wrist/" + image),
               "--pose=right=" + NumbersOf("right.csv", image), "--joints=right=0,0,0,0,0,0"});
  EXPECT_EQ(located.status, 2);
  EXPECT_THAT(located.err,
              HasSubstr("--joints: the run has not estimated the errors of the arm right; leave them out"));
  const CommandResult compared = RunHeba({"compare", Path("run"), Path("plain")});
  EXPECT_EQ(compared.status, 0) << compared.err;
  EXPECT_THAT(compared.out, HasSubstr("base of arm right in world"));
}

}  // namespace
}  // namespace heba
