#include <algorithm>
#include <filesystem>
#include <iostream>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/evaluation/pose_correction.h"
#include "heba/io/pose_file.h"
#include "heba/io/result_file.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/config/capture_section.h"
#include "tools/config/robot_section.h"
#include "tools/config/run_folder.h"
#include "tools/text/console.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

// The form of the poses to correct, which is that of the run's poses.
struct Form {
  PoseReading reading = {*FindPoseFormat("ros")};
  bool joints_are_deg = false;
};

Form FormOf(const fs::path& run, const std::string& arm) {
  const std::optional<ConfigValue> section = FindPoseSection(run, arm);
  if (!section) return {};
  MapReader poses(*section);
  return {ReadPoseReading(poses), ReadJointsAreDeg(poses)};
}

// Returns the index of the arm whose poses are corrected.
size_t FindArm(const std::vector<std::string>& robots) {
  if (robots.size() == 1 && robots.front().empty() && !FLAGS_arm.empty()) {
    throw InputError("--arm: the run has one arm without a name; leave this flag out");
  }
  if (FLAGS_arm.empty() && robots.size() > 1) {
    throw InputError("--arm NAME: the rig has several arms, one of which is needed: " + Join(robots, ", "));
  }
  const auto found = FLAGS_arm.empty() ? robots.begin() : std::find(robots.begin(), robots.end(), FLAGS_arm);
  if (found == robots.end()) throw InputError("--arm: " + UnknownName(FLAGS_arm, robots));
  return static_cast<size_t>(found - robots.begin());
}

// Returns the corrected pose, or the one to command. `joints` are empty if the file does not have them.
Outcome<Rigid3d> Corrected(const RobotSummary& robot, const Rigid3d& given, const std::vector<double>& joints,
                           bool joints_are_deg) {
  if (joints.empty()) return FLAGS_inverse ? CommandFor(robot, given) : TruePose(robot, given);
  const Eigen::VectorXd positions = PositionsOf(robot.nominal, joints, joints_are_deg);
  return FLAGS_inverse ? CommandFor(robot, given, positions) : TruePose(robot, given, positions);
}

// The largest change of a pose.
struct Change {
  double m = 0;
  double rad = 0;
};

// The poses of a file, corrected row by row.
struct CorrectedRows {
  std::vector<PoseRow> rows;         // The rows that have a correction.
  std::vector<std::string> unmoved;  // One line for each of the others: where it is, and why.
  Change largest;
};

CorrectedRows CorrectAll(const fs::path& file, const RobotSummary& robot, const Form& form,
                         const std::vector<PoseRow>& rows) {
  CorrectedRows result;
  for (const PoseRow& row : rows) {
    const Rigid3d given = BaseFromGripper(form.reading, row.pose);
    const Outcome<Rigid3d> corrected = Corrected(robot, given, row.extras, form.joints_are_deg);
    if (!corrected) {
      result.unmoved.push_back(file.string() + ":" + std::to_string(row.line) + ": " +
                               (row.image.empty() ? "" : row.image + ": ") + corrected.reason());
      continue;
    }
    result.largest.m = std::max(result.largest.m, DistanceM(given, *corrected));
    result.largest.rad = std::max(result.largest.rad, AngleRad(given, *corrected));
    result.rows.push_back(row);
    result.rows.back().pose = BaseFromGripper(form.reading, *corrected);
  }
  return result;
}

// Returns the text of the corrected poses. A comment at the end marks each pose without a correction.
std::string CorrectedText(const CorrectedRows& corrected, const PoseFormat& format,
                          const std::vector<std::string>& joint_columns) {
  std::string text = PoseFileText(corrected.rows, format, joint_columns);
  for (const std::string& line : corrected.unmoved) text += "# " + line + "\n";
  return text;
}

}  // namespace

int RunCommand_correct(const std::vector<std::string>& arguments) {
  if (FLAGS_out.empty()) throw InputError("'heba correct' needs --out FILE");
  const fs::path run = RunFolderOf(arguments[0]);
  const fs::path poses_file = arguments[1];
  std::error_code no_file;
  const fs::path out_folder = fs::absolute(FLAGS_out).parent_path();
  if (fs::equivalent(FLAGS_out, poses_file, no_file) || fs::equivalent(out_folder, run, no_file)) {
    throw InputError("--out: " + FLAGS_out + " would replace the poses or a file of the run; name another file");
  }
  const fs::path file = run / "result.json";
  const RunResult result = ReadWholeResult(file);
  const size_t index = FindArm(result.rig.robots);
  const RobotSummary* const arm = FindEstimatedArm(result, index);
  if (arm == nullptr) {
    PrintError(file.string() + ": " + WhyNotEstimated(result, index));
    return kWorkFailed;
  }
  if (result.verdict.grade == Grade::kBad && !FLAGS_force) {
    PrintError(file.string() +
               ": the verdict of this run is bad, and a robot would move by these poses; --force writes them");
    return kWorkFailed;
  }
  const RobotSummary& robot = *arm;
  const Form form = FormOf(run, result.rig.robots[index]);
  const PoseReading& reading = form.reading;
  if (reading.format.rotation == "joints") {
    throw InputError((run / "config.yaml").string() +
                     ": the poses of the run are joints, which cannot be corrected; name a format of poses");
  }
  const std::vector<std::string> joint_columns = JointColumns(robot.nominal);
  const std::vector<PoseRow> rows = ReadPoseFile(poses_file, reading.format, joint_columns);
  const bool has_joints = !rows.front().extras.empty();
  if (!has_joints && robot.configuration.empty()) {
    PrintError(poses_file.string() + ": a pose alone does not tell the joints of the arm " + robot.nominal.name +
               ", because the captures are in several configurations or its configurations have no names; columns " +
               joint_columns.front() + " to " + joint_columns.back() +
               (FLAGS_inverse ? " with joints near the pose to command" : " with the joints at the pose") + " (" +
               (form.joints_are_deg ? "deg" : "rad") + ") tell them");
    return kWorkFailed;
  }
  CorrectedRows corrected = CorrectAll(poses_file, robot, form, rows);
  for (const std::string& line : corrected.unmoved) PrintError(line);
  if (corrected.rows.empty()) return kWorkFailed;
  // A pose to command has other joints than those near it.
  const bool writes_joints = has_joints && !FLAGS_inverse;
  if (!writes_joints) {
    for (PoseRow& row : corrected.rows) row.extras.clear();
  }
  WriteFileAtomically(
      FLAGS_out, CorrectedText(corrected, reading.format, writes_joints ? joint_columns : std::vector<std::string>()));
  if (const std::string errors = ImplausibleArmText(robot); !errors.empty()) {
    std::cerr << "heba: warning: the poses are corrected by " << errors << std::endl;
  }
  if (!FLAGS_quiet) {
    std::cout << ForTerminal(FLAGS_out + ": " + std::to_string(corrected.rows.size()) +
                             (FLAGS_inverse ? " poses to command" : " true poses of the gripper") +
                             "; the corrections are up to " + Significant(1000 * corrected.largest.m, 2) + " mm and " +
                             Significant(RadToDeg(corrected.largest.rad), 2) + " deg")
              << std::endl;
  }
  return corrected.unmoved.empty() ? kDone : kWorkFailed;
}

}  // namespace heba
