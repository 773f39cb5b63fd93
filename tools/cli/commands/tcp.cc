#include <algorithm>
#include <cmath>
#include <iostream>
#include <string>
#include <vector>

#include "heba/base/distributions.h"
#include "heba/base/error.h"
#include "heba/base/median.h"
#include "heba/base/text.h"
#include "heba/io/pose_source.h"
#include "heba/io/result_json.h"
#include "heba/tool_tip.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/config/capture_section.h"
#include "tools/text/console.h"
#include "tools/text/failure_text.h"

namespace heba {
namespace {

std::string MmText(const Eigen::Vector3d& vector_m) {
  return "[" + Fixed(1000 * vector_m.x(), 3) + ", " + Fixed(1000 * vector_m.y(), 3) + ", " +
         Fixed(1000 * vector_m.z(), 3) + "] mm";
}

// Returns the poses whose tips are far from the point: misread poses, or a tip that slipped.
std::vector<size_t> Outliers(const ToolTip& tip) {
  constexpr double kTimesMedian = 5;
  std::vector<size_t> outliers;
  const double median_m = Median(tip.misfits_m);
  for (size_t i = 0; i < tip.misfits_m.size(); ++i) {
    if (tip.misfits_m[i] > kTimesMedian * median_m && tip.misfits_m.size() > 4) outliers.push_back(i);
  }
  return outliers;
}

std::string TipText(const ToolTip& tip, const std::vector<PoseRow>& rows) {
  const Eigen::Vector3d sigmas_m = tip.covariance_m2.diagonal().cwiseSqrt();
  std::string text = "gripper_from_tip: " + MmText(tip.in_gripper_m) + "\n";
  text += "  one sigma " + MmText(sigmas_m) + " by the scatter of " + std::to_string(tip.misfits_m.size()) +
          " poses; the errors of the arm, which similar poses share, may make it several times as large\n";
  text += "touched point in the base: " + MmText(tip.touched_in_base_m) + "\n";
  text += "the tips lie " + ShownAmount(1000 * tip.rms_m, 3) + " mm from it (RMS), at most " +
          ShownAmount(1000 * *std::max_element(tip.misfits_m.begin(), tip.misfits_m.end()), 3) + " mm\n";
  for (const size_t i : Outliers(tip)) {
    text += "pose " + std::to_string(i + 1) +
            (rows[i].line > 0 ? " (line " + std::to_string(rows[i].line) + ")" : std::string()) + " is " +
            ShownAmount(1000 * tip.misfits_m[i], 3) + " mm off: misread, or the tip slipped; leave it out\n";
  }
  return text + "tool: {translation: [" + Fixed(1000 * tip.in_gripper_m.x(), 3) + " mm, " +
         Fixed(1000 * tip.in_gripper_m.y(), 3) + " mm, " + Fixed(1000 * tip.in_gripper_m.z(), 3) + " mm]}\n";
}

std::string TipJson(const ToolTip& tip) {
  const auto vector = [](const Eigen::Vector3d& of) { return Json{Finite(of.x()), Finite(of.y()), Finite(of.z())}; };
  Json json{{"schema", "heba/tcp/1"},
            {"tip_in_gripper_m", vector(tip.in_gripper_m)},
            {"std_m", vector(tip.covariance_m2.diagonal().cwiseSqrt())},
            {"covariance_m2", MatrixJson(tip.covariance_m2)},
            {"dof", Finite(tip.dof)},
            {"touched_in_base_m", vector(tip.touched_in_base_m)},
            {"rms_m", Finite(tip.rms_m)}};
  json["misfits_m"] = tip.misfits_m;
  return FileText(json);
}

}  // namespace

int RunCommand_tcp(const std::vector<std::string>& arguments) {
  const std::string format = FLAGS_pose_format.empty() ? "ros" : FLAGS_pose_format;
  MapReader reader(ParseYaml("{pose_format: " + format + "}", "--pose_format"));
  const PoseReading reading = ReadPoseReading(reader);
  const std::vector<PoseRow> rows = ReadPoses(arguments[0], reading.format);
  std::vector<Rigid3d> poses;
  for (const PoseRow& row : rows) poses.push_back(BaseFromGripper(reading, row.pose));
  const Outcome<ToolTip> tip = FindToolTip(poses);
  if (!tip) {
    PrintError(arguments[0] + ": " + FailureText(tip.failure()));
    return kWorkFailed;
  }
  constexpr double kLongestM = 5;
  if (tip->in_gripper_m.norm() > kLongestM) {
    std::cerr << "heba: warning: " << arguments[0] << ": the tip is " << Significant(tip->in_gripper_m.norm(), 3)
              << " m from the gripper; are the positions in mm, and is --pose_format right?" << std::endl;
  }
  std::cout << (FLAGS_json ? TipJson(*tip) : ForTerminal(TipText(*tip, rows))) << std::flush;
  return kDone;
}

}  // namespace heba
