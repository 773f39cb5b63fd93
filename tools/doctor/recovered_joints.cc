#include "tools/doctor/recovered_joints.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <utility>

#include "heba/base/parallel.h"
#include "heba/robot/arm_errors.h"
#include "heba/robot/arm_postures.h"

namespace heba {
namespace {

using Mistake = ArmReading::Mistake;

Rigid3d AlongZ(double length_m) { return Rigid3d(Eigen::Quaterniond::Identity(), {0, 0, length_m}); }

// Returns the lengths from -most to most in these steps, the shortest first, without zero.
std::vector<double> Lengths(double most_m, double step_m) {
  std::vector<double> lengths;
  for (int k = 1; k * step_m < most_m + 0.5 * step_m; ++k) {
    for (const double sign : {1.0, -1.0}) lengths.push_back(sign * k * step_m);
  }
  return lengths;
}

// Returns the posture of one capture next to joints_near; nothing if none is found.
std::optional<Eigen::VectorXd> PostureNearby(const ArmReading& reading, const Rigid3d& base_from_tip, size_t capture) {
  if (reading.joints_near.empty() || reading.joints_near[capture].size() == 0) return std::nullopt;
  Outcome<Eigen::VectorXd> found = PostureNear(reading.arm, base_from_tip, reading.joints_near[capture]);
  if (!found) return std::nullopt;
  return std::move(*found);
}

// Returns the joints of all captures next to joints_near; nothing if they are not found in all captures.
std::optional<ArmBranch> BranchNearby(const ArmReading& reading, const std::vector<Rigid3d>& base_from_tip) {
  ArmBranch branch;
  for (size_t i = 0; i < base_from_tip.size(); ++i) {
    std::optional<Eigen::VectorXd> found = PostureNearby(reading, base_from_tip[i], i);
    if (!found) return std::nullopt;
    branch.joints.push_back(std::move(*found));
  }
  return branch;
}

// Returns whether the arm reaches all poses, in one configuration if its configurations have names.
bool ReachesAll(const ArmReading& reading, const std::vector<Rigid3d>& base_from_tip,
                const std::vector<size_t>& order) {
  if (BranchNearby(reading, base_from_tip)) return true;
  std::vector<std::vector<Eigen::VectorXd>> postures(base_from_tip.size());
  for (const size_t i : order) {
    Outcome<std::vector<Eigen::VectorXd>> found = PosturesOf(reading.arm, base_from_tip[i]);
    if (!found) return false;
    postures[i] = std::move(*found);
  }
  const bool has_names = ConfigurationOf(reading.arm, postures.front().front()).has_value();
  const std::vector<ArmBranch> branches = BranchesOf(reading.arm, base_from_tip, postures);
  return !has_names ||
         std::any_of(branches.begin(), branches.end(), [](const ArmBranch& branch) { return branch.ReachesAll(); });
}

// Returns the joints of all captures in each configuration in which the arm reaches all poses.
std::vector<ArmBranch> BranchesFor(const ArmReading& reading, const std::vector<Rigid3d>& base_from_gripper,
                                   const std::vector<std::string>& only) {
  const std::vector<Rigid3d> base_from_tip = TipPoses(reading, base_from_gripper);
  if (std::optional<ArmBranch> branch = BranchNearby(reading, base_from_tip)) return {std::move(*branch)};
  std::vector<std::vector<Eigen::VectorXd>> postures;
  for (const Rigid3d& pose : base_from_tip) {
    Outcome<std::vector<Eigen::VectorXd>> found = PosturesOf(reading.arm, pose);
    if (!found) return {};
    postures.push_back(std::move(*found));
  }
  std::vector<ArmBranch> branches = BranchesOf(reading.arm, base_from_tip, postures);
  std::erase_if(branches, [&](const ArmBranch& branch) {
    if (!branch.ReachesAll()) return true;
    return !only.empty() && std::find(only.begin(), only.end(), branch.name) == only.end();
  });
  return branches;
}

}  // namespace

bool HaveSameMaker(const Arm& a, const Arm& b) {
  const auto maker_of = [](const Arm& arm) { return arm.name.substr(0, arm.name.find_first_of("_0123456789")); };
  return maker_of(a) == maker_of(b);
}

std::vector<ArmReading> OtherArms(const ArmReading& stated, const std::vector<Arm>& arms) {
  std::vector<ArmReading> others;
  for (const Arm& arm : arms) {
    if (arm.num_joints() != stated.arm.num_joints() || arm.name == stated.arm.name) continue;
    others.push_back(stated);
    others.back().mistake = Mistake::kArm;
    others.back().arm = arm;
  }
  std::stable_partition(others.begin(), others.end(),
                        [&](const ArmReading& other) { return HaveSameMaker(other.arm, stated.arm); });
  return others;
}

std::vector<ArmReading> OtherTools(const ArmReading& stated, double step_m) {
  constexpr double kMostM = 0.4;
  std::vector<ArmReading> others;
  for (const double length_m : Lengths(kMostM, step_m)) {
    others.push_back(stated);
    others.back().mistake = Mistake::kTool;
    others.back().length_m = length_m;
    others.back().tip_from_gripper = AlongZ(length_m) * stated.tip_from_gripper;
  }
  return others;
}

std::vector<ArmReading> OtherBases(const ArmReading& stated, double step_m) {
  constexpr double kMostM = 1;
  std::vector<ArmReading> others;
  const auto add = [&](const Rigid3d& arm_base_from_base, double length_m) {
    others.push_back(stated);
    others.back().mistake = Mistake::kBase;
    others.back().length_m = length_m;
    others.back().arm_base_from_base = arm_base_from_base;
  };
  // A rotation of the base about its z axis is one of the first joint, which the poses do not tell.
  add(Rigid3d(ExpRotation({std::numbers::pi, 0, 0}), Eigen::Vector3d::Zero()), 0);
  for (const double length_m : Lengths(kMostM, step_m)) add(AlongZ(-length_m), length_m);
  return others;
}

std::vector<Rigid3d> TipPoses(const ArmReading& reading, const std::vector<Rigid3d>& base_from_gripper) {
  const Rigid3d gripper_from_tip = Inverse(reading.tip_from_gripper);
  std::vector<Rigid3d> poses;
  for (const Rigid3d& pose : base_from_gripper) poses.push_back(reading.arm_base_from_base * pose * gripper_from_tip);
  return poses;
}

std::vector<ArmReading> Reaching(const std::vector<ArmReading>& readings, const std::vector<Rigid3d>& base_from_gripper,
                                 const std::vector<size_t>& hard_first, int num_threads) {
  std::vector<char> reaches(readings.size(), 0);
  ParallelFor(static_cast<int>(readings.size()), num_threads, [&](int index) {
    const auto i = static_cast<size_t>(index);
    reaches[i] = ReachesAll(readings[i], TipPoses(readings[i], base_from_gripper), hard_first) ? 1 : 0;
  });
  std::vector<ArmReading> reaching;
  for (size_t i = 0; i < readings.size(); ++i) {
    if (reaches[i] != 0) reaching.push_back(readings[i]);
  }
  return reaching;
}

std::vector<FittedReading> FitReadings(const PairCalibration& calibration, const PairCalibrationOptions& options,
                                       const std::vector<ArmReading>& readings,
                                       const std::vector<Rigid3d>& base_from_gripper,
                                       const std::vector<std::string>& only, int num_threads) {
  struct Task {
    const ArmReading* reading;
    ArmBranch branch;
    std::optional<EffectsFit> fit;
  };
  std::vector<Task> tasks;
  for (const ArmReading& reading : readings) {
    for (ArmBranch& branch : BranchesFor(reading, base_from_gripper, only)) {
      tasks.push_back({&reading, std::move(branch), {}});
    }
  }
  ParallelFor(static_cast<int>(tasks.size()), num_threads, [&](int index) {
    Task& task = tasks[static_cast<size_t>(index)];
    const ArmReading& reading = *task.reading;
    BundleOptions bundle = calibration.bundle;
    bundle.num_threads = 1;
    bundle.target_scale_sigma = AsMeasured(bundle.known_target_scale_sigma);
    bundle.effects = std::make_shared<const SharedEffects>(ArmErrors(reading.arm, ArmErrorModel::kGeometry));
    task.fit = FitEffects({calibration.camera, calibration.views, options.setup, options.shape}, *calibration.refined,
                          bundle, {EffectsOf(reading.arm, reading.tip_from_gripper, task.branch)})
                   .front();
  });
  std::vector<FittedReading> fitted;
  for (Task& task : tasks) {
    if (task.fit) fitted.push_back({*task.reading, std::move(task.branch), *task.fit});
  }
  return fitted;
}

}  // namespace heba
