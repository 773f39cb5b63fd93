// The reading functions of result_file.h.
#include <algorithm>
#include <limits>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "heba/base/units.h"
#include "heba/data/hand_eye.h"
#include "heba/evaluation/verdict.h"
#include "heba/io/arm_json.h"
#include "heba/io/json_reader.h"
#include "heba/io/result_file.h"
#include "heba/io/result_json.h"

namespace heba {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr size_t kMaxBytes = size_t{256} << 20;
constexpr size_t kMaxTruthBytes = size_t{1} << 20;

// These two functions return the figures of a solve that both schemas have.
Convergence ReadConvergence(const JsonReader& solve) {
  Convergence convergence;
  convergence.converged = true;
  convergence.iterations = solve.Get("iterations").Int(0, kMostCounted);
  convergence.initial_cost = ReadFinite(solve, "initial_cost", kInfinity);
  convergence.final_cost = ReadFinite(solve, "final_cost", kInfinity);
  convergence.seconds = ReadMagnitude(solve, "seconds");
  convergence.message = solve.Get("message").Text();
  return convergence;
}
double ReadCovarianceDof(const JsonReader& solve) {
  const double dof = ReadOptionalMagnitude(solve, "covariance_dof").value_or(kInfinity);
  if (dof < 1) solve.Get("covariance_dof").Fail("must be at least 1");
  return dof;
}

// Returns the problem with those groups of parameters free, too, of which a covariance has a name.
Problem WithFreeGroups(Problem problem, const JsonReader& covariance) {
  const std::vector<std::string> names = ReadOrder(covariance);
  const auto has = [&](const std::string& name) { return std::find(names.begin(), names.end(), name) != names.end(); };
  const auto add = [](auto group, auto* groups) {
    if (std::find(groups->begin(), groups->end(), group) == groups->end()) groups->push_back(group);
  };
  for (ProblemCamera& camera : problem.cameras) {
    if (camera.camera.params.empty()) continue;
    const std::vector<std::string>& params = camera.camera.Model().param_names();
    for (size_t i = 0; i < params.size(); ++i) {
      if (has(CameraBlock(camera) + "." + params[i])) add(GroupOf(static_cast<int>(i)), &camera.free_intrinsics);
    }
  }
  for (ProblemTarget& target : problem.targets) {
    for (size_t i = 0; i < kTargetShapeParamNames.size(); ++i) {
      const std::string name = TargetShapeBlock(target) + "." + std::string(kTargetShapeParamNames[i]);
      if (has(name)) add(ShapeGroupOf(static_cast<int>(i)), &target.free_shape);
    }
  }
  return problem;
}

// Reads the covariance of the unknowns of a problem.
Covariance ReadCovariance(const JsonReader& reader, const Problem& problem) {
  const UnknownLayout layout = UnknownsOf(problem);
  CheckOrder(reader.Get("order"), ReadOrder(reader), layout);
  return ReadCovarianceMatrix(reader, layout);
}

// Parts of the result of one camera.

Errors ReadErrors(const JsonReader& reader) {
  Errors errors = ReadFigures<Errors>(reader);
  errors.holdout_chi2 = ReadOptionalMagnitude(reader, "holdout_chi2_per_dof");
  errors.holdout_sigmas = ReadOptionalMagnitude(reader, "holdout_sigmas");
  errors.axxb_mean_mm = ReadOptionalMagnitude(reader, "axxb_mean_mm");
  if (reader.Has("board_translation_rms_mm") && reader.Has("board_rotation_rms_deg")) {
    errors.board_scatter = BoardScatter{ReadMagnitude(reader, "board_translation_rms_mm"),
                                        ReadMagnitude(reader, "board_rotation_rms_deg")};
  }
  if (reader.Has("truth")) {
    const JsonReader truth = reader.Get("truth");
    errors.truth = TruthErrors{ReadMagnitude(truth, "hand_eye_mm"), ReadMagnitude(truth, "hand_eye_deg"),
                               ReadOptionalMagnitude(truth, "board_mm"), ReadOptionalMagnitude(truth, "board_deg"),
                               ReadOptionalMagnitude(truth, "focal_px")};
  }
  return errors;
}

// Returns the effects of the arm, without their groups, of which a covariance has the names; null if it has none.
std::shared_ptr<const SharedEffects> ReadEffectNames(const JsonReader& covariance) {
  SharedEffects effects;
  const std::string of_robot = std::string(kRobotBlock) + ".";
  for (const std::string& name : ReadOrder(covariance)) {
    if (name.starts_with(of_robot)) effects.effects.push_back({name.substr(of_robot.size())});
  }
  return effects.effects.empty() ? nullptr : std::make_shared<const SharedEffects>(std::move(effects));
}

PairSolution ReadSolution(const JsonReader& reader, const Estimate& estimate, Setup setup) {
  PairSolution solution;
  solution.hand_eye = estimate.hand_eye;
  solution.camera = estimate.camera;
  if (reader.Has("target_shape")) solution.shape = ReadShapeJson(reader.Get("target_shape"));
  if (reader.Has("covariance")) {
    Problem problem = HandEyeProblem(setup, solution);
    problem.effects = {ReadEffectNames(reader.Get("covariance"))};
    problem = WithFreeGroups(std::move(problem), reader.Get("covariance"));
    solution.covariance = ReadCovariance(reader.Get("covariance"), problem);
    if (reader.Has("covariance_repeatable")) {
      problem = WithFreeGroups(std::move(problem), reader.Get("covariance_repeatable"));
      solution.covariance_repeatable = ReadCovariance(reader.Get("covariance_repeatable"), problem);
    }
  }
  const JsonReader solve = reader.Get("solve");
  solution.convergence = ReadConvergence(solve);
  solution.covariance_dof = ReadCovarianceDof(solve);
  solution.pixel_sigma_px = ReadMagnitude(solve, "pixel_sigma");
  solution.robot_noise = ReadNoise(solve, "robot_sigma_");
  if (solution.robot_noise) {
    solution.robot_noise->joint_rad = DegToRad(ReadOptionalMagnitude(solve, "joint_sigma_deg").value_or(0));
  }
  solution.smooth_noise = ReadNoise(solve, "smooth_sigma_");
  return solution;
}

Estimate ReadEstimate(const JsonReader& reader, Setup setup) {
  Estimate estimate;
  estimate.method = reader.Get("method").Text();
  estimate.kind = ReadEnum<EstimateKind>(reader.Get("kind"), "kind", kEstimateKindNames);
  estimate.ok = reader.Get("ok").Bool();
  estimate.reason = Failure(reader.Get("reason").Text());
  estimate.errors = ReadErrors(reader.Get("errors"));
  if (!estimate.ok) return estimate;
  estimate.hand_eye = {ReadPoseJson(reader.Get("hand_eye"), CameraMountName(setup), "camera"),
                       ReadPoseJson(reader.Get("board"), TargetMountName(setup), "target")};
  if (reader.Has("camera")) estimate.camera = ReadCameraJson(reader.Get("camera"));
  if (estimate.method == "bundle" && !reader.Has("camera")) reader.Fail("'camera' is missing");
  if (reader.Has("solve")) estimate.solution = ReadSolution(reader, estimate, setup);
  return estimate;
}

CaptureRole ReadRole(const JsonReader& reader) {
  const std::optional<CaptureRole> role = FindCaptureRole(reader.Text());
  if (!role) reader.Fail("the role is unknown; one of: home, translate_x, translate_y, rotate, free; or empty");
  return *role;
}

ImageResult ReadCapture(const JsonReader& reader) {
  ImageResult image;
  image.image = reader.Get("image").Text();
  image.capture = image.image;
  image.role = ReadRole(reader.Get("role"));
  image.used = reader.Get("used").Bool();
  image.reason = reader.Get("reason").Text();
  if (reader.Has("repeat_of")) image.repeat_of = reader.Get("repeat_of").Text();
  // Results of earlier versions lack this member.
  if (reader.Has("holdout_target_mm")) image.holdout_target_mm = ReadOptionalMagnitude(reader, "holdout_target_mm");
  ReadTangent(reader, "robot_correction");  // It is checked, and belongs to a pose that the file does not contain.
  image.move_without = ReadMove(reader);
  TargetInImage target;
  target.num_points = reader.Get("points").Int(0, kMostCounted);
  target.num_second_pass = reader.Get("points_second_pass").Int(0, kMostCounted);
  target.num_rejected = reader.Get("points_rejected").Int(0, kMostCounted);
  target.rms_px = ReadOptionalMagnitude(reader, "rms_px");
  target.used = image.used;
  if (target.num_points > 0) image.targets.push_back(std::move(target));
  return image;
}

ModelSummary ReadModel(const JsonReader& reader) {
  ModelSummary model;
  model.robot_noise = reader.Get("robot_noise").Text();
  for (const JsonReader& group : reader.Get("target_shape").List()) model.target_shape.push_back(group.Text());
  model.camera = reader.Get("camera").Text();
  for (const JsonReader& entry : reader.Get("alternatives").List()) {
    model.alternatives.push_back({entry.Get("name").Text(), ReadFinite(entry, "log_likelihood", -kInfinity),
                                  entry.Get("dof").Int(0, kMostCounted), ReadOptional(entry, "p"),
                                  ReadOptional(entry, "odds"),
                                  Failure(entry.Has("reason") ? entry.Get("reason").Text() : "")});
  }
  return model;
}

WorkingPoint ReadWorkingPoint(const JsonReader& reader) {
  WorkingPoint point;
  const std::vector<double> at = reader.Get("in_camera_m").Numbers(3);
  point.in_camera_m = Eigen::Vector3d(at[0], at[1], at[2]);
  point.covariance_m2 = ReadMatrix(reader, "covariance_m2", 3, "the covariance is not 3 x 3");
  if (!(point.covariance_m2.diagonal().array() >= 0).all()) reader.Fail("a variance is negative");
  return point;
}

// The kinematics of an arm, and its effects; both are empty if the file has none.
struct ArmOfResult {
  std::optional<RobotSummary> summary;
  ArmEffects effects;
};

// Reads the arm of an estimate.
ArmOfResult ReadArmOfEstimate(const JsonReader& reader, const std::optional<PairSolution>& solution) {
  ArmOfResult arm{ReadArmJson(reader), {}};
  if (!solution || !arm.summary->is_estimated) return arm;
  arm.effects = ReadArmEffects(reader, *arm.summary, solution->covariance.layout.Block(kRobotBlock).effects);
  arm.summary->errors_name = arm.effects.shared->name;
  return arm;
}

// Returns the offsets of the points of a target. Results of earlier versions lack them.
PointOffsets ReadOffsetsOf(const JsonReader& target) {
  return target.Has("point_offsets") ? ReadPointOffsetsJson(target.Get("point_offsets")) : PointOffsets();
}

// Reads the offset of a stream's clock, if there was one.
std::optional<EstimatedTimeOffset> ReadTimeOffset(const JsonReader& result) {
  if (!result.Has("time_offset")) return std::nullopt;
  const JsonReader offset = result.Get("time_offset");
  return EstimatedTimeOffset{offset.Get("value_s").Number(), ReadMagnitude(offset, "std_s")};
}

RunResult ReadShort(const JsonReader& reader) {
  const std::string name = reader.Get("name").Text();
  const std::optional<Setup> setup = FindSetup(reader.Get("setup").Text());
  if (!setup) reader.Fail("the setup is unknown");
  const JsonReader target = reader.Get("target");
  RunResult result = ShortResult(*setup, target.Get("type").Text(), target.Get("points").Int(0, kMostCounted));
  result.name = name;
  result.point_offsets = {ReadOffsetsOf(target)};
  result.time_offset = ReadTimeOffset(reader);
  for (const JsonReader& capture : reader.Get("captures").List()) result.images.push_back(ReadCapture(capture));
  for (const JsonReader& estimate : reader.Get("estimates").List()) {
    result.estimates.push_back(ReadEstimate(estimate, *setup));
    if (!estimate.Has("robot")) continue;
    std::optional<PairSolution>& solution = result.estimates.back().solution;
    ArmOfResult arm = ReadArmOfEstimate(estimate.Get("robot"), solution);
    result.arms[0] = std::move(arm.summary);
    if (arm.effects.shared == nullptr) continue;
    solution->shared_effects = std::move(arm.effects.shared);
    solution->effects = std::move(arm.effects.values);
    solution->effect_sigmas = std::move(arm.effects.sigmas);
  }
  if (reader.Has("working_point")) result.working_points[0] = ReadWorkingPoint(reader.Get("working_point"));
  if (reader.Has("model")) result.model = ReadModel(reader.Get("model"));
  result.timing = ReadTiming(reader.Get("timing_s"));
  result = WithFinalEstimate(std::move(result));
  // Results of versions before 0.2 contain no verdict.
  result.verdict = reader.Has("verdict") ? ReadVerdict(reader.Get("verdict")) : JudgeRun(result);
  return result;
}

// Parts of the result of several cameras.

std::optional<PoseError> ReadTruthOf(const JsonReader& reader) {
  if (!reader.Has("truth")) return std::nullopt;
  return PoseError{ReadMagnitude(reader.Get("truth"), "mm"), ReadMagnitude(reader.Get("truth"), "deg")};
}

RelativePose ReadRelativePose(const JsonReader& reader) {
  RelativePose pose;
  pose.parent = reader.Get("parent").Text();
  pose.child = reader.Get("child").Text();
  pose.parent_from_child = ReadPoseJson(reader, pose.parent, pose.child);
  pose.covariance = ReadMatrix(reader, "covariance", 6, "covariance: 6 rows are needed");
  return pose;
}

CameraErrors ReadErrorsOfCamera(const JsonReader& reader) {
  CameraErrors errors = ReadFigures<CameraErrors>(reader);
  if (reader.Has("truth")) {
    errors.truth_mm = ReadMagnitude(reader.Get("truth"), "mm");
    errors.truth_deg = ReadOptionalMagnitude(reader.Get("truth"), "deg");
  }
  return errors;
}

Mount ReadMount(const JsonReader& reader, const Problem& rig) {
  const std::optional<Mount> mount = FindMount(rig.robots, reader.Text());
  if (!mount) reader.Fail("the mount '" + reader.Text() + "' is not a part of an arm of this file");
  return *mount;
}

// Reads the kinematics of an arm of the rig.
ArmOfResult ReadArm(const JsonReader& robot) {
  if (!robot.Has("robot")) return {};
  const JsonReader reader = robot.Get("robot");
  ArmOfResult arm{ReadArmJson(reader), {}};
  if (!arm.summary->is_estimated) return arm;
  arm.effects = ReadArmEffects(reader, *arm.summary);
  arm.summary->errors_name = arm.effects.shared->name;
  return arm;
}

// Each of these returns the result with its next arm, camera or target.
RunResult WithRobot(RunResult result, const std::string& name, const JsonReader& reader) {
  Solution& solution = result.solution;
  solution.poses.world_from_base.push_back(ReadPoseJson(reader.Get("world_from_base"), "world", name + ".base"));
  result.truth.bases.push_back(ReadTruthOf(reader));
  ArmOfResult arm = ReadArm(reader);
  result.arms.push_back(std::move(arm.summary));
  result.rig.effects.push_back(std::move(arm.effects.shared));
  solution.effects.push_back(std::move(arm.effects.values));
  solution.effect_sigmas.push_back(std::move(arm.effects.sigmas));
  solution.smooth_noise.emplace_back();
  if (reader.Has("smooth_errors")) solution.smooth_noise.back() = ReadNoise(reader.Get("smooth_errors"), "");
  solution.robot_noise.emplace_back();
  solution.robot_noise_stddev.emplace_back();
  if (!reader.Has("noise")) return result;
  solution.robot_noise.back() = ReadNoise(reader.Get("noise"), "");
  if (solution.robot_noise.back()) {
    solution.robot_noise.back()->joint_rad =
        DegToRad(ReadOptionalMagnitude(reader.Get("noise"), "joint_deg").value_or(0));
  }
  solution.robot_noise_stddev.back() = ReadNoise(reader.Get("noise"), "std_");
  return result;
}

RunResult WithCamera(RunResult result, const std::string& name, const JsonReader& reader) {
  Solution& solution = result.solution;
  ProblemCamera camera{name, ReadMount(reader.Get("mount"), result.rig), ReadCameraJson(reader.Get("camera"))};
  camera.mount_name = reader.Get("mount").Text();
  solution.poses.mount_from_camera.push_back(ReadPoseJson(reader.Get("pose"), MountText(result.rig, camera), name));
  solution.cameras.push_back(camera.camera);
  solution.pixel_sigmas_px.push_back(ReadMagnitude(reader, "pixel_sigma"));
  solution.image_sigmas_px.push_back(ReadMagnitude(reader, "image_sigma"));
  result.working_points.emplace_back();
  if (reader.Has("working_point")) result.working_points.back() = ReadWorkingPoint(reader.Get("working_point"));
  result.rig.cameras.push_back(std::move(camera));
  return result;
}

RunResult WithTarget(RunResult result, const std::string& name, const JsonReader& reader) {
  Solution& solution = result.solution;
  ProblemTarget target{name, ReadMount(reader.Get("mount"), result.rig), TargetShape()};
  target.mount_name = reader.Get("mount").Text();
  result.target_types.push_back(reader.Get("type").Text());
  // Results of earlier versions lack this member.
  result.num_target_points.push_back(reader.Has("points") ? reader.Get("points").Int(0, kMostCounted) : 0);
  solution.poses.mount_from_target.push_back(ReadPoseJson(reader.Get("pose"), MountText(result.rig, target), name));
  solution.shapes.push_back(reader.Has("shape") ? ReadShapeJson(reader.Get("shape")) : TargetShape());
  result.point_offsets.push_back(ReadOffsetsOf(reader));
  result.truth.targets.push_back(ReadTruthOf(reader));
  result.rig.targets.push_back(std::move(target));
  return result;
}

// Returns the result with all members of a section of the file.
RunResult WithSection(RunResult result, const JsonReader& section,
                      RunResult (*with_entry)(RunResult, const std::string&, const JsonReader&)) {
  for (const auto& [name, entry] : section.Members()) {
    if (!entry) section.Fail(name + " is null");
    if (name.empty()) section.Fail("a name is empty");
    result = with_entry(std::move(result), name, *entry);
  }
  return result;
}

std::vector<ImageResult> ReadImages(const JsonReader& reader) {
  std::vector<ImageResult> images;
  for (const JsonReader& entry : reader.List()) {
    ImageResult image{entry.Get("capture").Text(), entry.Get("camera").Text(), entry.Get("image").Text(),
                      entry.Get("used").Bool(),    entry.Get("reason").Text(), {}};
    // Results of earlier versions lack this member.
    if (entry.Has("searched")) image.was_searched = entry.Get("searched").Bool();
    if (entry.Has("holdout_target_mm")) image.holdout_target_mm = ReadOptionalMagnitude(entry, "holdout_target_mm");
    if (entry.Has("move_without")) image.move_without = ReadMove(entry);
    if (entry.Has("repeat_of")) image.repeat_of = entry.Get("repeat_of").Text();
    if (entry.Has("role")) image.role = ReadRole(entry.Get("role"));
    for (const JsonReader& target : entry.Get("targets").List()) {
      image.targets.push_back({target.Get("target").Text(), target.Get("points").Int(0, kMostCounted),
                               target.Get("points_rejected").Int(0, kMostCounted),
                               ReadOptionalMagnitude(target, "rms_px"), target.Get("used").Bool()});
      if (target.Has("points_second_pass")) {
        image.targets.back().num_second_pass = target.Get("points_second_pass").Int(0, kMostCounted);
      }
    }
    images.push_back(std::move(image));
  }
  return images;
}

RunResult ReadLong(const JsonReader& reader) {
  RunResult result;
  result.name = reader.Get("name").Text();
  result.time_offset = ReadTimeOffset(reader);
  for (const auto& [name, robot] : reader.Get("robots").Members()) result.rig.robots.push_back(name);
  result = WithSection(std::move(result), reader.Get("robots"), WithRobot);
  result = WithSection(std::move(result), reader.Get("cameras"), WithCamera);
  result = WithSection(std::move(result), reader.Get("targets"), WithTarget);
  result.rig = WithFreeGroups(std::move(result.rig), reader.Get("covariance"));
  result.solution.covariance = ReadCovariance(reader.Get("covariance"), result.rig);
  if (reader.Has("covariance_repeatable")) {
    result.rig = WithFreeGroups(std::move(result.rig), reader.Get("covariance_repeatable"));
    result.solution.covariance_repeatable = ReadCovariance(reader.Get("covariance_repeatable"), result.rig);
  }
  for (const ProblemCamera& camera : result.rig.cameras) {
    result.errors.push_back(ReadErrorsOfCamera(reader.Get("errors").Get(camera.name.c_str())));
  }
  for (const JsonReader& pose : reader.Get("relative").List()) {
    result.relative_cameras.push_back(ReadRelativePose(pose));
    result.truth.relative_cameras.push_back(ReadTruthOf(pose));
  }
  for (const JsonReader& pose : reader.Get("relative_targets").List()) {
    result.relative_targets.push_back(ReadRelativePose(pose));
  }
  for (const JsonReader& pose : reader.Get("relative_bases").List()) {
    result.relative_bases.push_back(ReadRelativePose(pose));
  }
  result.images = ReadImages(reader.Get("captures"));
  result.solution.convergence = ReadConvergence(reader.Get("solve"));
  result.solution.covariance_dof = ReadCovarianceDof(reader.Get("solve"));
  result.holdout_chi2 = ReadOptionalMagnitude(reader.Get("solve"), "holdout_chi2_per_dof");
  result.verdict = ReadVerdict(reader.Get("verdict"));
  result.timing = ReadTiming(reader.Get("timing_s"));
  return result;
}

// Reads the pose of a camera or a target of `rig`, whose mount may be called by any of its names.
template <typename Mounted>
Rigid3d ReadPoseInMount(const JsonReader& pose, const Problem& rig, const Mounted& mounted) {
  std::string mount = MountText(rig, mounted);
  const std::string parent = pose.Get("parent").Text();
  if (FindMount(rig.robots, parent) == mounted.mount) mount = parent;
  return ReadPoseJson(pose, mount, mounted.name);
}

// Returns the entry of this name in a section; nothing if there is none.
std::optional<JsonReader> FindEntry(const JsonReader& reader, const char* section, const std::string& name) {
  if (!reader.Has(section) || !reader.Get(section).Has(name.c_str())) return std::nullopt;
  return reader.Get(section).Get(name.c_str());
}

// Reads the errors of all parameters of an arm.
Eigen::VectorXd ReadArmErrors(const JsonReader& reader) {
  std::vector<double> values;
  for (const auto& [name, value] : reader.Members()) {
    // Files of earlier versions have no compliances.
    const int compliance = static_cast<int>(ArmParam::kCompliance);
    if (static_cast<int>(values.size()) % kNumArmParams == compliance &&
        name != ArmParamName(static_cast<int>(values.size()))) {
      values.push_back(0);
    }
    if (name != ArmParamName(static_cast<int>(values.size())) || !value) {
      reader.Fail("the errors of all parameters of the arm are needed, in their order");
    }
    values.push_back(value->Number());
  }
  while (values.size() % kNumArmParams != 0) values.push_back(0);
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

}  // namespace

RunResult ReadRunResult(const std::filesystem::path& path) {
  const Json json = ReadJsonFile(path, kMaxBytes);
  const JsonReader reader(json, path.string());
  const std::string schema = reader.Get("schema").Text();
  if (schema == kLongSchema) return ReadLong(reader);
  if (schema != kResultSchema) {
    reader.Fail("has the schema '" + schema + "', not '" + kResultSchema + "' or '" + kLongSchema + "'");
  }
  return ReadShort(reader);
}

bool IsShortFile(const std::filesystem::path& path) {
  const Json json = ReadJsonFile(path, kMaxBytes);
  const JsonReader reader(json, path.string());
  return !reader.Has("schema") || reader.Get("schema").Text() != kLongSchema;
}

RunResult ReadWholeResult(const std::filesystem::path& path) {
  RunResult result = ReadRunResult(path);
  if (!IsShort(result)) return result;
  const Estimate* const estimate = FindFinal(result);
  if (estimate == nullptr) throw InputError(path.string() + ": contains no refined estimate");
  return WithEstimate(result, *estimate);
}

Truth ReadTruth(const std::filesystem::path& path, Setup setup) {
  const Json json = ReadJsonFile(path, kMaxTruthBytes);
  const JsonReader reader(json, path.string());
  Truth truth;
  truth.camera_mount_from_camera = ReadPoseJson(reader.Get("hand_eye"), CameraMountName(setup), "camera");
  if (reader.Has("board")) {
    truth.target_mount_from_target = ReadPoseJson(reader.Get("board"), TargetMountName(setup), "target");
  }
  if (reader.Has("camera")) truth.camera = ReadCameraJson(reader.Get("camera"));
  if (reader.Has("robot")) truth.arm_errors = ReadArmErrors(reader.Get("robot"));
  return truth;
}

CellTruth ReadCellTruth(const std::filesystem::path& path, const Problem& rig) {
  if (IsShort(rig)) {
    const Truth truth = ReadTruth(path, SetupOf(rig.cameras.front().mount));
    return {{truth.camera_mount_from_camera},
            {truth.target_mount_from_target},
            {Rigid3d()},
            {truth.camera},
            {truth.arm_errors}};
  }
  const Json json = ReadJsonFile(path, kMaxTruthBytes);
  const JsonReader reader(json, path.string());
  CellTruth truth;
  for (const ProblemCamera& camera : rig.cameras) {
    const JsonReader entry = reader.Get("cameras").Get(camera.name.c_str());
    truth.mount_from_camera.push_back(ReadPoseInMount(entry.Get("pose"), rig, camera));
    truth.cameras.emplace_back();
    if (entry.Has("camera")) truth.cameras.back() = ReadCameraJson(entry.Get("camera"));
  }
  for (const ProblemTarget& target : rig.targets) {
    const std::optional<JsonReader> entry = FindEntry(reader, "targets", target.name);
    truth.mount_from_target.emplace_back();
    if (entry) truth.mount_from_target.back() = ReadPoseInMount(entry->Get("pose"), rig, target);
  }
  for (size_t r = 0; r < rig.robots.size(); ++r) {
    const std::optional<JsonReader> entry = FindEntry(reader, "robots", rig.robots[r]);
    truth.world_from_base.emplace_back();
    if (r == 0) truth.world_from_base.back() = Rigid3d();
    if (r > 0 && entry && entry->Has("world_from_base")) {
      truth.world_from_base.back() = ReadPoseJson(entry->Get("world_from_base"), "world", rig.robots[r] + ".base");
    }
  }
  return truth;
}

}  // namespace heba
