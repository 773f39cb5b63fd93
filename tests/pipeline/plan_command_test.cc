// `heba plan`: poses for a cell and for a finished run.
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "tests/pipeline/cli.h"

namespace heba {
namespace {

namespace fs = std::filesystem;

using testing::HasSubstr;
using testing::Not;

constexpr const char* kCell =
    "setup: eye_in_hand\n"
    "target: {type: chessboard, rows: 6, columns: 9, square: 25 mm}\n"
    "robot: {model: ur5e}\n"
    "captures: {pose_format: ur}\n"
    "plan:\n"
    "  hand_eye: {translation: [0 mm, 60 mm, 50 mm]}\n"
    "  board: {translation: [500 mm, 50 mm, 0 mm], rpy: [180 deg, 0 deg, 30 deg]}\n"
    "  workspace: {box: [[200 mm, -300 mm, 200 mm], [800 mm, 400 mm, 900 mm]]}\n"
    "  lens: {focal_length: 8 mm, pixel: 3.45 um, image_size: [1920, 1200]}\n"
    "evaluate: {require: [{within: 3 mm}]}\n";

// An arm with three turns about the vertical and a slide keeps the gripper upright: the plan has poses that it reaches,
// and says what they leave open.
TEST(PlanCommandTest, PlansAnArmOfFourJoints) {
  const fs::path folder = TestFolder("plan_four_joints");
  const struct {
    const char* type;
    const char* origin;
    const char* axis;
    const char* limits;
  } joints[] = {{"revolute", "0 0 0.4", "0 0 1", "lower=\"-2.5\" upper=\"2.5\""},
                {"revolute", "0.25 0 0", "0 0 1", "lower=\"-2.5\" upper=\"2.5\""},
                {"prismatic", "0.25 0 0", "0 0 -1", "lower=\"0\" upper=\"0.2\""},
                {"revolute", "0 0 0", "0 0 -1", "lower=\"-3\" upper=\"3\""}};
  std::string urdf = "<robot name=\"scara\"><link name=\"link0\"/>\n";
  int number = 0;
  for (const auto& joint : joints) {
    const std::string parent = std::to_string(number++);
    const std::string n = std::to_string(number);
    urdf += "<link name=\"link" + n + "\"/><joint name=\"j" + n + "\" type=\"" + joint.type + "\"><parent link=\"link" +
            parent + "\"/><child link=\"link" + n + "\"/><origin xyz=\"" + joint.origin + "\"/><axis xyz=\"" +
            joint.axis + "\"/><limit " + joint.limits + " effort=\"1\" velocity=\"1\"/></joint>\n";
  }
  WriteAll(folder / "scara.urdf", urdf + "</robot>\n");
  WriteAll(folder / "cell.yaml",
           "setup: eye_in_hand\ntarget: {type: chessboard, rows: 6, columns: 9, square: 12 mm}\n"
           "robot: {model: scara.urdf}\nrefine: {intrinsics: []}\n"
           "plan:\n  hand_eye: {translation: [60 mm, 0 mm, 10 mm], rpy: [180 deg, 0 deg, 0 deg]}\n"
           "  board: {translation: [350 mm, 0 mm, 0 mm], rpy: [180 deg, 0 deg, 30 deg]}\n"
           "  workspace: {box: [[50 mm, -400 mm, 50 mm], [600 mm, 400 mm, 450 mm]]}\n"
           "  lens: {focal_length: 3 mm, pixel: 3 um, image_size: [1280, 720]}\n"
           "  uncertainty: {translation: 20 mm, rotation: 3 deg}\n");
  const CommandResult plan = RunHeba({"plan", (folder / "cell.yaml").string(), "--count", "8"});
  ASSERT_EQ(plan.status, 0) << plan.err;
  const std::vector<std::string> rows = Split(ReadAll(folder / "cell_plan.csv"), '\n');
  ASSERT_EQ(rows.size(), 13U);
  for (size_t i = 1; i < 12; ++i) {
    const std::vector<std::string> fields = Split(rows[i], ',');
    EXPECT_NEAR(std::stod(fields[4]), 0, 1e-6);
    EXPECT_NEAR(std::stod(fields[5]), 0, 1e-6);
  }
  EXPECT_EQ(Split(ReadAll(folder / "cell_plan_joints.csv"), '\n').size(), 13U);
  EXPECT_THAT(plan.out, testing::ContainsRegex(R"(hardly tell the camera's position along \[0.00, -?0.00, -?1.00\])"));
}

TEST(PlanCommandTest, PlansACell) {
  const fs::path folder = TestFolder("plan_cell");
  WriteAll(folder / "cell.yaml", kCell);
  const std::string cell = (folder / "cell.yaml").string();
  const CommandResult plan = RunHeba({"plan", cell, "--count", "10"});
  ASSERT_EQ(plan.status, 0) << plan.err;
  EXPECT_THAT(plan.out, HasSubstr("as 001.png"));
  EXPECT_THAT(plan.out, HasSubstr("after 10 captures a located target is expected to be known to"));
  EXPECT_THAT(plan.out, HasSubstr("captures are enough for 3.00 mm"));
  // The format of Universal Robots has no columns of quaternions.
  const std::string poses = ReadAll(folder / "cell_plan.csv");
  EXPECT_THAT(poses, HasSubstr("image,x,y,z,rx,ry,rz"));
  EXPECT_EQ(Split(poses, '\n').size(), 15U) << "a head, 13 rows and the end";
  EXPECT_EQ(Split(ReadAll(folder / "cell_plan_joints.csv"), '\n').size(), 15U);
  const std::string page = ReadAll(folder / "cell_plan.html");
  EXPECT_THAT(page, HasSubstr("expected image 013.png"));
  // The same file plans the same poses.
  ASSERT_EQ(RunHeba({"plan", cell, "--count", "10", "--out", (folder / "again.csv").string()}).status, 0);
  EXPECT_EQ(ReadAll(folder / "again.csv"), poses);
  // The second half is in another configuration, which is named, unless one is wanted.
  EXPECT_THAT(plan.out, HasSubstr("shoulder "));
  const CommandResult near = RunHeba(
      {"plan", cell, "--count", "10", "--set", "robot.joints_near=[0 deg,-90 deg,90 deg,-90 deg,-90 deg,0 deg]"});
  ASSERT_EQ(near.status, 0) << near.err;
  EXPECT_THAT(near.out, Not(HasSubstr("shoulder ")));
  const CommandResult two_step = RunHeba({"plan", cell, "--count", "10", "--procedure", "two_step"});
  ASSERT_EQ(two_step.status, 0) << two_step.err;
  EXPECT_THAT(two_step.out, HasSubstr("translate_x"));
}

// The first axis of a KR 6 ends at 170 deg, its wrist at 120 deg.
TEST(PlanCommandTest, PlansWithinTheLimitsOfTheJoints) {
  const fs::path folder = TestFolder("plan_limits");
  WriteAll(folder / "cell.yaml", kCell);
  const auto plan = [&](const std::string& board) {
    return RunHeba({"plan", (folder / "cell.yaml").string(), "--count", "10", "--set", "robot.model=kuka_kr6_r900",
                    "--set", "captures.pose_format=kuka", "--set", "plan.board.translation=" + board, "--set",
                    "plan.workspace={box: [[-800 mm, -300 mm, 200 mm], [800 mm, 400 mm, 900 mm]]}"});
  };
  // Behind the arm, the first joint would have to be near half a turn.
  for (const char* board : {"[500 mm, 50 mm, 0 mm]", "[-500 mm, 0 mm, 0 mm]"}) {
    SCOPED_TRACE(board);
    const CommandResult result = plan(board);
    ASSERT_EQ(result.status, 0) << result.err;
    const std::vector<std::string> rows = Split(ReadAll(folder / "cell_plan_joints.csv"), '\n');
    ASSERT_GT(rows.size(), 10U);
    for (size_t i = 1; i + 1 < rows.size(); ++i) {
      const std::vector<std::string> cells = Split(rows[i], ',');
      ASSERT_EQ(cells.size(), 7U) << rows[i];
      const auto degrees_of = [&](size_t joint) { return RadToDeg(std::stod(cells[joint])); };
      EXPECT_LE(std::abs(degrees_of(1)), 170) << rows[i];
      EXPECT_LE(degrees_of(2), 45) << rows[i];
      EXPECT_LE(std::abs(degrees_of(5)), 120) << rows[i];
    }
  }
}

TEST(PlanCommandTest, RefusesWhatItCannotPlan) {
  const fs::path folder = TestFolder("plan_refused");
  const auto refused = [&](const std::string& from, const std::string& to, int status, const std::string& message,
                           const std::vector<std::string>& arguments = {}) {
    std::string text = kCell;
    const size_t place = text.find(from);
    ASSERT_NE(place, std::string::npos) << from;
    text.replace(place, from.size(), to);
    WriteAll(folder / "cell.yaml", text);
    std::vector<std::string> all = {"plan", (folder / "cell.yaml").string()};
    all.insert(all.end(), arguments.begin(), arguments.end());
    const CommandResult plan = RunHeba(all);
    EXPECT_EQ(plan.status, status) << plan.out;
    EXPECT_THAT(plan.err, HasSubstr(message));
  };
  refused("800 mm, 400 mm, 900 mm", "210 mm, -290 mm, 210 mm", 1, "poses were found from which the camera sees");
  refused("  lens", "  lense", 2, "unknown key 'lense'; did you mean 'lens'?");
  refused("  hand_eye: {translation: [0 mm, 60 mm, 50 mm]}\n", "", 2, "hand_eye");
  refused("robot: {model: ur5e}\n", "", 0, "");
  // A box around the base has the first joint of every posture in it.
  refused("  lens", "  keep_out: [{box: [[-150 mm, -150 mm, 0 mm], [150 mm, 150 mm, 400 mm]]}]\n  lens", 0, "");
  refused("setup", "setup", 2, "--count needs a number from 1 to 500, not 0", {"--count", "0"});
  refused("setup", "setup", 2, "--procedure: must be two_step", {"--procedure", "dance"});
  refused("setup", "setup", 2, "has at least 5 poses", {"--procedure", "two_step", "--count", "4"});
  refused("setup", "setup", 2, "would replace the cell", {"--out", (folder / "cell.yaml").string()});
  refused("setup", "setup", 2, "would replace the poses", {"--out", (folder / "poses.html").string()});
  refused("image_size: [1920, 1200]", "image_size: [1920, 1200], depth_of_field: [10 m, 20 m]", 1,
          "none of which is within plan.lens.depth_of_field");
}

TEST(PlanCommandTest, AddsToAFinishedRun) {
  const fs::path folder = TestFolder("plan_run");
  const auto path = [&](const char* name) { return (folder / name).string(); };
  ASSERT_EQ(RunHeba({"simulate", std::string(HEBA_SOURCE_DIR) + "/configs/manual/cell.yaml", "--set",
                     "motion.captures=8", "--out", path("few"), "--quiet"})
                .status,
            0);
  ASSERT_EQ(RunHeba({"run", path("few/config.yaml"), "--out", path("run"), "--quiet"}).status, 0);
  const CommandResult plan = RunHeba({"plan", path("run"), "--count", "4"});
  ASSERT_EQ(plan.status, 0) << plan.err;
  // The images of the run are 000.png to 007.png, and its first poses are taken once more.
  EXPECT_THAT(plan.out, HasSubstr("008.png"));
  EXPECT_THAT(plan.out, HasSubstr("as 000.png"));
  EXPECT_THAT(plan.out, Not(HasSubstr("as 008.png")));
  const std::vector<std::string> rows = Split(ReadAll(folder / "run_plan.csv"), '\n');
  const std::vector<std::string> former = Split(ReadAll(folder / "few/poses.csv"), '\n');
  EXPECT_EQ(rows[5].substr(8, 6), former[1].substr(8, 6)) << "the first number of the first pose";
  const CommandResult wrong = RunHeba({"plan", path("run"), "--set", "plan.tilt=3 deg"});
  EXPECT_EQ(wrong.status, 2);
}

}  // namespace
}  // namespace heba
