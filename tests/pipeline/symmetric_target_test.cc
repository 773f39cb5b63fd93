// Targets that look the same after a rotation by 180 degrees: one image fits two poses, and the program does not
// choose.
#include <algorithm>
#include <map>
#include <regex>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heba/base/units.h"
#include "heba/geometry/rigid3.h"
#include "heba/io/pose_file.h"
#include "tests/pipeline/cli.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using Json = nlohmann::json;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

Rigid3d PoseFromJson(const Json& json) {
  const auto t = json["translation_m"].get<std::vector<double>>();
  const auto q = json["quaternion_xyzw"].get<std::vector<double>>();
  return Rigid3d(Eigen::Quaterniond(q[3], q[0], q[1], q[2]), Eigen::Vector3d(t[0], t[1], t[2]));
}

// Returns the poses base_from_target that `heba locate` printed, in order.
std::vector<Rigid3d> PrintedPoses(const std::string& out) {
  const std::regex pose(
      R"(base_from_target \[(\S+), (\S+), (\S+)\] mm, quaternion xyzw \[(\S+), (\S+), (\S+), (\S+)\])");
  std::vector<Rigid3d> poses;
  for (auto match = std::sregex_iterator(out.begin(), out.end(), pose); match != std::sregex_iterator(); ++match) {
    double numbers[7];
    for (size_t i = 0; i < 7; ++i) numbers[i] = std::stod((*match)[i + 1]);
    poses.emplace_back(Eigen::Quaterniond(numbers[6], numbers[3], numbers[4], numbers[5]),
                       Eigen::Vector3d(numbers[0], numbers[1], numbers[2]) / 1000);
  }
  return poses;
}

std::string Numbers(const Rigid3d& pose) {
  std::ostringstream text;
  text.precision(12);
  text << pose.translation.x() << "," << pose.translation.y() << "," << pose.translation.z() << "," << pose.rotation.x()
       << "," << pose.rotation.y() << "," << pose.rotation.z() << "," << pose.rotation.w();
  return text.str();
}

// One calibration with a chessboard of 5 x 7 inner corners, shared by all tests.
class SymmetricTargetTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new fs::path(TestFolder("symmetric_target"));
    WriteAll(*folder_ / "scene.yaml",
             "setup: eye_to_hand\ntarget: {type: chessboard, rows: 5, columns: 7, square: 20 mm}\n"
             "camera: {model: brown5, image_size: [800, 600], fx: 900, fy: 902, cx: 404, cy: 296, distortion: [-0.1, "
             "0.08, 0.0004, -0.0006, 0.0]}\n"
             "hand_eye: {translation: [820 mm, -140 mm, 610 mm], rpy: [-118 deg, 4 deg, 62 deg]}\n"
             "board: {translation: [-70 mm, -60 mm, 95 mm], rpy: [3 deg, -2 deg, 15 deg]}\n"
             "motion: {captures: 10, distance: 420 mm, depth: 0.25, tilt: 30 deg, spin: 60 deg, spread: 0.3}\n"
             "image: {blur: 0.7 px, noise: 1 grey}\nseed: 5\n");
    const CommandResult simulated = RunHeba({"simulate", Path("scene.yaml"), "--out", Path("data"), "--quiet"});
    ASSERT_EQ(simulated.status, 0) << simulated.err;
    WriteAll(Path("data/config.yaml"), ReadAll(Path("data/config.yaml")) + "refine: {intrinsics: []}\n");
    run_ = new CommandResult(RunHeba({"run", Path("data/config.yaml"), "--out", Path("run")}));
    ASSERT_EQ(run_->status, 0) << run_->err;
    const Rigid3d gripper_from_target = PoseFromJson(Json::parse(ReadAll(Path("data/truth.json")))["board"]);
    for (const PoseRow& row : ReadPoseFile(Path("data/poses.csv"), *FindPoseFormat("ros"))) {
      names_.push_back(row.image);
      truth_.push_back(row.pose * gripper_from_target);
    }
    ASSERT_EQ(names_.size(), 10U);
  }
  static void TearDownTestSuite() {
    fs::remove_all(*folder_);
    delete run_;
    delete folder_;
  }
  static std::string Path(const std::string& name) { return (*folder_ / name).string(); }
  static std::string Image(size_t i) { return Path("data/images/" + names_[i]); }

  // 1 mm and 0.3 deg are several times the uncertainty of a pose from one image of 800 px with a calibration from
  // ten.
  static bool IsNear(const Rigid3d& pose, const Rigid3d& truth) {
    return DistanceM(pose, truth) < 1e-3 && AngleRad(pose, truth) < DegToRad(0.3);
  }
  // Returns the pose after a rotation by 180 degrees about the middle of the 5 x 7 corners.
  static Rigid3d HalfTurned(const Rigid3d& pose) {
    return pose * Rigid3d(Eigen::Quaterniond(0, 0, 0, 1), Eigen::Vector3d(0.12, 0.08, 0));
  }
  static Rigid3d Rotated(const Rigid3d& pose, const Eigen::Vector3d& axis, double angle_deg) {
    return pose * Rigid3d(ExpRotation(DegToRad(angle_deg) * axis), Eigen::Vector3d::Zero());
  }

  static fs::path* folder_;
  static CommandResult* run_;
  static std::vector<std::string> names_;
  static std::vector<Rigid3d> truth_;  // base_from_target of each image.
};
fs::path* SymmetricTargetTest::folder_ = nullptr;
CommandResult* SymmetricTargetTest::run_ = nullptr;
std::vector<std::string> SymmetricTargetTest::names_;
std::vector<Rigid3d> SymmetricTargetTest::truth_;

TEST_F(SymmetricTargetTest, LocateReturnsBothPoses) {
  for (size_t i = 0; i < names_.size(); ++i) {
    const CommandResult located = RunHeba({"locate", Path("run"), Image(i)});
    EXPECT_EQ(located.status, 1);
    EXPECT_EQ(located.err,
              "heba: error: " + Image(i) +
                  ": the target looks the same after a rotation by 180 deg, so 2 poses fit an image equally well; "
                  "--near x,y,z,qx,qy,qz,qw, a rough base_from_target, decides between them\n");
    EXPECT_THAT(located.out, HasSubstr("possible pose 1 of 2: base_from_target ["));
    EXPECT_THAT(located.out, HasSubstr("possible pose 2 of 2: base_from_target ["));
    EXPECT_THAT(located.out, Not(HasSubstr("\n  base_from_target")));
    const std::vector<Rigid3d> poses = PrintedPoses(located.out);
    ASSERT_EQ(poses.size(), 2U) << located.out;
    const size_t right = IsNear(poses[0], truth_[i]) ? 0 : 1;
    EXPECT_TRUE(IsNear(poses[right], truth_[i])) << located.out;
    EXPECT_TRUE(IsNear(poses[1 - right], HalfTurned(truth_[i]))) << located.out;
    EXPECT_GT(poses[0].RotationMatrix()(0, 0), poses[1].RotationMatrix()(0, 0));
  }
}

TEST_F(SymmetricTargetTest, RequiresNearForManyImages) {
  const CommandResult located = RunHeba({"locate", Path("run"), Image(0), Image(1), Image(2)});
  EXPECT_EQ(located.status, 1);
  EXPECT_THAT(located.err, StartsWith("heba: error: 3 images: the target looks the same after a rotation by 180 deg"));
  EXPECT_EQ(std::count(located.err.begin(), located.err.end(), '\n'), 1) << located.err;
  EXPECT_EQ(PrintedPoses(located.out).size(), 6U);
}

TEST_F(SymmetricTargetTest, NearDecidesBetweenThePoses) {
  for (size_t i = 0; i < names_.size(); ++i) {
    for (const Rigid3d& meant : {truth_[i], HalfTurned(truth_[i])}) {
      Rigid3d rough = Rotated(meant, Eigen::Vector3d(1, 2, 3).normalized(), 40);
      rough.translation.x() += 0.05;
      const CommandResult located = RunHeba({"locate", Path("run"), Image(i), "--near", Numbers(rough)});
      EXPECT_EQ(located.status, 0) << located.err;
      EXPECT_EQ(located.err, "");
      EXPECT_THAT(located.out, HasSubstr("\n  base_from_target ["));
      EXPECT_THAT(located.out, HasSubstr("chosen by --near among the 2 possible poses"));
      const std::vector<Rigid3d> poses = PrintedPoses(located.out);
      ASSERT_EQ(poses.size(), 1U) << located.out;
      EXPECT_TRUE(IsNear(poses[0], meant)) << located.out;
    }
  }
}

// An exact position decides although the rotation is that of neither pose.
TEST_F(SymmetricTargetTest, NearDecidesByThePositionAlone) {
  for (const Rigid3d& meant : {truth_[0], HalfTurned(truth_[0])}) {
    const std::string rough = Numbers(Rotated(meant, Eigen::Vector3d::UnitZ(), 90));
    const CommandResult located = RunHeba({"locate", Path("run"), Image(0), "--near", rough});
    EXPECT_EQ(located.status, 0) << located.err;
    const std::vector<Rigid3d> poses = PrintedPoses(located.out);
    ASSERT_EQ(poses.size(), 1U) << located.out;
    EXPECT_TRUE(IsNear(poses[0], meant)) << located.out;
  }
}

TEST_F(SymmetricTargetTest, AmbiguousNearDoesNotDecide) {
  // A rotation by 80 deg about the normal of the target is 80 deg from one pose and 100 deg from the other.
  Rigid3d near = Rotated(truth_[0], Eigen::Vector3d::UnitZ(), 80);
  near.translation.z() += 0.5;
  const std::string rough = Numbers(near);
  const CommandResult located = RunHeba({"locate", Path("run"), Image(0), "--near", rough});
  EXPECT_EQ(located.status, 1);
  EXPECT_THAT(located.err, StartsWith("heba: error: " + Image(0) + ": --near does not decide between the 2 possible "));
  EXPECT_THAT(located.err, HasSubstr(" mm and 80.")) << located.err;
  EXPECT_THAT(located.err,
              HasSubstr("it must be within 36 mm of one of them, or within 75 deg and nearer to it than to "
                        "the others by 30 deg"));
  EXPECT_EQ(std::count(located.err.begin(), located.err.end(), '\n'), 1) << located.err;
  EXPECT_EQ(PrintedPoses(located.out).size(), 2U);
}

TEST_F(SymmetricTargetTest, PixelsOnTheTargetAreUnambiguous) {
  const CommandResult located = RunHeba({"locate", Path("run"), Image(0), "--pixels", "400,300"});
  EXPECT_EQ(located.status, 0) << located.err;
  EXPECT_THAT(located.out, HasSubstr("mm in the base"));
}

TEST_F(SymmetricTargetTest, PixelsOnAPlaneInTheBaseNeedNoImage) {
  const std::vector<std::string> flags = {"--pixels", "400,300", "--plane", "0,0,1,100 mm"};
  const auto locate = [&](std::vector<std::string> words) {
    words.insert(words.end(), flags.begin(), flags.end());
    return RunHeba(words);
  };
  const CommandResult without = locate({"locate", Path("run")});
  const CommandResult with = locate({"locate", Path("run"), Image(0)});
  EXPECT_EQ(without.status, 0) << without.err;
  ASSERT_EQ(with.status, 0) << with.err;
  EXPECT_THAT(without.out, StartsWith("pixels:\n"));
  EXPECT_EQ(without.out.substr(without.out.find('\n')), with.out.substr(with.out.find('\n')));
  EXPECT_THAT(RunHeba({"locate", Path("run"), "--pixels", "400,300"}).err, HasSubstr("needs an IMAGE"));
}

TEST_F(SymmetricTargetTest, RefusesInvalidOrUselessNear) {
  struct Call {
    std::vector<std::string> flags;
    std::string part;
  };
  const Call calls[] = {{{"--near", "1,2,3"}, "--near: 3 numbers; 7 are needed: x,y,z,qx,qy,qz,qw"},
                        {{"--near", "a,0,0,0,0,0,1"}, "--near: 'a' is not a number"},
                        {{"--near", "0,0,0,0,0,0,2"}, "--near: "},
                        {{"--near", "0,0,0,0,0,0,1", "--pixels", "400,300"}, "--near: the target's plane is the same"}};
  for (const Call& call : calls) {
    std::vector<std::string> words = {"locate", Path("run"), Image(0)};
    words.insert(words.end(), call.flags.begin(), call.flags.end());
    const CommandResult located = RunHeba(words);
    EXPECT_EQ(located.status, 2) << call.part;
    EXPECT_THAT(located.err, StartsWith("heba: error: " + call.part));
    EXPECT_EQ(std::count(located.err.begin(), located.err.end(), '\n'), 1) << located.err;
  }
  EXPECT_THAT(RunHeba({"locate", "--help"}).out, HasSubstr("--near"));
}

TEST_F(SymmetricTargetTest, RunAndDoctorExplainTheSymmetry) {
  const std::string remark =
      "the target looks the same after a rotation by 180 deg, so 'heba locate' finds 2 possible poses in an image "
      "unless --near "
      "decides; the calibration itself is not affected";
  EXPECT_THAT(Unbroken(run_->err), HasSubstr(remark));
  EXPECT_THAT(ReadAll(Path("run/log.txt")), HasSubstr(remark));
  const CommandResult doctor = RunHeba({"doctor", Path("data/config.yaml"), "--quiet"});
  EXPECT_EQ(doctor.status, 0) << doctor.err;
  EXPECT_THAT(doctor.out, HasSubstr("nothing is wrong"));
  EXPECT_THAT(Unbroken(doctor.out), HasSubstr("remark [symmetric_target]: " + remark));
  EXPECT_THAT(doctor.out, HasSubstr("-> a chessboard with columns: 8, or a charuco, has one pose only"));
}

// A cell with two fixed cameras, one of which is upside down, so that the two read the targets on the gripper in
// different orders: a chessboard and a circle grid, both of which look the same after half a rotation.
class SymmetricCellTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new fs::path(TestFolder("symmetric_rig"));
    WriteAll(*folder_ / "scene.yaml",
             "cameras:\n"
             "  left:\n    mount: world\n"
             "    pose: {translation: [500 mm, 600 mm, 700 mm], rpy: [-110 deg, 0 deg, 175 deg]}\n"
             "    camera: &camera {model: brown5, image_size: [800, 600], fx: 750, fy: 750, cx: 400, cy: 300, "
             "distortion: [-0.08, 0.05, 0, 0, 0]}\n"
             "  right:\n    mount: world\n"
             "    pose: {translation: [700 mm, 550 mm, 600 mm], rpy: [105 deg, 0 deg, -15 deg]}\n    camera: *camera\n"
             "targets:\n"
             "  plate:\n    mount: gripper\n    pose: {translation: [-80 mm, -50 mm, 80 mm], rpy: [90 deg, 0 deg, 0 "
             "deg]}\n    target: {type: chessboard, rows: 5, columns: 7, square: 18 mm}\n"
             "  disks:\n    mount: gripper\n    pose: {translation: [100 mm, -50 mm, 80 mm], rpy: [90 deg, 0 deg, 0 "
             "deg]}\n    target: {type: circle_grid, rows: 5, columns: 7, spacing: 18 mm}\n"
             "motion: {captures: 12, distance: 650 mm, tilt: 20 deg}\nimage: {noise: 1 grey}\n"
             "robot_noise: {translation: 0.05 mm, rotation: 0.01 deg}\nseed: 4\n");
    const CommandResult simulated = RunHeba({"simulate", Path("scene.yaml"), "--out", Path("cell"), "--quiet"});
    ASSERT_EQ(simulated.status, 0) << simulated.err;
    WriteAll(Path("cell/config.yaml"), ReadAll(Path("cell/config.yaml")) + "refine: {intrinsics: []}\n");
    const CommandResult run = RunHeba({"run", Path("cell/config.yaml"), "--out", Path("run"), "--quiet"});
    ASSERT_EQ(run.status, 0) << run.err;
    const Json truth = Json::parse(ReadAll(Path("cell/truth.json")));
    const std::vector<PoseRow> rows = ReadPoseFile(Path("cell/poses.csv"), *FindPoseFormat("ros"));
    std::map<std::string, int> num_seen;
    const Json result = Json::parse(ReadAll(Path("run/result.json")));
    for (const Json& entry : result["captures"]) {
      if (entry["points"] == 70 && ++num_seen[entry["capture"]] == 2) names_.push_back(entry["capture"]);
    }
    for (const std::string& name : names_) {
      const auto row = std::find_if(rows.begin(), rows.end(), [&](const PoseRow& one) { return one.image == name; });
      ASSERT_TRUE(row != rows.end());
      world_from_gripper_.push_back(row->pose);
    }
    ASSERT_GE(names_.size(), 3U);
    for (const std::string target : {"plate", "disks"}) {
      gripper_from_target_[target] = PoseFromJson(truth["targets"][target]["pose"]);
    }
  }
  static void TearDownTestSuite() {
    fs::remove_all(*folder_);
    delete folder_;
  }
  static std::string Path(const std::string& name) { return (*folder_ / name).string(); }
  static CommandResult Locate(size_t capture, const std::vector<std::string>& flags) {
    std::vector<std::string> words = {"locate", Path("run"), "left=" + Path("cell/left/" + names_[capture]),
                                      "right=" + Path("cell/right/" + names_[capture])};
    words.insert(words.end(), flags.begin(), flags.end());
    return RunHeba(words);
  }
  static Rigid3d Truth(size_t capture, const std::string& target) {
    return world_from_gripper_[capture] * gripper_from_target_[target];
  }
  // 1 mm and 0.3 deg are several times the noise of the arm and the uncertainty of the calibration.
  static bool IsNear(const Rigid3d& pose, const Rigid3d& truth) {
    return DistanceM(pose, truth) < 1e-3 && AngleRad(pose, truth) < DegToRad(0.3);
  }

  static fs::path* folder_;
  static std::vector<std::string> names_;  // The captures in which both cameras see both targets.
  static std::vector<Rigid3d> world_from_gripper_;
  static std::map<std::string, Rigid3d> gripper_from_target_;
};
fs::path* SymmetricCellTest::folder_ = nullptr;
std::vector<std::string> SymmetricCellTest::names_;
std::vector<Rigid3d> SymmetricCellTest::world_from_gripper_;
std::map<std::string, Rigid3d> SymmetricCellTest::gripper_from_target_;

TEST_F(SymmetricCellTest, LocateReturnsAllPosesThatFitBothCameras) {
  for (size_t i = 0; i < names_.size(); ++i) {
    const CommandResult located = Locate(i, {"--json"});
    EXPECT_EQ(located.status, 1);
    EXPECT_THAT(located.err,
                StartsWith("heba: error: target plate: the target looks the same after a rotation by 180 "
                           "deg, so 2 poses fit the images equally well; --near x,y,z,qx,qy,qz,qw, a rough "
                           "world_from_target, decides between them; target disks: the target looks"));
    EXPECT_EQ(std::count(located.err.begin(), located.err.end(), '\n'), 1) << located.err;
    const Json targets = Json::parse(located.out)["targets"];
    ASSERT_EQ(targets.size(), 2U);
    for (const Json& target : targets) {
      const Rigid3d truth = Truth(i, target["target"]);
      EXPECT_FALSE(target["located"]);
      EXPECT_TRUE(target["pose"].is_null());
      EXPECT_LT(target["rms_px"], 0.5);
      ASSERT_EQ(target["poses"].size(), 2U);
      const Rigid3d first = PoseFromJson(target["poses"][0]["pose"]);
      const Rigid3d second = PoseFromJson(target["poses"][1]["pose"]);
      EXPECT_TRUE(IsNear(first, truth) != IsNear(second, truth)) << located.out;
      EXPECT_NEAR(AngleRad(first, second), kPi, DegToRad(0.3));
      EXPECT_GT(first.RotationMatrix()(0, 0), second.RotationMatrix()(0, 0));
    }
  }
}

TEST_F(SymmetricCellTest, NearDecidesForEachTarget) {
  const Rigid3d plate = Truth(0, "plate");
  const Rigid3d turned = Truth(0, "disks") * Rigid3d(Eigen::Quaterniond(0, 0, 0, 1), Eigen::Vector3d(0.108, 0.072, 0));
  const std::string flag = "plate=" + Numbers(plate) + ";disks=" + Numbers(turned);
  const CommandResult located = Locate(0, {"--near", flag, "--json"});
  EXPECT_EQ(located.status, 0) << located.err;
  EXPECT_EQ(located.err, "");
  const Json targets = Json::parse(located.out)["targets"];
  ASSERT_EQ(targets.size(), 2U);
  EXPECT_TRUE(IsNear(PoseFromJson(targets[0]["pose"]), plate)) << located.out;
  EXPECT_TRUE(IsNear(PoseFromJson(targets[1]["pose"]), turned)) << located.out;
  EXPECT_THAT(Locate(0, {"--near", flag}).out, HasSubstr("chosen by --near among the 2 possible poses"));
  // One of the two stays undecided.
  const CommandResult half = Locate(0, {"--near", "plate=" + Numbers(plate)});
  EXPECT_EQ(half.status, 1);
  EXPECT_THAT(half.err, StartsWith("heba: error: target disks: the target looks the same"));
  EXPECT_THAT(half.out, HasSubstr("target disks in world, by left, right"));
  EXPECT_EQ(Locate(0, {"--near", Numbers(plate)}).status, 2);
  EXPECT_THAT(Locate(0, {"--near", "plate=1,2"}).err, HasSubstr("--near: 2 numbers; 7 are needed"));
  EXPECT_THAT(Locate(0, {"--near", "plat=1,2"}).err, HasSubstr("did you mean 'plate'"));
}

struct SheetCase {
  std::string target;
  std::string warning;  // Follows the file name; empty if there is no warning.
};

TEST(SheetOfSymmetricTargetTest, HebaTargetWarnsOfSymmetry) {
  const fs::path folder = TestFolder("symmetric_sheet");
  const std::string half =
      "the target looks the same after a rotation by 180 deg, so 'heba locate' finds 2 possible poses";
  const std::string quarter =
      "the target looks the same after a rotation by 90 deg, so 'heba locate' finds 4 possible poses";
  const SheetCase cases[] = {
      {"{type: chessboard, rows: 5, columns: 7, square: 20 mm}", half},
      {"{type: chessboard, rows: 6, columns: 6, square: 20 mm}", quarter},
      {"{type: circle_grid, rows: 5, columns: 7, spacing: 20 mm}", half},
      {"{type: circle_grid, rows: 5, columns: 5, spacing: 20 mm}", quarter},
      {"{type: chessboard, rows: 5, columns: 8, square: 20 mm}", ""},
      {"{type: circle_grid, rows: 5, columns: 7, spacing: 20 mm, marker_dot: true}", ""},
      {"{type: charuco, rows: 5, columns: 7, square: 30 mm, marker: 22 mm, dictionary: DICT_5X5_100}", ""}};
  for (const SheetCase& test : cases) {
    WriteAll(folder / "target.yaml", test.target);
    const std::string path = (folder / "target.yaml").string();
    const CommandResult result = RunHeba({"target", path, "--out", (folder / "sheet.svg").string()});
    EXPECT_EQ(result.status, 0) << result.err;
    if (test.warning.empty()) {
      EXPECT_EQ(result.err, "") << test.target;
      continue;
    }
    EXPECT_THAT(result.err, StartsWith("heba: warning: " + path + ": " + test.warning)) << test.target;
    EXPECT_THAT(result.err, HasSubstr("or a charuco, has one pose only"));
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  }
  fs::remove_all(folder);
}

}  // namespace
}  // namespace heba
