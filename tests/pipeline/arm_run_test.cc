// The kinematics of an arm, from simulated captures to corrected poses.
#include <cmath>
#include <cstdlib>
#include <map>
#include <regex>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/io/arm_file.h"
#include "heba/io/pose_file.h"
#include "heba/io/result_file.h"
#include "heba/robot/arm_table.h"
#include "tests/pipeline/cli.h"

namespace heba {
namespace {

using Json = nlohmann::json;
namespace fs = std::filesystem;
using testing::HasSubstr;

class ArmRunTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder() = TestFolder("arm_run");
    const std::string scene = std::string(HEBA_SOURCE_DIR) + "/configs/arm/scene.yaml";
    const std::map<std::string, std::vector<std::string>> settings = {
        {"one", {}},
        {"several", {"--set", "robot.configurations=several", "--set", "robot.record_joints=true"}},
        {"exact", {"--set", "robot.offsets=0 deg", "--set", "robot.lengths=0 mm", "--set", "robot.angles=0 deg"}}};
    for (const auto& [name, flags] : settings) {
      std::vector<std::string> command = {"simulate", scene, "--out", (folder() / name).string(), "--quiet"};
      command.insert(command.end(), flags.begin(), flags.end());
      const CommandResult simulated = RunHeba(command);
      ASSERT_EQ(simulated.status, 0) << simulated.err;
      const CommandResult run = RunHeba(
          {"run", (folder() / name / "config.yaml").string(), "--out", (folder() / name / "run").string(), "--quiet"});
      ASSERT_EQ(run.status, 0) << run.err;
    }
  }
  static fs::path& folder() {
    static fs::path path;
    return path;
  }
  // The refined estimate of a run.
  static Json RefinedIn(const fs::path& run) {
    const Json result = Json::parse(ReadAll(run / "result.json"));
    for (const Json& estimate : result["estimates"]) {
      if (estimate["method"] == "bundle") return estimate;
    }
    return nullptr;
  }
  static Json Refined(const std::string& name) { return RefinedIn(folder() / name / "run"); }
};

TEST_F(ArmRunTest, ErrorsAreFoundWithinTheirSigmas) {
  for (const std::string name : {"one", "several"}) {
    const Json robot = Refined(name)["robot"];
    const Json truth = Json::parse(ReadAll(folder() / name / "truth.json"))["robot"];
    EXPECT_EQ(robot["decision"], "estimated") << robot["reason"];
    EXPECT_EQ(robot["angles"], name == "one" ? "recovered" : "recorded");
    double squares = 0;
    int num = 0;
    for (const Json& parameter : robot["parameters"]) {
      if (parameter["std"].is_null()) continue;
      const double error = parameter["value"].get<double>() - parameter["nominal"].get<double>();
      squares += std::pow(
          (error - truth[parameter["name"].get<std::string>()].get<double>()) / parameter["std"].get<double>(), 2);
      ++num;
    }
    EXPECT_EQ(num, 18);
    // The mean of 18 squares exceeds 2.3 with a probability of 0.1 %.
    EXPECT_LT(squares / num, 2.3) << name;
    EXPECT_LT(robot["sigma"]["after_mm"].get<double>(), 0.3 * robot["sigma"]["before_mm"].get<double>());
    EXPECT_EQ(robot["undetermined"].size(), 8U);
  }
}

TEST_F(ArmRunTest, HeldOutTargetsArePredictedBetterThanWithoutTheArm) {
  const CommandResult without =
      RunHeba({"run", (folder() / "several" / "config.yaml").string(), "--set", "refine.kinematics=none", "--out",
               (folder() / "without").string(), "--quiet"});
  ASSERT_EQ(without.status, 0) << without.err;
  const double without_mm = RefinedIn(folder() / "without")["errors"]["holdout_target_mm"].get<double>();
  EXPECT_LT(Refined("several")["errors"]["holdout_target_mm"].get<double>(), 0.35 * without_mm);
}

TEST_F(ArmRunTest, ExactArmsAreLeftAlone) {
  const Json robot = Refined("exact")["robot"];
  EXPECT_EQ(robot["decision"], "declined");
  EXPECT_THAT(robot["reason"].get<std::string>(), HasSubstr("not significantly better"));
}

TEST_F(ArmRunTest, WrongArmIsRefusedByName) {
  const CommandResult run = RunHeba({"run", (folder() / "one" / "config.yaml").string(), "--set", "robot.model=ur3",
                                     "--out", (folder() / "wrong").string(), "--quiet"});
  ASSERT_EQ(run.status, 0) << run.err;
  const std::string result = ReadAll(folder() / "wrong" / "result.json");
  EXPECT_THAT(result, HasSubstr("the arm ur3 does not reach the pose of capture"));
  EXPECT_THAT(result, HasSubstr("heba doctor says which"));
}

// A case states what the doctor says about one of the sets if it is read with some settings.
struct DoctorCase {
  std::string set;
  std::vector<std::string> settings;
  std::string fault;  // Empty if nothing is wrong.
  std::string cure;
};

void ExpectDiagnoses(const fs::path& folder, const std::vector<DoctorCase>& cases) {
  for (const DoctorCase& one : cases) {
    std::vector<std::string> arguments = {"doctor", (folder / one.set / "config.yaml").string(), "--quiet"};
    for (const std::string& setting : one.settings) {
      arguments.insert(arguments.end(), {"--set", setting});
    }
    const CommandResult doctor = RunHeba(arguments);
    EXPECT_EQ(doctor.status, 0) << doctor.err;
    const std::string text = Unbroken(doctor.out);
    EXPECT_THAT(text, HasSubstr(one.fault.empty() ? "nothing is wrong" : one.fault)) << Join(one.settings, " ");
    EXPECT_THAT(text, HasSubstr(one.cure)) << Join(one.settings, " ");
  }
}

// The tests of the doctor's check of the robot have these and more, without images.
TEST_F(ArmRunTest, DoctorNamesWhatIsWrongWithTheRobot) {
  ExpectDiagnoses(folder(),
                  {{"several", {}, "", "remark [nominal_kinematics]"},
                   {"one", {"robot.tool={translation: [0 mm, 0 mm, 150 mm]}"}, "[robot_tool]", "leave robot.tool out"},
                   {"several", {"robot.model=ur10e"}, "wrong [robot_model]", "set robot.model: ur5e"}});
}

class ArmRunNightly : public ArmRunTest {};

TEST_F(ArmRunNightly, DoctorNamesWhatElseIsWrongWithTheRobot) {
  ExpectDiagnoses(folder(),
                  {{"one", {}, "", ""},
                   {"one", {"robot.model=ur20"}, "[robot_model]", "set robot.model: ur5e"},
                   {"one", {"robot.model=ur3"}, "wrong [robot_unreachable]", "the arm ur5e"},
                   {"several", {"robot.model=ur5"}, "wrong [robot_model]", "set robot.model: ur5e"},
                   {"several", {"captures.joint_angle=deg"}, "wrong [joint_angle]", "set captures.joint_angle: rad"}});
}

TEST_F(ArmRunTest, PosesAreCorrectedBothWays) {
  const fs::path run = folder() / "one" / "run";
  const fs::path poses = folder() / "one" / "poses.csv";
  const fs::path corrected = folder() / "corrected.csv";
  const fs::path again = folder() / "again.csv";
  const CommandResult forward = RunHeba({"correct", run.string(), poses.string(), "--out", corrected.string()});
  ASSERT_EQ(forward.status, 0) << forward.err;
  EXPECT_THAT(forward.out, HasSubstr("20 true poses"));
  const CommandResult back =
      RunHeba({"correct", run.string(), corrected.string(), "--inverse", "--out", again.string(), "--quiet"});
  ASSERT_EQ(back.status, 0) << back.err;
  EXPECT_NE(ReadAll(poses).substr(0, 400), ReadAll(corrected).substr(0, 400));
  // The first number of the first pose, to a nanometre.
  const auto first_of = [](const fs::path& file) {
    const std::string text = ReadAll(file);
    return std::stod(text.substr(text.find(',', text.find('\n')) + 1));
  };
  EXPECT_NEAR(first_of(poses), first_of(again), 1e-9);
  const CommandResult refused =
      RunHeba({"correct", (folder() / "exact" / "run").string(), poses.string(), "--out", corrected.string()});
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.err, HasSubstr("were not estimated"));
}

// Writes the table of the poses with the columns of the joints beside them.
void WriteWithJoints(const fs::path& poses, const fs::path& joints, const fs::path& to) {
  std::istringstream left(ReadAll(poses));
  std::istringstream right(ReadAll(joints));
  std::string text;
  for (std::string a, b; std::getline(left, a) && std::getline(right, b);) {
    text += a + b.substr(b.find(',')) + "\n";
  }
  WriteAll(to, text);
}

TEST_F(ArmRunTest, JointsBesideThePosesReplaceTheConfiguration) {
  const fs::path data = folder() / "several";
  const std::string run = (data / "run").string();
  const fs::path both = folder() / "both.csv";
  const fs::path corrected = folder() / "corrected_with_joints.csv";
  const fs::path again = folder() / "again_with_joints.csv";
  const CommandResult refused = RunHeba({"correct", run, (data / "poses.csv").string(), "--out", again.string()});
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.err, HasSubstr("columns j1 to j6 with the joints at the pose (rad) tell them"));
  WriteWithJoints(data / "poses.csv", data / "joints.csv", both);
  const CommandResult forward = RunHeba({"correct", run, both.string(), "--out", corrected.string()});
  ASSERT_EQ(forward.status, 0) << forward.err;
  const CommandResult back = RunHeba({"correct", run, corrected.string(), "--inverse", "--out", again.string()});
  ASSERT_EQ(back.status, 0) << back.err;
  const std::vector<PoseRow> reported = ReadPoseFile(data / "poses.csv", *FindPoseFormat("ros"));
  const std::vector<PoseRow> commanded = ReadPoseFile(again, *FindPoseFormat("ros"));
  ASSERT_EQ(reported.size(), commanded.size());
  for (size_t i = 0; i < reported.size(); ++i) {
    EXPECT_LT(LocalCoordinates(reported[i].pose, commanded[i].pose).norm(), 1e-8) << i;
  }
  // An angle in degrees is not that of the pose.
  WriteAll(both, std::regex_replace(ReadAll(both), std::regex(",[-0-9.e]+\n"), ",99\n"));
  EXPECT_THAT(RunHeba({"correct", run, both.string(), "--out", again.string()}).err,
              HasSubstr("the joints are not those of the pose"));
}

// Returns the numbers of a capture in a file of poses or joints, separated by commas.
std::string NumbersOf(const fs::path& file, const std::string& image) {
  const std::string text = ReadAll(file);
  const size_t first = text.find("\n" + image + ",") + 1 + image.size() + 1;
  return text.substr(first, text.find('\n', first) - first);
}

// Returns the first three numbers after `words`.
Eigen::Vector3d ThreeAfter(const std::string& text, const std::string& words) {
  Eigen::Vector3d numbers = Eigen::Vector3d::Constant(std::nan(""));
  const size_t at = text.find(words);
  if (at == std::string::npos) return numbers;
  const char* next = text.c_str() + at + words.size();
  for (double& number : numbers) {
    char* end = nullptr;
    number = std::strtod(next, &end);
    next = end + 1;
  }
  return numbers;
}

// Returns a text without the breaks of its lines.
std::string Unwrapped(const std::string& text) { return std::regex_replace(text, std::regex("\\s+"), " "); }

// A pose near the simulated board's, to decide between the two that fit a chessboard.
constexpr const char* kNear = "0.45,0.05,0,1,0,0,0";

TEST_F(ArmRunTest, TargetsAreLocatedWithTheCorrectedPose) {
  for (const std::string name : {"one", "several"}) {
    const fs::path cell = folder() / name;
    const Json board = Json::parse(ReadAll(cell / "truth.json"))["board"]["translation_m"];
    const Eigen::Vector3d truth_mm(1000 * board[0].get<double>(), 1000 * board[1].get<double>(),
                                   1000 * board[2].get<double>());
    for (const std::string image : {"002.png", "011.png"}) {
      std::vector<std::string> command = {"locate",
                                          (cell / "run").string(),
                                          (cell / "images" / image).string(),
                                          "--pose",
                                          NumbersOf(cell / "poses.csv", image),
                                          "--near",
                                          kNear};
      if (name == "several") {
        const CommandResult without = RunHeba(command);
        EXPECT_EQ(without.status, 0) << without.err;
        EXPECT_THAT(Unwrapped(without.out), HasSubstr("the robot's pose was not corrected"));
        EXPECT_THAT(Unwrapped(without.out), HasSubstr("no pose to command"));
        command.insert(command.end(), {"--joints", NumbersOf(cell / "joints.csv", image)});
      }
      const CommandResult located = RunHeba(command);
      ASSERT_EQ(located.status, 0) << located.err;
      EXPECT_THAT(Unwrapped(located.out),
                  HasSubstr("the robot's pose was corrected by the estimated errors of the arm ur5e"));
      EXPECT_THAT(Unwrapped(located.out), HasSubstr("to command"));
      const Eigen::Vector3d off_mm = ThreeAfter(Unwrapped(located.out), "base_from_target [") - truth_mm;
      const Eigen::Vector3d sigma_mm = ThreeAfter(Unwrapped(located.out), "along the base's x, y, z: ");
      // The stated sigmas are those of the target's middle; its origin is 0.13 m from there, at which a rotation of
      // 0.01 deg is 0.02 mm. The errors of uncorrected poses are 1 mm.
      for (int i = 0; i < 3; ++i) EXPECT_LT(std::abs(off_mm[i]), 4 * sigma_mm[i] + 0.05) << name << image;
      EXPECT_LT(sigma_mm.maxCoeff(), 0.25);
    }
  }
}

TEST_F(ArmRunTest, CommandsInOtherConfigurationsAreMarkedAsExtrapolated) {
  const fs::path cell = folder() / "one";
  const CommandResult located =
      RunHeba({"locate", (cell / "run").string(), (cell / "images" / "002.png").string(), "--pose",
               NumbersOf(cell / "poses.csv", "002.png"), "--near", kNear, "--robot", "ur5e"});
  ASSERT_EQ(located.status, 0) << located.err;
  EXPECT_THAT(Unwrapped(located.out), HasSubstr("pose to command so that the gripper truly reaches it"));
  EXPECT_THAT(Unwrapped(located.out), HasSubstr("so that the arm's errors are extrapolated"));
  EXPECT_THAT(Unwrapped(located.out), HasSubstr("postures were found that align the flange's frame with the target's"));
  const CommandResult exact =
      RunHeba({"locate", (folder() / "exact" / "run").string(), (cell / "images" / "002.png").string(), "--pose",
               NumbersOf(cell / "poses.csv", "002.png"), "--near", kNear});
  ASSERT_EQ(exact.status, 0) << exact.err;
  EXPECT_EQ(exact.out.find("command"), std::string::npos);
}

TEST_F(ArmRunTest, JsonOfLocateStatesCorrectionsAndCommands) {
  const fs::path cell = folder() / "one";
  std::vector<std::string> arguments = {"locate",
                                        (cell / "run").string(),
                                        (cell / "images" / "002.png").string(),
                                        "--pose",
                                        NumbersOf(cell / "poses.csv", "002.png"),
                                        "--near",
                                        kNear,
                                        "--robot",
                                        "ur5e"};
  const CommandResult text = RunHeba(arguments);
  arguments.emplace_back("--json");
  const CommandResult located = RunHeba(arguments);
  ASSERT_EQ(located.status, 0) << located.err;
  const Json json = Json::parse(located.out);
  const Json& mount = json["camera_mount"];
  EXPECT_EQ(mount["arm"], "ur5e");
  EXPECT_EQ(mount["reason"], "");
  EXPECT_EQ(mount["stated"]["child"], "gripper");
  EXPECT_NE(mount["stated"]["translation_m"], mount["corrected"]["translation_m"]);
  const Json& image = json["images"][0];
  const Json& command = image["command"];
  EXPECT_EQ(image["command_reason"], command["reason"]);
  ASSERT_TRUE(command["base_from_gripper"].is_object()) << command;
  EXPECT_THAT(Unwrapped(text.out), HasSubstr(Significant(command["from_target_mm"], 3) + " mm and " +
                                             Significant(command["from_target_deg"], 3) + " deg from it"));
  EXPECT_EQ(command["joints"].size(), 6U);
  EXPECT_GT(command["sigma"]["total_mm"][0], 0);
  ASSERT_FALSE(image["commands"].empty());
  size_t num_extrapolated = 0;
  for (const Json& one : image["commands"]) num_extrapolated += one["extrapolated"] == true ? 1 : 0;
  EXPECT_GT(num_extrapolated, 0U);
}

TEST_F(ArmRunTest, OneConfigurationHasFiguresAndTheReportShowsTheArm) {
  const Json result = Json::parse(ReadAll(folder() / "one" / "run" / "result.json"));
  double captured_mm = 0;
  double others_mm = 0;
  for (const Json& finding : result["verdict"]["findings"]) {
    if (finding["code"] != "arm_one_configuration") continue;
    captured_mm = finding["numbers"]["captured_mm"].get<double>();
    others_mm = finding["numbers"]["others_mm"].get<double>();
  }
  EXPECT_GT(captured_mm, 0);
  EXPECT_GT(others_mm, 1.5 * captured_mm);
  const std::string page = ReadAll(folder() / "one" / "run" / "report.html");
  EXPECT_THAT(page, HasSubstr("<h2>Arm</h2>"));
  EXPECT_THAT(page, HasSubstr("the noise of its poses falls from "));
  EXPECT_THAT(page, HasSubstr("<h2>Arms</h2>"));
  // The pixels are compared with what the corrections of the arm leave.
  EXPECT_THAT(page, HasSubstr(" px after the corrections of the arms, and "));
  EXPECT_EQ(ReadAll(folder() / "exact" / "run" / "report.html").find("<h2>Arm</h2>"), std::string::npos);
}

TEST_F(ArmRunTest, CalibratedArmIsExported) {
  const std::string run = (folder() / "one" / "run").string();
  const CommandResult calibration = RunHeba({"export", run, "--to", "ur_calibration"});
  EXPECT_THAT(calibration.out, HasSubstr("[mounting]\ndelta_theta = [ "));
  WriteAll(folder() / "one" / "calibration.conf", calibration.out);
  // The controller's file is read in place of the maker's parameters. The correction multiplies the reported pose, so
  // that it hardly depends on them: 5 % is well above the effect of joints that differ by some 0.1 deg.
  const CommandResult calibrated = RunHeba({"run", (folder() / "one" / "config.yaml").string(), "--set",
                                            "robot.kinematics=" + (folder() / "one" / "calibration.conf").string(),
                                            "--out", (folder() / "calibrated").string(), "--quiet"});
  ASSERT_EQ(calibrated.status, 0) << calibrated.err;
  const Json refined = RefinedIn(folder() / "calibrated");
  EXPECT_EQ(refined["robot"]["decision"], "estimated");
  EXPECT_NE(refined["robot"]["nominal"], Refined("one")["robot"]["nominal"]);
  const double usual_mm = Refined("one")["errors"]["holdout_target_mm"].get<double>();
  EXPECT_NEAR(refined["errors"]["holdout_target_mm"].get<double>(), usual_mm, 0.05 * usual_mm);
  EXPECT_THAT(RunHeba({"export", run, "--to", "ur_kinematics"}).out, HasSubstr("forearm:"));
  EXPECT_THAT(RunHeba({"export", run, "--to", "robot_urdf"}).out, HasSubstr("flange_joint"));
  EXPECT_THAT(RunHeba({"export", run, "--to", "dh_csv"}).out, HasSubstr("joint,theta_rad,d_m,a_m,alpha_rad,beta_rad"));
  const CommandResult refused = RunHeba({"export", (folder() / "exact" / "run").string(), "--to", "dh_csv"});
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.err, HasSubstr("the estimate 'bundle' has no kinematics of the arm"));
  // The errors of the arm belong to the refined estimate.
  EXPECT_THAT(RunHeba({"export", run, "--to", "dh_csv", "--method", "chain"}).err,
              HasSubstr("the estimate 'chain' has no kinematics of the arm"));
}

// Errors that no arm has are exported with a warning that names them.
TEST_F(ArmRunTest, ImplausibleArmIsExportedWithAWarning) {
  const auto export_of = [&](const fs::path& run) { return RunHeba({"export", run.string(), "--to", "dh_csv"}); };
  EXPECT_EQ(export_of(folder() / "one" / "run").err, "");
  Json result = Json::parse(ReadAll(folder() / "one" / "run" / "result.json"));
  for (Json& estimate : result["estimates"]) {
    if (estimate["method"] != "bundle") continue;
    for (Json& parameter : estimate["robot"]["parameters"]) {
      if (parameter["name"] == "joint2.a") parameter["value"] = parameter["nominal"].get<double>() + 0.009;
    }
    WriteAll(folder() / "contradicting.json", result.dump());
    for (Json& effect : estimate["robot"]["estimated"]["effects"]) {
      if (effect["name"] == "joint2.a") effect["value"] = 0.009;
    }
  }
  fs::create_directories(folder() / "implausible");
  WriteAll(folder() / "implausible" / "result.json", result.dump());
  const CommandResult exported = export_of(folder() / "implausible");
  EXPECT_EQ(exported.status, 0);
  EXPECT_EQ(exported.err, "heba: warning: the arm is exported with errors that no arm has: joint2.a +9.0 mm\n");
  EXPECT_THAT(exported.out, HasSubstr("joint,theta_rad"));
  const CommandResult corrected =
      RunHeba({"correct", (folder() / "implausible").string(), (folder() / "one" / "poses.csv").string(), "--out",
               (folder() / "implausible.csv").string()});
  EXPECT_THAT(corrected.err, HasSubstr("the poses are corrected by errors that no arm has: joint2.a +9.0 mm"));
  // The two places of an error in a result agree.
  fs::create_directories(folder() / "contradicting");
  fs::rename(folder() / "contradicting.json", folder() / "contradicting" / "result.json");
  const CommandResult refused = export_of(folder() / "contradicting");
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, HasSubstr("the error of 'joint2.a' in 'estimated' is not its value less the nominal one"));
}

// The arm yields to gravity, and each pose is captured twice.
TEST_F(ArmRunTest, CompliancesOfASimulatedArmAreFound) {
  const fs::path data = folder() / "gravity";
  const CommandResult simulated = RunHeba(
      {"simulate", std::string(HEBA_SOURCE_DIR) + "/configs/arm/scene.yaml", "--out", data.string(), "--quiet", "--set",
       "robot.gravity=4e-5 rad/(N m)", "--set", "robot.configurations=several", "--set", "robot.record_joints=true",
       "--set", "motion.captures=24", "--set", "motion.repeats=2", "--set", "image.noise=2 grey"});
  ASSERT_EQ(simulated.status, 0) << simulated.err;
  const std::vector<PoseRow> poses = ReadPoseFile(data / "poses.csv", *FindPoseFormat("ros"));
  ASSERT_EQ(poses.size(), 48U);
  for (size_t i = 0; i < poses.size(); i += 2) {
    EXPECT_EQ(poses[i].numbers, poses[i + 1].numbers);
    EXPECT_TRUE(ReadAll(data / "images" / poses[i].image) != ReadAll(data / "images" / poses[i + 1].image)) << i;
  }
  const Json truth = Json::parse(ReadAll(data / "truth.json"))["robot"];
  EXPECT_GT(truth["joint2.compliance"].get<double>(), 0);
  EXPECT_EQ(truth["joint1.compliance"].get<double>(), 0);
  const CommandResult run = RunHeba({"run", (data / "config.yaml").string(), "--out", (data / "run").string(), "--set",
                                     "refine.kinematics=[offsets, geometry, gravity]", "--quiet"});
  ASSERT_EQ(run.status, 0) << run.err;
  const Json robot = RefinedIn(data / "run")["robot"];
  EXPECT_EQ(robot["decision"], "estimated") << robot["reason"];
  int num = 0;
  for (const Json& parameter : robot["parameters"]) {
    if (parameter["unit"] != "rad/(N m)") continue;
    ++num;
    // Each error exceeds 4 sigmas with a probability of 6e-5.
    EXPECT_NEAR(parameter["value"].get<double>(), truth[parameter["name"].get<std::string>()].get<double>(),
                4 * parameter["std"].get<double>())
        << parameter;
  }
  EXPECT_EQ(num, 2);
  // A file of the geometry alone leads closer to the poses of the arm that yields, by as much as the result states:
  // little in captures that are all over the workspace.
  const CommandResult exported = RunHeba({"export", (data / "run").string(), "--to", "ur_kinematics"});
  EXPECT_THAT(exported.out, HasSubstr("yield to gravity"));
  WriteFileAtomically(data / "ur.yaml", exported.out);
  const Arm rigid = ReadArmFile(data / "ur.yaml", *FindArm("ur5e"));
  const RobotSummary arm = *ReadRunResult(data / "run" / "result.json").arms[0];
  const Arm yielding = WithChanges(arm.nominal, arm.errors);
  double squares_rigid_m = 0;
  double squares_without_m = 0;
  std::istringstream rows(ReadAll(data / "joints.csv"));
  std::string row;
  std::getline(rows, row);  // image, j1, ..., j6
  while (std::getline(rows, row)) {
    const std::vector<std::string> fields = Split(row, ',');
    ASSERT_EQ(fields.size(), 7U) << row;
    Eigen::VectorXd joints(6);
    for (Eigen::Index j = 0; j < 6; ++j) joints[j] = std::stod(fields[static_cast<size_t>(j) + 1]);
    const Rigid3d base_from_flange = BaseFromTip(yielding, joints);
    squares_rigid_m += std::pow(DistanceM(BaseFromTip(rigid, joints), base_from_flange), 2);
    squares_without_m += std::pow(DistanceM(BaseFromTip(RigidPart(yielding), joints), base_from_flange), 2);
  }
  ASSERT_TRUE(arm.rigid.has_value());
  EXPECT_NEAR(std::sqrt(squares_rigid_m / 48), arm.rigid->left_m, 1e-6);
  EXPECT_LT(squares_rigid_m, squares_without_m);
}

}  // namespace
}  // namespace heba
