#include "tools/doctor/recorded_joints.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/even_indices.h"
#include "heba/base/units.h"
#include "solvers/initial/pose_consistency.h"

namespace heba {
namespace {

using Mistake = JointReading::Mistake;
using AllJoints = std::vector<Eigen::VectorXd>;

// The distance at which a rotation of the tool counts as a translation.
constexpr double kLeverM = 0.5;

double Quantile70(std::vector<double> values) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(values.size() * 7 / 10);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

double MisfitM(const Rigid3d& a, const Rigid3d& b) { return DistanceM(a, b) + kLeverM * AngleRad(a, b); }

// Returns the tool that the poses share, from the tool in each capture.
ImpliedTool SharedTool(const std::vector<Rigid3d>& tools) {
  const auto misfits_to = [&](const Rigid3d& tool) {
    std::vector<double> misfits;
    for (const Rigid3d& other : tools) misfits.push_back(MisfitM(tool, other));
    return misfits;
  };
  // The tool of a capture that is near most others is not affected by the rest.
  constexpr size_t kMostStarts = 15;
  double least_m = std::numeric_limits<double>::infinity();
  const Rigid3d* middle = &tools.front();
  for (const size_t i : EvenIndices(tools.size(), kMostStarts)) {
    const double misfit_m = Quantile70(misfits_to(tools[i]));
    if (misfit_m >= least_m) continue;
    least_m = misfit_m;
    middle = &tools[i];
  }
  std::vector<Rigid3d> near;
  for (const Rigid3d& tool : tools) {
    if (MisfitM(tool, *middle) <= least_m) near.push_back(tool);
  }
  ImpliedTool shared;
  shared.tip_from_gripper = MeanPose(near);
  std::vector<double> distances_m;
  std::vector<double> angles_rad;
  for (const Rigid3d& tool : tools) {
    distances_m.push_back(DistanceM(tool, shared.tip_from_gripper));
    angles_rad.push_back(AngleRad(tool, shared.tip_from_gripper));
  }
  shared.scatter_m = Quantile70(distances_m);
  shared.scatter_rad = Quantile70(angles_rad);
  shared.misfit_m = Quantile70(misfits_to(shared.tip_from_gripper));
  return shared;
}

AllJoints Scaled(const Arm& arm, AllJoints joints, double factor) {
  for (Eigen::VectorXd& of_capture : joints) {
    for (Eigen::Index j = 0; j < of_capture.size(); ++j) {
      if (arm.joints[static_cast<size_t>(j)].is_turning) of_capture[j] *= factor;
    }
  }
  return joints;
}

// Returns how the poses' base lies in that of the arm if neither it nor the tool is known (robot-world/hand-eye
// calibration); nothing if the captures do not determine it.
std::optional<Rigid3d> ArmBaseFromBase(const Arm& arm, const AllJoints& joints,
                                       const std::vector<Rigid3d>& base_from_gripper) {
  std::vector<PoseCandidates> captures;
  for (size_t i = 0; i < joints.size(); ++i) {
    captures.push_back({base_from_gripper[i], {BaseFromTip(arm, joints[i])}});
  }
  const std::optional<PoseConsistency> found = FindPoseConsistency(captures, RobotScale::kOne);
  if (!found) return std::nullopt;
  return Inverse(found->hand_eye.camera_mount_from_camera);
}

// Returns the joints of each capture if the rows are in another order. A shift leaves out the rows that are lost.
AllJoints Reordered(const AllJoints& joints, std::ptrdiff_t shift) {
  AllJoints moved(joints.size());
  for (size_t i = 0; i < joints.size(); ++i) {
    const std::ptrdiff_t from = static_cast<std::ptrdiff_t>(i) + shift;
    if (from >= 0 && from < static_cast<std::ptrdiff_t>(joints.size())) moved[i] = joints[static_cast<size_t>(from)];
  }
  return moved;
}

std::string ShiftText(std::ptrdiff_t shift) {
  const std::string rows = std::to_string(std::abs(shift)) + (std::abs(shift) == 1 ? " row" : " rows");
  return "the joints of each capture are " + rows + (shift > 0 ? " further down" : " further up") +
         " in the file of joints";
}

ImpliedTool ToolOf(const JointReading& reading, const std::vector<Rigid3d>& base_from_gripper) {
  std::vector<Rigid3d> tools;
  for (size_t i = 0; i < base_from_gripper.size(); ++i) {
    if (reading.joints[i].size() == 0) continue;
    tools.push_back(Inverse(BaseFromTip(reading.arm, reading.joints[i])) * reading.arm_base_from_base *
                    base_from_gripper[i]);
  }
  return SharedTool(tools);
}

}  // namespace

ImpliedTool ImpliedToolOf(const Arm& arm, const AllJoints& joints, const std::vector<Rigid3d>& base_from_gripper) {
  return ReadingAsStated(arm, joints, base_from_gripper).tool;
}

JointReading ReadingAsStated(const Arm& arm, const AllJoints& joints, const std::vector<Rigid3d>& base_from_gripper) {
  CHECK_EQ(joints.size(), base_from_gripper.size());
  JointReading reading{arm, joints, {}, {}, {}, {}};
  reading.tool = ToolOf(reading, base_from_gripper);
  return reading;
}

std::vector<JointReading> OtherReadings(const Arm& arm, const std::vector<Arm>& arms, const AllJoints& joints,
                                        const std::vector<Rigid3d>& base_from_gripper) {
  std::vector<JointReading> readings;
  const Rigid3d rotated(ExpRotation({0, 0, std::numbers::pi}), Eigen::Vector3d::Zero());
  for (const double factor : {1.0, DegToRad(1), RadToDeg(1)}) {
    const AllJoints scaled = Scaled(arm, joints, factor);
    const auto add = [&](const Arm& of, AllJoints of_captures, const Rigid3d& arm_base_from_base,
                         std::optional<Mistake> mistake, std::string pairing) {
      JointReading reading{of, std::move(of_captures), arm_base_from_base, {}, std::move(pairing), {}};
      if (factor != 1) reading.mistakes.push_back(Mistake::kAngle);
      if (mistake) reading.mistakes.push_back(*mistake);
      readings.push_back(std::move(reading));
    };
    if (factor != 1) add(arm, scaled, {}, std::nullopt, "");
    add(arm, scaled, rotated, Mistake::kBase, "");
    for (const Arm& other : arms) {
      if (other.num_joints() != arm.num_joints() || other.name == arm.name) continue;
      add(other, scaled, {}, Mistake::kArm, "");
    }
    AllJoints reversed = scaled;
    std::reverse(reversed.begin(), reversed.end());
    add(arm, reversed, {}, Mistake::kPairing, "the joints are in the reverse order of the captures");
    const auto most = std::min<std::ptrdiff_t>(10, static_cast<std::ptrdiff_t>(joints.size()) - 4);
    for (std::ptrdiff_t by = 1; by <= most; ++by) {
      for (const std::ptrdiff_t shift : {by, -by}) {
        add(arm, Reordered(scaled, shift), {}, Mistake::kPairing, ShiftText(shift));
      }
    }
    if (const std::optional<Rigid3d> base = ArmBaseFromBase(arm, scaled, base_from_gripper)) {
      add(arm, scaled, *base, Mistake::kBase, "");
    }
  }
  for (JointReading& reading : readings) reading.tool = ToolOf(reading, base_from_gripper);
  std::stable_sort(readings.begin(), readings.end(),
                   [](const auto& a, const auto& b) { return a.mistakes.size() < b.mistakes.size(); });
  return readings;
}

}  // namespace heba
