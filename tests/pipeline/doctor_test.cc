// Runs the doctor on data sets that were spoiled on purpose, for which it must name the cause first, and on good
// ones, in which it must find nothing wrong.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/spoilings.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

constexpr double kMinShare = 0.95;

struct Cell {
  std::string name;
  std::string setup;
  std::string target;  // YAML text.
  std::string length_key;
  double length_mm;
  int rows;
  int columns;
};

std::string SceneText(const std::string& setup, const std::string& target, const std::string& motion) {
  const bool is_carried = setup == "eye_in_hand";
  const std::string far_pose = "{translation: [620 mm, -140 mm, 510 mm], rpy: [-118 deg, 4 deg, 62 deg]}";
  const std::string near_pose = "{translation: [45 mm, -30 mm, 95 mm], rpy: [3 deg, -12 deg, 15 deg]}";
  return "setup: " + setup + "\ntarget: " + target +
         "\ncamera: {model: brown5, image_size: [960, 720], fx: 1050, fy: 1052, cx: 484, cy: 355, distortion: [-0.1, "
         "0.08, 0.0004, -0.0006, 0.0]}\nhand_eye: " +
         (is_carried ? near_pose : far_pose) + "\nboard: " + (is_carried ? far_pose : near_pose) +
         "\nmotion: " + motion +
         "\nimage: {blur: 0.7 px, noise: 2 grey, uneven_light: 0.3}\n"
         "robot_noise: {translation: 0.1 mm, rotation: 0.02 deg}\nseed: 5\n";
}

constexpr const char* kFreeMotion =
    "{captures: 14, distance: 450 mm, depth: 0.25, tilt: 30 deg, spin: 45 deg, spread: 0.4}";

GoodSet Render(const Cell& cell, const fs::path& folder) {
  WriteAll(folder / (cell.name + ".yaml"), SceneText(cell.setup, cell.target, kFreeMotion));
  const CommandResult result = RunHeba(
      {"simulate", (folder / (cell.name + ".yaml")).string(), "--out", (folder / cell.name).string(), "--quiet"});
  EXPECT_EQ(result.status, 0) << result.err;
  GoodSet good;
  good.name = cell.name;
  good.config = folder / cell.name / "config.yaml";
  good.poses = folder / cell.name / "poses.csv";
  good.images = folder / cell.name / "images";
  good.camera = folder / cell.name / "camera.yaml";
  good.target_type = cell.name.substr(0, cell.name.find('.'));
  good.length_key = cell.length_key;
  good.length_mm = cell.length_mm;
  good.rows = cell.rows;
  good.columns = cell.columns;
  good.setup = *FindSetup(cell.setup);
  return good;
}

class DoctorTest : public testing::TestWithParam<Cell> {};

TEST_P(DoctorTest, NamesTheCauseFirst) {
  const fs::path folder = TestFolder("doctor_" + GetParam().name);
  const GoodSet good = Render(GetParam(), folder);
  const SpoilingScore score =
      ScoreDoctor(good, folder / "work", GetParam().name == "chessboard", GetParam().name.size(), Stride(4));
  std::cout << good.name << ": " << score.num_right << " of " << score.num_all << std::endl;
  EXPECT_GE(score.num_right, kMinShare * score.num_all);
  EXPECT_GE(score.num_all, static_cast<int>(25 / Stride(4)));
  fs::remove_all(folder);
}

INSTANTIATE_TEST_SUITE_P(
    Cells, DoctorTest,
    testing::Values(
        Cell{"chessboard", "eye_to_hand", "{type: chessboard, rows: 6, columns: 9, square: 20 mm}", "square", 20, 6, 9},
        Cell{"apriltag_grid", "eye_in_hand",
             "{type: apriltag_grid, family: tag36h11, rows: 3, columns: 4, tag_size: 30 mm, tag_spacing: 0.3}",
             "tag_size", 30, 3, 4},
        Cell{"charuco", "eye_to_hand",
             "{type: charuco, rows: 5, columns: 7, square: 25 mm, marker: 18 mm, dictionary: DICT_5X5_100}", "square",
             25, 5, 7},
        Cell{"coded_board", "eye_in_hand",
             "{type: coded_board, rows: 3, columns: 4, spacing: 40 mm, dot_diameter: 10 mm}", "spacing", 40, 3, 4}),
    [](const testing::TestParamInfo<Cell>& cell) { return cell.param.name; });

// Frontal images under rotations about one axis do not constrain the intrinsics, so scales and small rotations that
// they suggest are not findings: the axis is the only finding and is reported once.
TEST(OneAxisTest, RefusalNamesOnlyTheAxis) {
  const fs::path folder = TestFolder("doctor_one_axis");
  const std::vector<std::string> targets = {
      "{type: chessboard, rows: 6, columns: 9, square: 20 mm}",
      "{type: coded_board, rows: 2, columns: 2, spacing: 40 mm, dot_diameter: 10 mm}",
      "{type: apriltag_grid, family: tag36h11, rows: 2, columns: 2, tag_size: 30 mm, tag_spacing: 0.3}"};
  for (const std::string& target : targets) {
    for (const std::string setup : {"eye_to_hand", "eye_in_hand"}) {
      WriteAll(folder / "scene.yaml",
               SceneText(setup, target, "{captures: 10, distance: 420 mm, tilt: 0 deg, spin: 60 deg, spread: 0}") +
                   "give_camera: false\n");
      fs::remove_all(folder / "set");
      ASSERT_EQ(
          RunHeba({"simulate", (folder / "scene.yaml").string(), "--out", (folder / "set").string(), "--quiet"}).status,
          0);
      const std::string config = (folder / "set" / "config.yaml").string();
      const CommandResult run = RunHeba({"run", config, "--quiet", "--out", (folder / "run").string()});
      EXPECT_EQ(run.status, 1) << run.err;
      const size_t first = run.err.find("about one axis only");
      EXPECT_NE(first, std::string::npos) << run.err;
      EXPECT_EQ(run.err.find("about one axis only", first + 1), std::string::npos) << run.err;
      EXPECT_EQ(run.err.find("heba doctor:"), std::string::npos) << run.err;
      const CommandResult doctor = RunHeba({"doctor", config, "--quiet"});
      EXPECT_EQ(FirstWrongCode(doctor.out), "motion") << doctor.out;
    }
  }
  fs::remove_all(folder);
}

struct Motion {
  std::string name;
  std::string motion;
};
class DoctorMotionTest : public testing::TestWithParam<Motion> {};

TEST_P(DoctorMotionTest, ReportsInsufficientMotion) {
  const fs::path folder = TestFolder("doctor_motion_" + GetParam().name);
  const std::string target = "{type: chessboard, rows: 6, columns: 9, square: 20 mm}";
  WriteAll(folder / "scene.yaml", SceneText("eye_to_hand", target, GetParam().motion));
  ASSERT_EQ(
      RunHeba({"simulate", (folder / "scene.yaml").string(), "--out", (folder / "set").string(), "--quiet"}).status, 0);
  const CommandResult result = RunHeba({"doctor", (folder / "set" / "config.yaml").string(), "--quiet"});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(FirstWrongCode(result.out), "motion") << result.out;
  fs::remove_all(folder);
}

INSTANTIATE_TEST_SUITE_P(
    Motions, DoctorMotionTest,
    testing::Values(Motion{"translations_only",
                           "{captures: 12, distance: 450 mm, depth: 0.25, tilt: 0 deg, spin: 0 deg, spread: 0}"},
                    Motion{"one_axis",
                           "{captures: 12, distance: 450 mm, depth: 0.25, tilt: 0 deg, spin: 60 deg, spread: 0}"}),
    [](const testing::TestParamInfo<Motion>& motion) { return motion.param.name; });

}  // namespace
}  // namespace heba
