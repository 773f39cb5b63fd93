#include "tools/run/arm_setup.h"

#include <algorithm>
#include <map>
#include <optional>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/robot/arm_errors.h"
#include "heba/robot/arm_postures.h"

namespace heba {
namespace {

// The tool that recorded joints imply may scatter by this much. A larger scatter is no error of an arm.
constexpr double kMostScatterM = 0.05;
constexpr double kMostScatterDeg = 10;

// Sets the joints and the tool from recorded joints.
void SetUpRecorded(const Dataset& dataset, ArmSetup* setup) {
  const Arm& arm = dataset.robot->arm;
  ArmBranch branch{"recorded", {}};
  std::vector<Rigid3d> tools;
  for (const Capture& capture : dataset.captures) {
    branch.joints.emplace_back(
        Eigen::Map<const Eigen::VectorXd>(capture.joints.data(), static_cast<Eigen::Index>(capture.joints.size())));
    tools.push_back(Inverse(BaseFromTip(arm, branch.joints.back())) * capture.base_from_gripper);
  }
  setup->tip_from_gripper = MeanPose(tools);
  for (size_t i = 0; i < tools.size(); ++i) {
    const double apart_m = DistanceM(tools[i], setup->tip_from_gripper);
    const double apart_deg = RadToDeg(AngleRad(tools[i], setup->tip_from_gripper));
    if (apart_m < kMostScatterM && apart_deg < kMostScatterDeg) continue;
    setup->reason = "the recorded joints of capture " + dataset.captures[i].name + " put the tool " +
                    Significant(1000 * apart_m, 3) + " mm and " + Significant(apart_deg, 3) +
                    " deg from where those of the others do; check robot.model, joint_angle, and that joints and "
                    "poses belong together";
    return;
  }
  setup->branches.push_back(std::move(branch));
}

// Returns, for each capture, its posture that is nearest to that of the capture before it.
std::optional<ArmBranch> Continued(const Dataset& dataset, const Rigid3d& gripper_from_tip, Eigen::VectorXd near) {
  ArmBranch branch;
  for (const Capture& capture : dataset.captures) {
    const Outcome<Eigen::VectorXd> found =
        PostureNear(dataset.robot->arm, capture.base_from_gripper * gripper_from_tip, near);
    if (!found) return std::nullopt;
    near = *found;
    branch.joints.push_back(*found);
  }
  return branch;
}

void SetUpRecovered(const Dataset& dataset, ArmSetup* setup) {
  const RobotArm& robot = *dataset.robot;
  setup->tip_from_gripper = robot.tip_from_gripper;
  const Rigid3d gripper_from_tip = Inverse(robot.tip_from_gripper);
  const bool has_near = robot.joints_near.size() > 0;
  const std::optional<Configuration> configuration_near =
      has_near ? ConfigurationOf(robot.arm, robot.joints_near) : std::nullopt;
  if (has_near && !configuration_near) {
    if (std::optional<ArmBranch> branch = Continued(dataset, gripper_from_tip, robot.joints_near)) {
      setup->branches.push_back(std::move(*branch));
    } else {
      setup->reason = "no posture near joints_near continues to the poses of all captures";
    }
    return;
  }
  // The postures of each capture by their configuration.
  std::map<Configuration, ArmBranch> branches;
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    const Capture& capture = dataset.captures[i];
    const Outcome<std::vector<Eigen::VectorXd>> postures =
        PosturesOf(robot.arm, capture.base_from_gripper * gripper_from_tip);
    if (!postures) {
      setup->reason = "the arm " + robot.arm.name + " does not reach the pose of capture " + capture.name + " (" +
                      postures.reason() + "): another arm, a base frame that is not the arm's, or a tool that " +
                      "robot.tool does not state";
      return;
    }
    for (const Eigen::VectorXd& posture : *postures) {
      const std::optional<Configuration> configuration = ConfigurationOf(robot.arm, posture);
      if (!configuration) {
        setup->reason = "the configurations of the arm " + robot.arm.name +
                        " have no names, so that poses do not tell its joints; record them (captures.joints), or " +
                        "state those of the first capture (robot.joints_near)";
        return;
      }
      ArmBranch& branch = branches[*configuration];
      if (branch.joints.size() == i) branch.joints.push_back(posture);
    }
  }
  for (auto& [configuration, branch] : branches) {
    if (branch.joints.size() != dataset.captures.size()) continue;
    if (configuration_near && configuration != *configuration_near) continue;
    branch.name = NameOf(configuration);
    setup->branches.push_back(std::move(branch));
  }
  if (setup->branches.empty()) {
    setup->reason = "no configuration of the arm " + robot.arm.name +
                    " reaches the poses of all captures; record the joints (captures.joints)";
  }
}

}  // namespace

ArmSetup SetUpArm(const Dataset& dataset) {
  ArmSetup setup;
  setup.is_recorded = std::all_of(dataset.captures.begin(), dataset.captures.end(),
                                  [](const Capture& capture) { return !capture.joints.empty(); });
  if (setup.is_recorded) {
    SetUpRecorded(dataset, &setup);
  } else {
    SetUpRecovered(dataset, &setup);
  }
  return setup;
}

std::vector<std::shared_ptr<const PoseEffect>> EffectsOf(const Dataset& dataset, const ArmSetup& setup,
                                                         const ArmBranch& branch) {
  std::vector<std::shared_ptr<const PoseEffect>> effects;
  for (const Eigen::VectorXd& joints : branch.joints) {
    effects.push_back(MakeArmEffect(dataset.robot->arm, joints, setup.tip_from_gripper));
  }
  return effects;
}

}  // namespace heba
