#include <filesystem>
#include <iostream>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/config/yaml_reader.h"
#include "heba/evaluation/pose_correction.h"
#include "heba/io/pose_file.h"
#include "heba/io/result_file.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/config/capture_section.h"
#include "tools/text/console.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

// Returns the form of the run's poses, which is that of the poses to correct.
PoseReading ReadingOf(const fs::path& run) {
  const fs::path file = run / "config.yaml";
  std::error_code error;
  if (!fs::is_regular_file(file, error)) return {*FindPoseFormat("ros")};
  MapReader config(ReadYamlFile(file));
  const std::optional<ConfigValue> section = config.Find("captures");
  if (!section || !section->IsMap()) return {*FindPoseFormat("ros")};
  MapReader captures(*section);
  return ReadPoseReading(captures);
}

}  // namespace

int RunCommand_correct(const std::vector<std::string>& arguments) {
  if (FLAGS_out.empty()) throw InputError("'heba correct' needs --out FILE");
  const fs::path run = arguments[0];
  const fs::path poses_file = arguments[1];
  const RunResult result = ReadResult(run / "result.json");
  if (!result.robot || !result.robot->is_estimated) {
    PrintError((run / "result.json").string() + ": the kinematics of the arm were not estimated" +
               (result.robot ? " (" + result.robot->reason + ")" : "; the config names no arm (robot.model)"));
    return kWorkFailed;
  }
  const RobotSummary& robot = *result.robot;
  const PoseReading reading = ReadingOf(run);
  std::vector<PoseRow> rows = ReadPoseFile(poses_file, reading.format);
  double largest_m = 0;
  double largest_rad = 0;
  for (size_t i = 0; i < rows.size(); ++i) {
    const Rigid3d given = BaseFromGripper(reading, rows[i].pose);
    const Outcome<Rigid3d> corrected = FLAGS_inverse ? CommandFor(robot, given) : TruePose(robot, given);
    if (!corrected) {
      PrintError(poses_file.string() + ":" + std::to_string(rows[i].line) + ": " + corrected.reason());
      return kWorkFailed;
    }
    largest_m = std::max(largest_m, DistanceM(given, *corrected));
    largest_rad = std::max(largest_rad, AngleRad(given, *corrected));
    rows[i].pose = BaseFromGripper(reading, *corrected);
  }
  WriteFileAtomically(FLAGS_out, PoseFileText(rows, reading.format));
  if (!FLAGS_quiet) {
    std::cout << ForTerminal(FLAGS_out + ": " + std::to_string(rows.size()) +
                             (FLAGS_inverse ? " poses to command" : " true poses of the gripper") +
                             "; the corrections are up to " + Significant(1000 * largest_m, 2) + " mm and " +
                             Significant(RadToDeg(largest_rad), 2) + " deg")
              << std::endl;
  }
  return kDone;
}

}  // namespace heba
