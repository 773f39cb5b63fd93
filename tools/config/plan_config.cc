#include "tools/config/plan_config.h"

#include <algorithm>
#include <cmath>

#include "heba/base/error.h"
#include "heba/robot/arm_postures.h"
#include "tools/config/capture_section.h"
#include "tools/config/common_keys.h"
#include "tools/config/evaluate_section.h"
#include "tools/config/file_kind.h"
#include "tools/config/finished_run.h"
#include "tools/config/long_form.h"
#include "tools/config/plan_section.h"
#include "tools/config/robot_section.h"
#include "tools/config/run_config.h"
#include "tools/config/run_folder.h"
#include "tools/run/captures.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

// Returns whether a posture is one that a cell permits: no joint of the arm is in a box that is kept out or, if the
// base stands on a plane, behind that. The first joints, which are above the base in every posture, may be in a box
// around the base.
bool IsPermitted(const Arm& arm, const Eigen::VectorXd& joints, bool has_plane, const std::vector<PlanBox>& keep_out) {
  constexpr double kBehindM = 1e-3;
  constexpr double kAboveBaseM = 0.1;
  bool has_left_base = false;
  for (const Eigen::Vector3d& origin_m : OriginsOf(arm, joints)) {
    has_left_base = has_left_base || origin_m.head<2>().norm() > kAboveBaseM;
    if (!has_left_base) continue;
    if (has_plane && origin_m.z() < -kBehindM) return false;
    for (const PlanBox& box : keep_out) {
      if (box.Contains(origin_m)) return false;
    }
  }
  return true;
}

// Returns the cell with the postures in which an arm reaches a pose, of those that its limits and the cell permit, and
// with the poses that an arm of few joints reaches: the one near `joints_near`, if that is set, or all. The base stands
// on a plane unless the workspace goes beyond it.
PlanCell WithPostures(PlanCell cell, const RobotArm& robot) {
  cell.posture_distance = [arm = robot.arm](const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
    return PostureDistance(arm, a, b);
  };
  const bool has_few_joints = robot.arm.num_joints() < 6;
  if (has_few_joints) {
    cell.nearest_reached = [robot](const Rigid3d& base_from_gripper) {
      const std::optional<Eigen::VectorXd> joints =
          NearestPostureTo(robot.arm, base_from_gripper * Inverse(robot.tip_from_gripper));
      return joints ? BaseFromTip(robot.arm, *joints) * robot.tip_from_gripper : base_from_gripper;
    };
  }
  const bool has_plane = cell.workspace && cell.workspace->low_m.z() >= 0;
  cell.postures = [robot, has_few_joints, has_plane, keep_out = cell.keep_out](const Rigid3d& base_from_gripper) {
    const Rigid3d base_from_tip = base_from_gripper * Inverse(robot.tip_from_gripper);
    std::vector<Eigen::VectorXd> found;
    if (robot.joints_near.size() == robot.arm.num_joints()) {
      const Outcome<Eigen::VectorXd> near = PostureNear(robot.arm, base_from_tip, robot.joints_near);
      const std::optional<Eigen::VectorXd> joints = near ? WithinLimits(robot.arm, *near) : std::nullopt;
      if (joints) found = {*joints};
    } else if (has_few_joints) {
      // The poses are those that it reaches, in this posture.
      const std::optional<Eigen::VectorXd> joints = NearestPostureTo(robot.arm, base_from_tip);
      if (joints) found = {*joints};
      std::erase_if(found, [&](const Eigen::VectorXd& near) {
        return LocalCoordinates(base_from_tip, BaseFromTip(robot.arm, near)).norm() > kReached;
      });
    } else {
      Outcome<std::vector<Eigen::VectorXd>> all = PosturesWithinLimits(robot.arm, base_from_tip);
      if (all) found = *std::move(all);
    }
    std::vector<PlanPosture> postures;
    for (Eigen::VectorXd& joints : found) {
      if (!IsPermitted(robot.arm, joints, has_plane, keep_out)) continue;
      const std::optional<Configuration> configuration = ConfigurationOf(robot.arm, joints);
      postures.push_back({std::move(joints), configuration ? NameOf(*configuration) : ""});
    }
    return postures;
  };
  return cell;
}

// Returns the knowledge of a camera file with sigmas.
Covariance KnownCamera(const Camera& camera, const std::vector<ParameterGroup>& free, const CameraPrior& prior) {
  Covariance known;
  std::vector<bool> is_free;
  std::vector<double> variances;
  for (size_t i = 0; i < camera.params.size(); ++i) {
    const bool is_of_free = std::find(free.begin(), free.end(), GroupOf(static_cast<int>(i))) != free.end();
    is_free.push_back(is_of_free && std::isfinite(prior.sigmas[i]));
    if (is_free.back()) variances.push_back(prior.sigmas[i] * prior.sigmas[i]);
  }
  known.layout.AddCamera(kCameraBlock, camera.Model(), is_free);
  known.matrix =
      Eigen::Map<Eigen::VectorXd>(variances.data(), static_cast<Eigen::Index>(variances.size())).asDiagonal();
  return known;
}

// Returns the cell with what the plan takes from its target.
PlanCell WithTarget(PlanCell cell, const Target& target) {
  cell.points_in_target = AllPoints(target).points_in_target;
  cell.z_out = target.Draw().y_up;
  return cell;
}

// Returns the places of all requirements.
std::vector<Eigen::Vector3d> PlacesOf(const std::vector<PlacedRequirement>& requirements) {
  std::vector<Eigen::Vector3d> all;
  for (const PlacedRequirement& requirement : requirements) {
    const std::vector<Eigen::Vector3d>& places = requirement.places_in_base_m;
    all.insert(all.end(), places.begin(), places.end());
  }
  return all;
}

// Reads the section `robot`; returns nothing if it names no arm.
std::optional<RobotArm> ReadArm(MapReader& root) {
  const std::optional<ConfigValue> value = root.Find("robot");
  if (!value || NamesNoArm(*value)) return std::nullopt;
  MapReader reader(*value);
  ReadRobotScale(reader);
  RobotArm robot = ReadRobotArm(reader).robot;
  reader.Finish();
  return robot;
}

void CheckReach(const fs::path& path, const PlanConfig& config) {
  if (config.cell.workspace || config.robot) return;
  throw InputError(path.string() +
                   ": plan.workspace is needed where no arm is named (robot.model): where the gripper may go, such as "
                   "{box: [[300 mm, -300 mm, 100 mm], [800 mm, 300 mm, 600 mm]]}");
}

PlanConfig ReadCell(const fs::path& path, const std::vector<std::string>& settings) {
  RefuseFolder(path, FileKind::kRunConfig);
  const ConfigValue file = ReadYamlFileOverBases(path, {"name", "output"});
  const ConfigValue value = settings.empty() ? file : ConfigValue::Stack({ParseSettings(settings), file});
  if (HasLongForm(value)) {
    throw InputError(path.string() + ": is the config of a rig; a cell of one camera and one target is needed");
  }
  MapReader root(value);
  PlanConfig config;
  config.name = ReadFolderName(root, path.stem().string());
  const fs::path folder = fs::absolute(path).parent_path();
  config.output = folder / (path.stem().string() + "_plan.csv");
  PlanSection plan = ReadPlan(root);
  if (!plan.hand_eye) {
    throw InputError(path.string() +
                     ": plan.hand_eye and plan.board are needed: roughly, where the camera and the target are mounted "
                     "(translation and rotation, as in a scene)");
  }
  config.cell = plan.cell;
  config.cell.hand_eye = *plan.hand_eye;
  config.num_revisits = plan.num_revisits;
  config.cell.setup = *FindSetup(root.Choice("setup", SetupNames()));
  config.target = ReadTarget(root, "target");
  config.cell = WithTarget(std::move(config.cell), *config.target);

  MapReader camera = root.Section("camera");
  const CameraKeys keys = ReadCameraKeys(camera);
  if (!keys.camera && !plan.lens) {
    throw InputError(path.string() + ": a camera file (camera.intrinsics) or plan.lens is needed");
  }
  config.cell.camera = keys.camera ? *keys.camera : plan.lens->camera;
  if (config.cell.camera.width_px <= 0) camera.Get("intrinsics").Fail("the file must state the size of the images");
  if (plan.lens) {
    config.cell.nearest_m = plan.lens->nearest_m;
    config.cell.farthest_m = plan.lens->farthest_m;
  }
  MapReader refine = root.Section("refine");
  config.cell.free_intrinsics = ReadFreeIntrinsics(refine, BundleOptions().free_intrinsics);
  const std::optional<CameraPrior> prior =
      ReadIntrinsicsPrior(refine, keys, config.cell.free_intrinsics, "camera.intrinsics");
  if (prior) config.cell.known = KnownCamera(config.cell.camera, config.cell.free_intrinsics, *prior);

  MapReader captures = root.Section("captures");
  config.pose_reading = ReadPoseReading(captures);
  config.joints_are_deg = ReadJointsAreDeg(captures);
  config.robot = ReadArm(root);
  if (config.robot) config.cell = WithPostures(std::move(config.cell), *config.robot);
  MapReader evaluate = root.Section("evaluate");
  config.requirements = ReadRequirements(evaluate);
  config.cell.places_in_base_m = PlacesOf(config.requirements);
  // The other keys are those of the run that follows.
  for (const char* key : {"about", "seed", "methods", "output", "check", "prior"}) root.Find(key);
  root.Finish();
  CheckReach(path, config);
  return config;
}

// Returns the box around the poses of a run, somewhat enlarged.
PlanBox BoxAround(const std::vector<Rigid3d>& base_from_gripper) {
  PlanBox box{base_from_gripper.front().translation, base_from_gripper.front().translation};
  for (const Rigid3d& pose : base_from_gripper) {
    box.low_m = box.low_m.cwiseMin(pose.translation);
    box.high_m = box.high_m.cwiseMax(pose.translation);
  }
  constexpr double kShare = 0.1;
  const Eigen::Vector3d more = kShare * (box.high_m - box.low_m);
  return {box.low_m - more, box.high_m + more};
}

PlanConfig ReadRun(const fs::path& path) {
  const fs::path folder = RunFolderOf(path);
  const FinishedRun run = ReadFinishedRun(folder);
  const RunResult& result = run.result;
  if (result.rig.cameras.size() != 1 || result.rig.targets.size() != 1 || result.rig.robots.size() != 1) {
    throw InputError(folder.string() + ": is the run of a rig; one of one camera, one target and one arm is needed");
  }
  const RunConfig before = ReadShortRunConfig(folder / "config.yaml");
  MapReader root(ReadYamlFile(folder / "config.yaml"));
  const PlanSection plan = ReadPlan(root);
  PlanConfig config;
  config.name = result.name;
  config.output = fs::absolute(folder).lexically_normal();
  if (config.output.filename().empty()) config.output = config.output.parent_path();
  config.output += "_plan.csv";
  config.cell = plan.cell;
  config.num_revisits = plan.num_revisits;
  config.cell.setup = SetupOf(before.data);
  const Solution& solution = result.solution;
  config.cell.hand_eye = {solution.poses.mount_from_camera.front(), solution.poses.mount_from_target.front()};
  config.cell.camera = solution.cameras.front();
  config.cell.free_intrinsics = result.rig.cameras.front().free_intrinsics;
  config.cell.known =
      solution.covariance_repeatable.matrix.size() > 0 ? solution.covariance_repeatable : solution.covariance;
  // The poses are known: a planned pose must be safe against three sigmas.
  constexpr double kSigmas = 3;
  const auto size_of = [&](Eigen::Index first) {
    double largest = 0;
    for (const std::string& block :
         {CameraPoseBlock(result.rig.cameras.front()), TargetPoseBlock(result.rig.targets.front())}) {
      const std::optional<Eigen::Matrix<double, 6, 6>> covariance = PoseCovarianceOf(config.cell.known, block);
      if (covariance) largest = std::max(largest, std::sqrt(covariance->diagonal().segment<3>(first).sum()));
    }
    return kSigmas * largest;
  };
  config.cell.uncertainty_m = std::max(1e-6, size_of(0));
  config.cell.uncertainty_rad = std::max(1e-6, size_of(3));
  config.cell.pixel_noise_px = solution.pixel_sigmas_px.front();
  if (!plan.has_noise) {
    const RobotNoise random = solution.robot_noise.front().value_or(RobotNoise{});
    const RobotNoise smooth = SmoothNoiseOf(solution, 0).value_or(RobotNoise{});
    config.cell.robot_noise = {std::hypot(random.translation_m, smooth.translation_m),
                               std::hypot(random.rotation_rad, smooth.rotation_rad)};
  }
  config.target = run.targets.front();
  config.cell = WithTarget(std::move(config.cell), *config.target);
  config.pose_reading = run.pose_readings.front();
  config.joints_are_deg = run.joints_are_deg.front();
  config.robot = before.data.arms.front();
  config.requirements = before.options.requirements;
  config.cell.places_in_base_m = PlacesOf(config.requirements);
  for (const Recording& capture : before.data.captures) {
    config.former_names.push_back(capture.name);
    config.cell.former_poses.push_back(capture.base_from_gripper.front());
  }
  if (!config.cell.workspace) config.cell.workspace = BoxAround(config.cell.former_poses);
  if (config.robot) config.cell = WithPostures(std::move(config.cell), *config.robot);
  return config;
}

}  // namespace

PlanConfig ReadPlanConfig(const fs::path& path, const std::vector<std::string>& settings) {
  std::error_code error;
  const bool is_run = fs::is_regular_file(path / "result.json", error) || path.filename() == "result.json";
  if (!is_run) return ReadCell(path, settings);
  if (!settings.empty()) throw InputError("--set: changes a cell's file, not a finished run");
  return ReadRun(path);
}

}  // namespace heba
