// `heba check`: images of a later session against a finished run.
#include <cmath>
#include <regex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heba/base/text.h"
#include "tests/pipeline/cli.h"

namespace heba {
namespace {

using Json = nlohmann::json;
namespace fs = std::filesystem;
using testing::HasSubstr;

// Returns a text with one space in place of each line break and what stands around it.
std::string Unwrapped(const std::string& text) { return std::regex_replace(text, std::regex("\\s+"), " "); }

class CheckCommandTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder() = TestFolder("check_command");
    Simulate("first", {});
    ASSERT_EQ(RunHeba({"run", Path("first/config.yaml"), "--out", Path("run"), "--quiet"}).status, 0);
    Simulate("later", {"--set", "seed=6", "--set", "motion.captures=6"});
    Simulate("moved", {"--set", "seed=6", "--set", "motion.captures=6", "--set",
                       "hand_eye.translation=[823 mm, -140 mm, 611 mm]"});
  }
  static fs::path& folder() {
    static fs::path path;
    return path;
  }
  static std::string Path(const std::string& name) { return (folder() / name).string(); }
  static void Simulate(const std::string& name, const std::vector<std::string>& settings) {
    std::vector<std::string> arguments = {"simulate", std::string(HEBA_SOURCE_DIR) + "/configs/manual/cell.yaml",
                                          "--out", Path(name), "--quiet"};
    arguments.insert(arguments.end(), settings.begin(), settings.end());
    ASSERT_EQ(RunHeba(arguments).status, 0);
  }
  // Checks the run with the images of a data set and further arguments.
  static CommandResult Check(const std::string& name, const std::vector<std::string>& arguments, int num_images = 6) {
    std::vector<std::string> all = {"check", Path("run")};
    for (int i = 0; i < num_images; ++i) all.push_back(Path(name + "/images/00" + std::to_string(i) + ".png"));
    all.insert(all.end(), arguments.begin(), arguments.end());
    return RunHeba(all);
  }
};

TEST_F(CheckCommandTest, HoldsWhereNothingHasMoved) {
  for (const std::string target : {"in-place", "moved"}) {
    const CommandResult check = Check("later", {"--poses", Path("later/poses.csv"), "--target", target});
    EXPECT_EQ(check.status, 0) << check.err;
    EXPECT_THAT(check.out, HasSubstr("holds: 6 images agree with the calibration"));
    EXPECT_THAT(check.out, HasSubstr("smallest change that is seen in 95 %: the camera"));
  }
  const CommandResult json = Check("later", {"--poses", Path("later/poses.csv"), "--target", "in-place", "--json"});
  EXPECT_EQ(Json::parse(json.out)["decision"], "holds");
}

// A target of the same kind with larger squares is told by the motion of the robot; one with other markers by them.
TEST_F(CheckCommandTest, NamesAnotherTarget) {
  const std::string keys = "target={type: charuco, rows: 5, columns: 7, dictionary: DICT_4X4_50, ";
  Simulate("larger",
           {"--set", "seed=6", "--set", "motion.captures=4", "--set", keys + "square: 26 mm, marker: 18.72 mm}"});
  const CommandResult larger = Check("larger", {"--poses", Path("larger/poses.csv"), "--target", "in-place"}, 4);
  EXPECT_EQ(larger.status, 1);
  EXPECT_THAT(Unwrapped(larger.out), HasSubstr("the target is another one: its points are farther apart by 4.0 %"));
  const CommandResult json = Check("larger", {"--poses", Path("larger/poses.csv"), "--target", "moved", "--json"}, 4);
  const Json change = Json::parse(json.out)["change"];
  EXPECT_EQ(change["body"], "target");
  EXPECT_EQ(change["exchanged"], true);
  EXPECT_NEAR(change["scales"][0], 0.04, 0.003);
  Simulate("other", {"--set", "seed=6", "--set", "motion.captures=2", "--set",
                     keys + "square: 25 mm, marker: 18 mm, first_marker: 20}"});
  const CommandResult other = Check("other", {"--poses", Path("other/poses.csv"), "--target", "in-place"}, 2);
  EXPECT_EQ(other.status, 1);
  EXPECT_THAT(Unwrapped(other.err), HasSubstr("undecided: no target was detected in these images; they show: "
                                              "{type: charuco, rows: 5, columns: 7, square: SIZE"));
  EXPECT_THAT(Unwrapped(other.err), HasSubstr("first_marker: 20"));
}

// A camera and a target that stand still need no robot: earlier images of the target take its place.
TEST_F(CheckCommandTest, ReferenceImagesTakeThePlaceOfTheRobot) {
  const std::vector<std::string> settings = {"--set", "seed=6",
                                             "--set", "motion.captures=1",
                                             "--set", "motion.repeats=4",
                                             "--set", "robot_noise.translation=0 mm",
                                             "--set", "robot_noise.rotation=0 deg"};
  Simulate("still", settings);
  // The simulated target stands before the camera as it stood, but a little farther away.
  std::vector<std::string> knocked = settings;
  knocked.insert(knocked.end(), {"--set", "motion.distance=420.5 mm"});
  Simulate("knocked", knocked);
  const auto check = [&](const std::string& image, const std::vector<std::string>& arguments) {
    std::vector<std::string> all = {"check", Path("run"), Path(image)};
    all.insert(all.end(), arguments.begin(), arguments.end());
    return RunHeba(all);
  };
  const std::string reference = Path("still/images/000.png");
  const CommandResult holds = check("still/images/001.png", {"--reference", reference});
  EXPECT_EQ(holds.status, 0) << holds.err;
  EXPECT_THAT(holds.out, HasSubstr("holds: 1 image agrees"));
  const CommandResult moved = check("knocked/images/001.png", {"--reference", Path("still/images"), "--json"});
  EXPECT_EQ(moved.status, 1);
  const Json json = Json::parse(moved.out);
  EXPECT_EQ(json["decision"], "moved");
  double squares_mm2 = 0;
  for (const Json& mm : json["change"]["translation_mm"]) squares_mm2 += mm.get<double>() * mm.get<double>();
  EXPECT_GT(std::sqrt(squares_mm2), 0.3);
  EXPECT_LT(std::sqrt(squares_mm2), 1);
  EXPECT_THAT(moved.err, HasSubstr("do not tell this from a change of"));
  const CommandResult both = check("still/images/001.png", {"--reference", reference, "--poses", "poses.csv"});
  EXPECT_EQ(both.status, 2);
  EXPECT_THAT(both.err, HasSubstr("takes the place of the robot's poses"));
  EXPECT_THAT(check("still/images/001.png", {"--reference", Path("first")}).err, HasSubstr("contains no images"));
}

// The bend of a target is part of what a finished run says about it.
TEST_F(CheckCommandTest, KnowsABentTarget) {
  const std::vector<std::string> bend = {"--set", "print.bend_x=2 mm", "--set", "print.bend_y=-1 mm"};
  Simulate("bent", bend);
  ASSERT_EQ(RunHeba({"run", Path("bent/config.yaml"), "--out", Path("bent_run"), "--quiet"}).status, 0);
  Simulate("bent_later", {"--set", "seed=6", "--set", "motion.captures=6", "--set", bend[1], "--set", bend[3]});
  std::vector<std::string> arguments = {"check",    Path("bent_run"), "--poses", Path("bent_later/poses.csv"),
                                        "--target", "in-place"};
  for (int i = 0; i < 6; ++i) arguments.push_back(Path("bent_later/images/00" + std::to_string(i) + ".png"));
  const CommandResult check = RunHeba(arguments);
  EXPECT_EQ(check.status, 0) << check.err;
}

TEST_F(CheckCommandTest, NamesTheCameraThatHasMoved) {
  for (const std::string target : {"in-place", "moved"}) {
    const CommandResult check = Check("moved", {"--poses", Path("moved/poses.csv"), "--target", target, "--json"});
    EXPECT_EQ(check.status, 1);
    EXPECT_THAT(check.err, HasSubstr("heba: error: the calibration does not hold any more: the camera has moved by"));
    const Json json = Json::parse(check.out);
    EXPECT_EQ(json["decision"], "moved");
    EXPECT_EQ(json["body"], "camera");
    EXPECT_EQ(json["change"]["side"], "world");
    double squares_mm2 = 0;
    for (const Json& mm : json["change"]["translation_mm"]) squares_mm2 += mm.get<double>() * mm.get<double>();
    EXPECT_NEAR(std::sqrt(squares_mm2), std::sqrt(10.0), 1);
  }
}

TEST_F(CheckCommandTest, ATargetThatWasMountedAnewIsNoMove) {
  Simulate("anew", {"--set", "seed=6", "--set", "motion.captures=6", "--set",
                    "board.translation=[-20 mm, -40 mm, 95 mm]", "--set", "board.rpy=[3 deg, -2 deg, 60 deg]"});
  const CommandResult check = Check("anew", {"--poses", Path("anew/poses.csv"), "--target", "moved"});
  EXPECT_EQ(check.status, 0) << check.err;
}

TEST_F(CheckCommandTest, SaysThatPosesBelongToOtherImages) {
  std::vector<std::string> rows = Split(ReadAll(Path("later/poses.csv")), '\n');
  const auto rest = [](const std::string& row) { return row.substr(row.find(',')); };
  const std::string first = rest(rows[1]);
  rows[1] = "000.png" + rest(rows[2]);
  rows[2] = "001.png" + first;
  WriteAll(Path("swapped.csv"), Join(rows, "\n"));
  const CommandResult check = Check("later", {"--poses", Path("swapped.csv"), "--target", "in-place"});
  EXPECT_EQ(check.status, 1);
  EXPECT_THAT(check.err, HasSubstr("poses that belong to other images"));
}

using CheckCommandNightly = CheckCommandTest;

TEST_F(CheckCommandNightly, ChecksSeveralCameras) {
  const std::string scene = std::string(HEBA_SOURCE_DIR) + "/configs/rig/scene.yaml";
  for (const auto& [name, seed] : {std::pair("rig", "3"), std::pair("rig_later", "9")}) {
    ASSERT_EQ(RunHeba({"simulate", scene, "--set", "motion.captures=10", "--set", std::string("seed=") + seed, "--out",
                       Path(name), "--quiet"})
                  .status,
              0);
  }
  ASSERT_EQ(RunHeba({"run", Path("rig/config.yaml"), "--out", Path("rig_run"), "--quiet"}).status, 0);
  std::vector<std::string> arguments = {"check",    Path("rig_run"), "--poses", Path("rig_later/poses.csv"),
                                        "--target", "in-place",      "--json"};
  for (const char* camera : {"left", "right"}) {
    for (const char* image : {"000.png", "001.png", "002.png"}) {
      arguments.push_back(std::string(camera) + "=" + Path(std::string("rig_later/") + camera + "/" + image));
    }
  }
  const CommandResult check = RunHeba(arguments);
  EXPECT_EQ(check.status, 0) << check.err;
  EXPECT_EQ(Json::parse(check.out)["images"], 6);
}

// Two arms that carry a target each, before one camera. The second arm is moved.
TEST_F(CheckCommandTest, NamesTheBaseOfAnArmThatHasMoved) {
  const std::string lens =
      "{model: brown4, image_size: [640, 480], fx: 600, fy: 600, cx: 320, cy: 240, distortion: [-0.08, 0.05, 0, 0]}";
  const std::string target =
      "target: {type: charuco, rows: 5, columns: 7, square: 30 mm, marker: 22 mm, dictionary: DICT_4X4_250";
  WriteAll(
      folder() / "arms.yaml",
      "robots:\n  left: {}\n  right: {world_from_base: {translation: [1100 mm, 0 mm, 0 mm], rpy: [0 deg, 0 deg, 180 "
      "deg]}}\ncameras:\n  top:\n    mount: world\n    pose: {translation: [500 mm, 50 mm, 1300 mm], rpy: [180 deg, 0 "
      "deg, 0 deg]}\n    camera: " +
          lens +
          "\ntargets:\n  plate:\n    mount: left.gripper\n    pose: {translation: [0 mm, -50 mm, 80 mm], rpy: [0 deg, "
          "180 deg, 0 deg]}\n    " +
          target +
          "}\n  disk:\n    mount: right.gripper\n    pose: {translation: [0 mm, 30 mm, 80 mm], rpy: [0 deg, 180 deg, 0 "
          "deg]}\n    " +
          target +
          ", first_marker: 50}\nmotion: {captures: 16, distance: 700 mm, tilt: 30 deg}\nrobot_noise: {translation: "
          "0.1 mm, rotation: 0.02 deg}\nimage: {noise: 4 grey, blur: 0.7 px}\n");
  const auto simulate = [&](const std::string& name, const std::vector<std::string>& settings) {
    std::vector<std::string> arguments = {"simulate", Path("arms.yaml"), "--out", Path(name), "--quiet"};
    arguments.insert(arguments.end(), settings.begin(), settings.end());
    ASSERT_EQ(RunHeba(arguments).status, 0);
  };
  simulate("arms", {});
  ASSERT_EQ(RunHeba({"run", Path("arms/config.yaml"), "--out", Path("arms_run"), "--quiet", "--set",
                     "refine.robot_noise=white", "--set", "evaluate.folds=0"})
                .status,
            0);
  const std::vector<std::string> later = {"--set", "seed=7", "--set", "motion.captures=6"};
  simulate("arms_later", later);
  std::vector<std::string> moved = later;
  moved.insert(moved.end(), {"--set", "robots.right.world_from_base.translation=[1104 mm, 0 mm, 0 mm]"});
  simulate("arms_moved", moved);
  const auto check = [&](const std::string& name) {
    std::vector<std::string> arguments = {
        "check",    Path("arms_run"), "--target",
        "in-place", "--poses",        "left=" + Path(name + "/left.csv") + ";right=" + Path(name + "/right.csv")};
    for (int i = 0; i < 6; ++i) arguments.push_back("top=" + Path(name + "/top/00" + std::to_string(i) + ".png"));
    return RunHeba(arguments);
  };
  const CommandResult holds = check("arms_later");
  EXPECT_EQ(holds.status, 0) << holds.err;
  EXPECT_THAT(holds.out, HasSubstr("smallest change that is seen in 95 %: the base of arm right"));
  const CommandResult found = check("arms_moved");
  EXPECT_EQ(found.status, 1);
  EXPECT_THAT(found.err, HasSubstr("the base of arm right has moved by"));
}

TEST_F(CheckCommandTest, HistoryGrows) {
  const std::string history = Path("history");
  for (const std::string name : {"later", "moved"}) {
    Check(name, {"--poses", Path(name + "/poses.csv"), "--target", "in-place", "--history", history});
  }
  const Json checks = Json::parse(ReadAll(history + "/history.json"))["checks"];
  ASSERT_EQ(checks.size(), 2U);
  EXPECT_EQ(checks[0]["decision"], "holds");
  EXPECT_EQ(checks[1]["decision"], "moved");
  EXPECT_THAT(ReadAll(history + "/history.html"), HasSubstr("<circle"));
  WriteAll(history + "/history.json", "[]");
  const CommandResult check =
      Check("later", {"--poses", Path("later/poses.csv"), "--target", "in-place", "--history", history});
  EXPECT_EQ(check.status, 2);
  EXPECT_THAT(check.err, HasSubstr("is not a history of checks"));
}

TEST_F(CheckCommandTest, OneImageSeesAMoveButNotOfWhat) {
  const std::vector<std::string> rows = Split(ReadAll(Path("moved/poses.csv")), '\n');
  const std::string numbers = rows[1].substr(rows[1].find(',') + 1);
  const CommandResult check = Check("moved", {"--pose", numbers, "--target", "in-place"}, 1);
  EXPECT_EQ(check.status, 1);
  EXPECT_THAT(Unbroken(check.out), HasSubstr("the images do not tell this from a change of the "));
  // A target that was moved explains a single image.
  const CommandResult moved = Check("moved", {"--pose", numbers, "--target", "moved", "--json"}, 1);
  EXPECT_EQ(moved.status, 1);
  EXPECT_EQ(Json::parse(moved.out)["decision"], "undecided");
  EXPECT_THAT(moved.err, HasSubstr("heba: error: undecided: the images do not tell whether anything has moved"));
}

TEST_F(CheckCommandTest, RefusesWhatItCannotCheck) {
  const std::string poses = Path("later/poses.csv");
  const auto expect = [](const CommandResult& check, const std::string& message) {
    EXPECT_EQ(check.status, 2) << message;
    EXPECT_THAT(check.err, HasSubstr(message));
  };
  expect(Check("later", {"--poses", poses}), "--target in-place or moved is needed");
  expect(Check("later", {"--poses", poses, "--target", "in-plce"}), "did you mean 'in-place'?");
  expect(Check("later", {"--target", "moved"}), "the robot's poses at the images are needed");
  expect(Check("later", {"--pose", "0,0,0,0,0,0,1", "--target", "moved"}), "--pose: is the pose of one image");
  expect(Check("later", {"--poses", poses, "--target", "moved"}, 0), "takes RUN_DIR IMAGE...");
  WriteAll(Path("one_row.csv"), "image,x,y,z,qx,qy,qz,qw\n000.png,0,0,0,0,0,0,1\n");
  expect(Check("later", {"--poses", Path("one_row.csv"), "--target", "moved"}), "has no row for the image");
}

}  // namespace
}  // namespace heba
