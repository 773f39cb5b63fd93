#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/capture_plan.h"
#include "heba/io/pose_file.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/config/capture_section.h"
#include "tools/config/plan_config.h"
#include "tools/config/robot_section.h"
#include "tools/pages/plan_page.h"
#include "tools/text/console.h"
#include "tools/text/failure_text.h"
#include "tools/text/plan_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

PlanOptions OptionsOfFlags(int num_revisits) {
  PlanOptions options;
  constexpr int kMost = 500;
  if (FLAGS_count < 1 || FLAGS_count > kMost) {
    throw InputError("--count needs a number from 1 to " + std::to_string(kMost) + ", not " +
                     std::to_string(FLAGS_count));
  }
  options.count = FLAGS_count;
  options.num_revisits = num_revisits;
  if (!FLAGS_procedure.empty() && FLAGS_procedure != "two_step") {
    throw InputError("--procedure: must be two_step, or left out for the best poses, not " + Quoted(FLAGS_procedure));
  }
  options.is_two_step = FLAGS_procedure == "two_step";
  constexpr int kFewestOfTwoStep = 5;
  if (options.is_two_step && options.count < kFewestOfTwoStep) {
    throw InputError("--count: the two-step motion has at least 5 poses: one at home, two translations and two turns");
  }
  return options;
}

// Returns the poses in the cell's format, or, if that is of joints, the joints.
std::string PosesText(const PlanConfig& config, const CapturePlan& plan, const std::vector<std::string>& images) {
  std::vector<PoseRow> rows;
  for (size_t i = 0; i < plan.captures.size(); ++i) {
    PoseRow& row = rows.emplace_back();
    row.image = images[i];
    row.role = plan.captures[i].role;
    // The direction is its own inverse.
    row.pose = BaseFromGripper(config.pose_reading, plan.captures[i].base_from_gripper);
  }
  return PoseFileText(rows, config.pose_reading.format);
}

}  // namespace

int RunCommand_plan(const std::vector<std::string>& arguments) {
  const PlanConfig config = ReadPlanConfig(arguments[0], Settings());
  const PlanOptions options = OptionsOfFlags(config.num_revisits);
  const PoseFormat& format = config.pose_reading.format;
  const bool is_of_joints = config.robot && IsOfJoints(format, config.robot->arm);
  if (!format.robot.empty() && !is_of_joints) {
    throw InputError(arguments[0] + ": captures.pose_format has the joints of an arm, which robot.model must name");
  }
  const fs::path out = FLAGS_out.empty() ? config.output : fs::path(FLAGS_out);
  fs::path joints_file = out;
  if (!is_of_joints) joints_file.replace_filename(out.stem().string() + "_joints.csv");
  fs::path page = out;
  page.replace_extension(".html");
  std::error_code error;
  if (page == out || fs::equivalent(out, arguments[0], error) || fs::equivalent(page, arguments[0], error)) {
    throw InputError("--out: " + out.string() + ": would replace " +
                     (page == out ? "the poses by their page" : "the cell") + "; name a file such as poses.csv");
  }
  const Outcome<CapturePlan> plan = PlanCaptures(config.cell, options);
  if (!plan) {
    PrintError(arguments[0] + ": " + FailureText(plan.failure()));
    return kWorkFailed;
  }
  const std::vector<std::string> images = PlannedImages(*plan, config.former_names);
  std::vector<Eigen::VectorXd> joints;
  for (const PlannedCapture& capture : plan->captures) {
    joints.push_back(capture.posture.joints);
    const bool are_deg = is_of_joints ? format.angle_unit == "deg" : config.joints_are_deg;
    for (Eigen::Index j = 0; are_deg && j < joints.back().size(); ++j) {
      if (config.robot->arm.joints[static_cast<size_t>(j)].is_turning) joints.back()[j] = RadToDeg(joints.back()[j]);
    }
  }
  if (!is_of_joints) WriteFileAtomically(out, PosesText(config, *plan, images));
  if (config.robot) WriteFileAtomically(joints_file, JointsFileText(config.robot->arm, images, joints));
  WriteFileAtomically(page, PlanPage(config, *plan));
  std::cout << ForTerminal(PlanTable(config.requirements, *plan, config.former_names))
            << "poses: " << (is_of_joints ? joints_file : out).string();
  if (config.robot && !is_of_joints) std::cout << "\njoints: " << joints_file.string();
  std::cout << "\npage: " << page.string() << std::endl;
  return kDone;
}

}  // namespace heba
