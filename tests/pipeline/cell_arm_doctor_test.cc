// Runs the doctor on a rig with two arms whose poses or mounts are exchanged.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heba/io/pose_file.h"
#include "tests/pipeline/rendered_cell.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

constexpr const char* kTwoArms = R"(
robots:
  alice: {}
  bob: {world_from_base: {translation: [1100 mm, 0 mm, 0 mm], rpy: [0 deg, 0 deg, 180 deg]}}
cameras:
  top:
    mount: world
    pose: {translation: [500 mm, 50 mm, 1300 mm], rpy: [180 deg, 0 deg, 0 deg]}
    camera: &camera {model: brown4, image_size: [640, 480], fx: 600, fy: 600, cx: 320, cy: 240, distortion: [-0.08, 0.05, 0, 0]}
  side:
    mount: world
    pose: {translation: [550 mm, 700 mm, 1100 mm], rpy: [-140 deg, 0 deg, 180 deg]}
    camera: *camera
  hand:
    mount: alice.gripper
    pose: {translation: [60 mm, 0 mm, 40 mm], rpy: [5 deg, -5 deg, 90 deg]}
    camera: *camera
targets:
  plate:
    mount: alice.gripper
    pose: {translation: [0 mm, -50 mm, 80 mm], rpy: [0 deg, 180 deg, 0 deg]}
    target: {type: charuco, rows: 5, columns: 7, square: 30 mm, marker: 22 mm, dictionary: DICT_4X4_250}
  disk:
    mount: bob.gripper
    pose: {translation: [0 mm, 30 mm, 80 mm], rpy: [0 deg, 180 deg, 0 deg]}
    target: {type: charuco, rows: 5, columns: 7, square: 30 mm, marker: 22 mm, dictionary: DICT_4X4_250, first_marker: 50}
  wall:
    mount: world
    pose: {translation: [500 mm, -500 mm, 200 mm], rpy: [180 deg, 0 deg, 0 deg]}
    target: {type: charuco, rows: 5, columns: 7, square: 40 mm, marker: 29 mm, dictionary: DICT_4X4_250, first_marker: 100}
motion: {captures: 20, distance: 700 mm, tilt: 30 deg}
image: {noise: 2 grey}
robot_noise: {translation: 0.1 mm, rotation: 0.02 deg}
)";

// A rig with two arms, shared by all tests.
class CellArmDoctorTest : public RenderedCellTest<CellArmDoctorTest> {
 public:
  static const char* Name() { return "rig_arm_doctor"; }
  static const char* Scene() { return kTwoArms; }

 protected:
  // Runs a command on the rig with these settings.
  static CommandResult With(std::vector<std::string> arguments, const std::vector<std::string>& settings) {
    arguments.insert(arguments.begin() + 1, (Cell() / "config.yaml").string());
    arguments.emplace_back("--quiet");
    return WithSettings(std::move(arguments), settings);
  }

  // Returns the first symptom, after testing that nothing is wrong with its settings.
  static nlohmann::json FirstSymptom(std::vector<std::string> settings) {
    const CommandResult doctor = With({"doctor", "--json"}, settings);
    EXPECT_EQ(doctor.status, 0) << doctor.err;
    const nlohmann::json json = nlohmann::json::parse(doctor.out);
    EXPECT_EQ(json["wrong"], 1) << doctor.out;
    const nlohmann::json& first = json["symptoms"][0];
    EXPECT_FALSE(first["settings"].empty());
    for (const nlohmann::json& setting : first["settings"]) {
      settings.push_back(setting["key"].get<std::string>() + "=" + setting["value"].get<std::string>());
    }
    EXPECT_THAT(With({"doctor"}, settings).out, HasSubstr("nothing is wrong"));
    return first;
  }
};

TEST_F(CellArmDoctorTest, FindsNothingWrongWithAGoodCell) {
  EXPECT_THAT(With({"doctor"}, {}).out, HasSubstr("nothing is wrong"));
}

TEST_F(CellArmDoctorTest, NamesExchangedPoses) {
  const std::vector<std::string> exchanged = {"robots.alice.poses=" + (*folder_ / "rig/bob.csv").string(),
                                              "robots.bob.poses=" + (*folder_ / "rig/alice.csv").string()};
  const nlohmann::json symptom = FirstSymptom(exchanged);
  EXPECT_EQ(symptom["code"], "other_arm");
  EXPECT_THAT(symptom["text"].get<std::string>(),
              AllOf(StartsWith("the poses of the arms alice and bob are exchanged; "),
                    HasSubstr(", robot and images differ by 0.0")));
  EXPECT_THAT(symptom["action"].get<std::string>(), StartsWith("exchange robots.alice.poses and robots.bob.poses"));
  const CommandResult run = With({"run", "--out", (*folder_ / "run").string()}, exchanged);
  EXPECT_EQ(run.status, 1);
  EXPECT_THAT(run.err, testing::EndsWith("heba doctor: the poses of the arms alice and bob are exchanged; exchange "
                                         "robots.alice.poses and robots.bob.poses or, if these are right, the arms in "
                                         "the mounts\n"));
}

TEST_F(CellArmDoctorTest, NamesTheMountOnTheWrongArm) {
  // The wrong mount would also mean that the hand never moves against the disk.
  const nlohmann::json hand = FirstSymptom({"cameras.hand.mount=bob.gripper"});
  EXPECT_EQ(hand["code"], "other_arm");
  EXPECT_THAT(hand["text"].get<std::string>(), StartsWith("camera hand is carried by arm alice, not by arm bob; "));
  EXPECT_EQ(hand["action"], "set cameras.hand.mount: alice.gripper");
  const nlohmann::json disk = FirstSymptom({"targets.disk.mount=alice.gripper"});
  EXPECT_EQ(disk["code"], "other_arm");
  EXPECT_THAT(disk["text"].get<std::string>(), StartsWith("target disk is carried by arm bob, not by arm alice; "));
  EXPECT_EQ(disk["action"], "set targets.disk.mount: bob.gripper");
}

// Poses that fit no arm are not those of another one.
TEST_F(CellArmDoctorTest, NamesNoOtherArmIfItsPosesDoNotFit) {
  std::vector<PoseRow> rows = ReadPoseFile(*folder_ / "rig/alice.csv", *FindPoseFormat("ros"));
  for (size_t i = 0; i + 1 < rows.size(); ++i) std::swap(rows[i].pose, rows[(7 * i + 3) % rows.size()].pose);
  WriteAll(*folder_ / "mixed.csv", PoseFileText(rows, *FindPoseFormat("ros")));
  const CommandResult doctor = With({"doctor"}, {"robots.alice.poses=" + (*folder_ / "mixed.csv").string()});
  EXPECT_EQ(doctor.err, "");
  EXPECT_THAT(doctor.out, AllOf(HasSubstr("[poses_unexplained]"), Not(HasSubstr("[other_arm]"))));
}

// A target that is left out of the config leaves an arm that carries nothing.
TEST_F(CellArmDoctorTest, NamesTheArmThatCarriesNothing) {
  const CommandResult run = With({"run", "--out", (*folder_ / "run").string()}, {"targets.disk="});
  EXPECT_EQ(run.status, 1);
  EXPECT_THAT(run.err,
              HasSubstr("config.yaml: arm bob carries no camera and no target, so that no image joins it to the "
                        "rest; give one the mount bob.gripper, or leave the arm out\n"));
}

// A scene with one arm that has a name.
TEST_F(CellArmDoctorTest, ASimulatedArmKeepsItsName) {
  const CommandResult made =
      RunHeba({"simulate", (*folder_ / "scene.yaml").string(), "--out", (*folder_ / "one").string(), "--quiet", "--set",
               "robots.bob=", "--set", "targets.disk="});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_THAT(ReadAll(*folder_ / "one/config.yaml"), HasSubstr("robots:\n  alice:\n    poses: alice.csv\n"));
  const CommandResult doctor = RunHeba({"doctor", (*folder_ / "one/config.yaml").string(), "--quiet"});
  EXPECT_EQ(doctor.status, 0) << doctor.err;
  EXPECT_THAT(doctor.out, HasSubstr("nothing is wrong"));
}

}  // namespace
}  // namespace heba
