// Runs the doctor on recorded data sets, both unspoiled and spoiled.
#include <gtest/gtest.h>

#include "heba/data/setup.h"
#include "tests/support/data_sets.h"
#include "tests/support/spoilings.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

struct Recorded {
  std::string name;
  std::string target_type;
  std::string length_key;
  double length_mm;
  int rows;
  int columns;
  Setup setup;
};

class DoctorRecordedTest : public testing::TestWithParam<Recorded> {};

TEST_P(DoctorRecordedTest, NamesTheCauseFirst) {
  const Recorded& recorded = GetParam();
  HEBA_SKIP_WITHOUT(DataDir() / recorded.name);
  const fs::path folder = TestFolder("doctor_" + recorded.name);
  // The intrinsics are those of the config; its truth is not used.
  GoodSet good{recorded.name,
               fs::path(HEBA_SOURCE_DIR) / "configs" / "recorded" / (recorded.name + ".yaml"),
               DataDir() / recorded.name / "poses.csv",
               DataDir() / recorded.name / "images",
               fs::path(HEBA_SOURCE_DIR) / "configs" / "recorded" / "cameras" / (recorded.name + ".yaml"),
               recorded.target_type,
               recorded.length_key,
               recorded.length_mm,
               recorded.rows,
               recorded.columns,
               recorded.setup};
  const SpoilingScore score = ScoreDoctor(good, folder / "work", false, recorded.name.size(), Stride(12));
  std::cout << good.name << ": " << score.num_right << " of " << score.num_all << std::endl;
  EXPECT_GE(score.num_right, 0.95 * score.num_all);
  fs::remove_all(folder);
}

INSTANTIATE_TEST_SUITE_P(
    Sets, DoctorRecordedTest,
    testing::Values(Recorded{"ardootala_ur_charuco", "charuco", "square", 40, 6, 9, Setup::kEyeInHand},
                    Recorded{"caliban_no_curv", "chessboard", "square", 12.1, 9, 14, Setup::kEyeInHand},
                    Recorded{"chjohnkim_ur5_chess", "chessboard", "square", 42.4, 9, 11, Setup::kEyeInHand},
                    Recorded{"ic_charuco_eye_to_hand", "charuco", "square", 36.195, 7, 5, Setup::kEyeToHand},
                    Recorded{"ic_circlegrid_eye_in_hand", "circle_grid", "spacing", 25.4, 10, 10, Setup::kEyeInHand},
                    Recorded{"metric_workcell_camera2", "chessboard", "square", 50, 4, 3, Setup::kEyeToHand},
                    Recorded{"zhangnatha_asym_circles_eye_to_hand", "circle_grid", "spacing", 10, 5, 4,
                             Setup::kEyeToHand}),
    [](const testing::TestParamInfo<Recorded>& recorded) { return recorded.param.name; });

// Poses of the target without images. The columns hold A (the gripper in the base) and B (the target in the camera).
class DoctorPairsTest : public testing::TestWithParam<std::string> {};

TEST_P(DoctorPairsTest, FindsNoFaultOrTheWrongDirection) {
  const fs::path pairs = DataDir() / GetParam() / "pairs.csv";
  HEBA_SKIP_WITHOUT(pairs);
  const fs::path folder = TestFolder("doctor_" + GetParam());
  std::istringstream lines(ReadAll(pairs));
  std::string line;
  std::getline(lines, line);
  std::string poses = "image,x,y,z,qx,qy,qz,qw\n";
  std::string targets = poses;
  while (std::getline(lines, line)) {
    const std::vector<std::string> fields = Split(Trim(line), ',');
    ASSERT_EQ(fields.size(), 15U);
    const auto part = [&](size_t from) {
      return fields[0] + "," +
             Join({fields.begin() + static_cast<std::ptrdiff_t>(from),
                   fields.begin() + static_cast<std::ptrdiff_t>(from) + 7},
                  ",") +
             "\n";
    };
    poses += part(1);
    targets += part(8);
  }
  WriteAll(folder / "poses.csv", poses);
  WriteAll(folder / "target_poses.csv", targets);
  const auto ask = [&](const std::string& setup) {
    WriteAll(folder / "config.yaml",
             "setup: " + setup + "\ncaptures: {poses: poses.csv, target_poses: target_poses.csv}\n");
    return FirstWrongCode(RunHeba({"doctor", (folder / "config.yaml").string(), "--quiet"}).out);
  };
  const bool is_carried = GetParam().starts_with("doosan");
  EXPECT_EQ(ask(is_carried ? "eye_in_hand" : "eye_to_hand"), "");
  EXPECT_EQ(ask(is_carried ? "eye_to_hand" : "eye_in_hand"), "pose_direction");
  fs::remove_all(folder);
}

INSTANTIATE_TEST_SUITE_P(Sets, DoctorPairsTest, testing::Values("doosan_charuco_pose_pairs", "moveit_pose_pairs"),
                         [](const testing::TestParamInfo<std::string>& set) { return set.param; });

}  // namespace
}  // namespace heba
