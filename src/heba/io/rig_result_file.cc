#include "heba/io/rig_result_file.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "heba/base/units.h"
#include "heba/io/arm_json.h"
#include "heba/io/result_file.h"
#include "heba/io/result_json.h"

namespace heba {
namespace {

constexpr size_t kMaxBytes = size_t{256} << 20;

Json PoseWithSigmas(const Rigid3d& pose, const std::string& parent, const std::string& child,
                    const Covariance& covariance, const std::string& block) {
  Json json = PoseJson(pose, parent, child);
  AddPoseSigmas(covariance, block, &json);
  return json;
}

Json NoiseJson(const std::optional<RobotNoise>& noise, const std::optional<RobotNoise>& stddev) {
  if (!noise) return nullptr;
  return Json{{"mm", 1000 * noise->translation_m},
              {"deg", RadToDeg(noise->rotation_rad)},
              {"std_mm", stddev ? Json(1000 * stddev->translation_m) : Json(nullptr)},
              {"std_deg", stddev ? Json(RadToDeg(stddev->rotation_rad)) : Json(nullptr)}};
}

Json SmoothJson(const std::optional<RobotNoise>& noise) {
  if (!noise) return nullptr;
  return Json{{"mm", 1000 * noise->translation_m}, {"deg", RadToDeg(noise->rotation_rad)}};
}

Json TruthJson(const std::vector<std::optional<PoseError>>& errors, size_t place) {
  const std::optional<PoseError> error = ErrorAt(errors, place);
  return error ? Json{{"mm", error->mm}, {"deg", error->deg}} : Json(nullptr);
}

std::optional<PoseError> ReadTruthOf(const JsonReader& reader) {
  if (!reader.Has("truth")) return std::nullopt;
  return PoseError{ReadMagnitude(reader.Get("truth"), "mm"), ReadMagnitude(reader.Get("truth"), "deg")};
}

Json RelativeJson(const std::vector<RelativePose>& poses, const std::vector<std::optional<PoseError>>& truth) {
  Json list = Json::array();
  for (size_t i = 0; i < poses.size(); ++i) {
    const RelativePose& pose = poses[i];
    Json json = PoseJson(pose.parent_from_child, pose.parent, pose.child);
    json["std_translation_m"] = Json::array();
    json["std_rotation_rad"] = Json::array();
    Json rows = Json::array();
    for (Eigen::Index r = 0; r < 6; ++r) {
      json[r < 3 ? "std_translation_m" : "std_rotation_rad"].push_back(Finite(std::sqrt(pose.covariance(r, r))));
      Json row = Json::array();
      for (Eigen::Index c = 0; c < 6; ++c) row.push_back(Finite(pose.covariance(r, c)));
      rows.push_back(std::move(row));
    }
    json["covariance"] = std::move(rows);
    json["truth"] = TruthJson(truth, i);
    list.push_back(std::move(json));
  }
  return list;
}

std::vector<RelativePose> ReadRelative(const JsonReader& reader, std::vector<std::optional<PoseError>>* truth) {
  std::vector<RelativePose> poses;
  for (const JsonReader& entry : reader.List()) {
    RelativePose& pose = poses.emplace_back();
    pose.parent = entry.Get("parent").Text();
    pose.child = entry.Get("child").Text();
    pose.parent_from_child = ReadPoseJson(entry, pose.parent, pose.child);
    const std::vector<JsonReader> rows = entry.Get("covariance").List();
    if (rows.size() != 6) entry.Get("covariance").Fail("6 rows are needed");
    for (Eigen::Index r = 0; r < 6; ++r) {
      const std::vector<double> row = rows[static_cast<size_t>(r)].Numbers(6);
      pose.covariance.row(r) = Eigen::Map<const Eigen::Matrix<double, 1, 6>>(row.data());
    }
    if (truth != nullptr) truth->push_back(ReadTruthOf(entry));
  }
  return poses;
}

Json ErrorsJson(const RigErrors& errors) {
  Json truth = nullptr;
  if (errors.truth_mm) truth = Json{{"mm", *errors.truth_mm}, {"deg", OrNull(errors.truth_deg)}};
  return Json{{"reprojection_rms_px", OrNull(errors.reprojection_rms_px)},
              {"holdout_rms_px", OrNull(errors.holdout_rms_px)},
              {"holdout_target_mm", OrNull(errors.holdout_target_mm)},
              {"holdout_target_deg", OrNull(errors.holdout_target_deg)},
              {"truth", truth}};
}

RigErrors ReadErrors(const JsonReader& reader) {
  RigErrors errors{ReadOptionalMagnitude(reader, "reprojection_rms_px"),
                   ReadOptionalMagnitude(reader, "holdout_rms_px"), ReadOptionalMagnitude(reader, "holdout_target_mm"),
                   ReadOptionalMagnitude(reader, "holdout_target_deg")};
  if (reader.Has("truth")) {
    errors.truth_mm = ReadMagnitude(reader.Get("truth"), "mm");
    errors.truth_deg = ReadOptionalMagnitude(reader.Get("truth"), "deg");
  }
  return errors;
}

Json CorrectionsJson(const RigProblem& rig, const std::vector<Rigid3d>& corrections) {
  if (corrections.empty()) return nullptr;
  Json json = Json::object();
  for (size_t r = 0; r < rig.robots.size(); ++r) {
    json[rig.robots[r]] = TangentJson(LocalCoordinates(Rigid3d(), corrections[r]));
  }
  return json;
}

// Returns one entry a camera and capture.
Json CapturesJson(const RigResult& result) {
  std::map<std::string, const RigCaptureResult*> capture_of;
  for (const RigCaptureResult& capture : result.captures) capture_of[capture.name] = &capture;
  Json list = Json::array();
  for (const RigImageResult& image : result.images) {
    Json targets = Json::array();
    int num_points = 0;
    int num_rejected = 0;
    for (const RigTargetInImage& target : image.targets) {
      num_points += target.num_points;
      num_rejected += target.num_rejected;
      targets.push_back(Json{{"target", target.target},
                             {"points", target.num_points},
                             {"points_rejected", target.num_rejected},
                             {"used", target.used},
                             {"rms_px", OrNull(target.rms_px)}});
    }
    const auto capture = capture_of.find(image.capture);
    list.push_back(Json{
        {"capture", image.capture},
        {"camera", image.camera},
        {"image", image.image},
        {"points", num_points},
        {"points_rejected", num_rejected},
        {"searched", image.was_searched},
        {"used", image.used},
        {"reason", image.reason},
        {"targets", targets},
        {"move_without", MoveJson(image.move_without)},
        {"robot_correction",
         capture == capture_of.end() ? Json(nullptr) : CorrectionsJson(result.rig, capture->second->corrections)}});
  }
  return list;
}

Mount ReadMount(const JsonReader& reader, const RigProblem& rig) {
  const std::optional<Mount> mount = FindMount(rig.robots, reader.Text());
  if (!mount) reader.Fail("the mount '" + reader.Text() + "' is not a part of an arm of this file");
  return *mount;
}

const JsonReader& Present(const std::pair<std::string, std::optional<JsonReader>>& member, const JsonReader& owner) {
  if (!member.second) owner.Fail(member.first + " is null");
  return *member.second;
}

RobotNoise ReadNoise(const JsonReader& reader) {
  return {ReadMagnitude(reader, "mm") / 1000, DegToRad(ReadMagnitude(reader, "deg")), 0};
}

// Returns the kinematics of an arm; null if the data set did not name them.
Json KinematicsJson(const RigResult& result, size_t robot) {
  if (robot >= result.arms.size() || !result.arms[robot]) return nullptr;
  Json json = ArmJson(*result.arms[robot]);
  const bool is_estimated = EffectsOf(result.rig, robot) != nullptr;
  json["estimated"] = is_estimated ? ArmEffectsJson({result.rig.effects[robot], result.solution.effects[robot],
                                                     result.solution.effect_sigmas[robot]})
                                   : Json(nullptr);
  return json;
}

// Reads the kinematics of an arm, the next one of the result.
void ReadKinematics(const JsonReader& robot, RigResult* result) {
  RigSolution& solution = result->solution;
  result->arms.emplace_back();
  result->rig.effects.emplace_back();
  solution.effects.emplace_back();
  solution.effect_sigmas.emplace_back();
  if (!robot.Has("robot")) return;
  const JsonReader reader = robot.Get("robot");
  result->arms.back() = ReadArmJson(reader);
  if (!result->arms.back()->is_estimated) return;
  ArmEffects effects = ReadArmEffects(reader, *result->arms.back());
  result->arms.back()->errors_name = effects.shared->name;
  result->rig.effects.back() = std::move(effects.shared);
  solution.effects.back() = std::move(effects.values);
  solution.effect_sigmas.back() = std::move(effects.sigmas);
}

// Reads the names, mounts, cameras, shapes and poses.
void ReadRig(const JsonReader& reader, RigResult* result) {
  RigProblem& rig = result->rig;
  RigSolution& solution = result->solution;
  const JsonReader robots = reader.Get("robots");
  for (const auto& member : robots.Members()) rig.robots.push_back(member.first);
  for (const auto& member : robots.Members()) {
    const JsonReader& robot = Present(member, robots);
    solution.poses.world_from_base.push_back(
        ReadPoseJson(robot.Get("world_from_base"), "world", member.first + ".base"));
    result->truth.bases.push_back(ReadTruthOf(robot));
    ReadKinematics(robot, result);
    solution.robot_noise.emplace_back();
    solution.robot_noise_stddev.emplace_back();
    solution.smooth_noise.emplace_back();
    if (robot.Has("smooth_errors")) solution.smooth_noise.back() = ReadNoise(robot.Get("smooth_errors"));
    if (!robot.Has("noise")) continue;
    const JsonReader noise = robot.Get("noise");
    solution.robot_noise.back() = ReadNoise(noise);
    if (!noise.Has("std_mm")) continue;
    solution.robot_noise_stddev.back() =
        RobotNoise{ReadMagnitude(noise, "std_mm") / 1000, DegToRad(ReadMagnitude(noise, "std_deg")), 0};
  }
  const JsonReader cameras = reader.Get("cameras");
  for (const auto& member : cameras.Members()) {
    const JsonReader& entry = Present(member, cameras);
    RigCamera camera{member.first, ReadMount(entry.Get("mount"), rig), ReadCameraJson(entry.Get("camera"))};
    camera.mount_name = entry.Get("mount").Text();
    solution.poses.mount_from_camera.push_back(ReadPoseJson(entry.Get("pose"), MountText(rig, camera), member.first));
    solution.cameras.push_back(camera.camera);
    solution.pixel_sigmas_px.push_back(ReadMagnitude(entry, "pixel_sigma"));
    solution.image_sigmas_px.push_back(ReadMagnitude(entry, "image_sigma"));
    rig.cameras.push_back(std::move(camera));
  }
  const JsonReader targets = reader.Get("targets");
  for (const auto& member : targets.Members()) {
    const JsonReader& entry = Present(member, targets);
    RigTarget target{member.first, ReadMount(entry.Get("mount"), rig), TargetShape()};
    target.mount_name = entry.Get("mount").Text();
    result->target_types.push_back(entry.Get("type").Text());
    solution.poses.mount_from_target.push_back(ReadPoseJson(entry.Get("pose"), MountText(rig, target), member.first));
    solution.shapes.push_back(entry.Has("shape") ? ReadShapeJson(entry.Get("shape")) : TargetShape());
    result->truth.targets.push_back(ReadTruthOf(entry));
    rig.targets.push_back(std::move(target));
  }
}

// Reads the pose of a camera or a target of `rig`, whose mount may be called by any of its names.
template <typename Mounted>
Rigid3d ReadPoseInMount(const JsonReader& pose, const RigProblem& rig, const Mounted& mounted) {
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

// Frees the groups of parameters of which a name is in the covariance, and reads it.
void ReadRigCovariance(const JsonReader& reader, RigResult* result) {
  const std::vector<std::string> names = ReadOrder(reader);
  const auto has = [&](const std::string& name) { return std::find(names.begin(), names.end(), name) != names.end(); };
  const auto add = [](auto group, auto* groups) {
    if (std::find(groups->begin(), groups->end(), group) == groups->end()) groups->push_back(group);
  };
  for (RigCamera& camera : result->rig.cameras) {
    const std::vector<std::string>& params = camera.camera.Model().param_names();
    for (size_t i = 0; i < params.size(); ++i) {
      if (has(CameraBlock(camera) + "." + params[i])) add(GroupOf(static_cast<int>(i)), &camera.free_intrinsics);
    }
  }
  for (RigTarget& target : result->rig.targets) {
    for (int i = 0; i < TargetShape::kNumParams; ++i) {
      const std::string name =
          TargetShapeBlock(target) + "." + std::string(kTargetShapeParamNames[static_cast<size_t>(i)]);
      if (has(name)) add(ShapeGroupOf(i), &target.free_shape);
    }
  }
  const UnknownLayout layout = RigUnknowns(result->rig);
  CheckOrder(reader.Get("order"), names, layout);
  result->solution.covariance = ReadCovarianceMatrix(reader, layout);
}

void ReadCaptures(const JsonReader& reader, RigResult* result) {
  for (const JsonReader& entry : reader.List()) {
    RigImageResult image{entry.Get("capture").Text(), entry.Get("camera").Text(), entry.Get("image").Text(),
                         entry.Get("used").Bool(),    entry.Get("reason").Text(), {}};
    // Results of earlier versions lack this member.
    if (entry.Has("searched")) image.was_searched = entry.Get("searched").Bool();
    if (entry.Has("move_without")) image.move_without = ReadMove(entry);
    for (const JsonReader& target : entry.Get("targets").List()) {
      image.targets.push_back({target.Get("target").Text(), target.Get("points").Int(0, kMostCounted),
                               target.Get("points_rejected").Int(0, kMostCounted),
                               ReadOptionalMagnitude(target, "rms_px"), target.Get("used").Bool()});
    }
    result->images.push_back(std::move(image));
  }
}

}  // namespace

bool IsRigResult(const std::filesystem::path& path) {
  const Json json = ReadJsonFile(path, kMaxBytes);
  const JsonReader reader(json, path.string());
  return reader.Has("schema") && reader.Get("schema").Text() == kRigSchema;
}

std::string RigResultToJson(const RigResult& result) {
  const RigProblem& rig = result.rig;
  const RigSolution& solution = result.solution;
  const Covariance& covariance = solution.covariance;
  Json json;
  json["schema"] = kRigSchema;
  json["heba"] = Version();
  json["name"] = result.name;
  if (!result.about.empty()) {
    json["about"] = Json::object();
    for (const auto& [key, value] : result.about) json["about"][key] = value;
  }
  json["verdict"] = VerdictJson(result.verdict);
  json["cameras"] = Json::object();
  json["errors"] = Json::object();
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const RigCamera& camera = rig.cameras[c];
    const std::string mount = MountText(rig, camera);
    Json of_camera = CameraJson(solution.cameras[c]);
    of_camera["std"] = CameraSigmaJson(solution.cameras[c], covariance, CameraBlock(camera));
    json["cameras"][camera.name] = Json{{"mount", mount},
                                        {"pose", PoseWithSigmas(solution.poses.mount_from_camera[c], mount, camera.name,
                                                                covariance, CameraPoseBlock(camera))},
                                        {"camera", of_camera},
                                        {"pixel_sigma", solution.pixel_sigmas_px[c]},
                                        {"image_sigma", solution.image_sigmas_px[c]}};
    json["errors"][camera.name] = ErrorsJson(result.errors[c]);
  }
  json["targets"] = Json::object();
  for (size_t t = 0; t < rig.targets.size(); ++t) {
    const RigTarget& target = rig.targets[t];
    const std::string mount = MountText(rig, target);
    json["targets"][target.name] = Json{{"mount", mount},
                                        {"type", result.target_types[t]},
                                        {"pose", PoseWithSigmas(solution.poses.mount_from_target[t], mount, target.name,
                                                                covariance, TargetPoseBlock(target))},
                                        {"shape", ShapeJson(solution.shapes[t], covariance, TargetShapeBlock(target))},
                                        {"truth", TruthJson(result.truth.targets, t)}};
  }
  json["robots"] = Json::object();
  for (size_t r = 0; r < rig.robots.size(); ++r) {
    json["robots"][rig.robots[r]] =
        Json{{"world_from_base", PoseWithSigmas(solution.poses.world_from_base[r], "world", rig.robots[r] + ".base",
                                                covariance, BaseBlock(rig.robots[r]))},
             {"truth", TruthJson(result.truth.bases, r)},
             {"noise", NoiseJson(solution.robot_noise[r], solution.robot_noise_stddev[r])},
             {"smooth_errors", SmoothJson(SmoothNoiseOf(solution, r))},
             {"robot", KinematicsJson(result, r)}};
  }
  json["relative"] = RelativeJson(result.relative_cameras, result.truth.relative_cameras);
  json["relative_targets"] = RelativeJson(result.relative_targets, {});
  json["relative_bases"] = RelativeJson(result.relative_bases, {});
  json["captures"] = CapturesJson(result);
  std::vector<Eigen::Index> all(static_cast<size_t>(covariance.layout.size()));
  std::iota(all.begin(), all.end(), 0);
  json["covariance"] = CovarianceJson(covariance, all);
  const Convergence& convergence = solution.convergence;
  json["solve"] = Json{{"iterations", convergence.iterations},
                       {"initial_cost", Finite(convergence.initial_cost)},
                       {"final_cost", Finite(convergence.final_cost)},
                       {"covariance_dof", Finite(solution.covariance_dof)},
                       {"holdout_chi2_per_dof", OrNull(result.holdout_chi2)},
                       {"seconds", convergence.seconds},
                       {"message", convergence.message}};
  json["timing_s"] = TimingJson(result.timing);
  return FileText(json);
}

RigResult ReadRigResult(const std::filesystem::path& path) {
  const Json json = ReadJsonFile(path, kMaxBytes);
  const JsonReader reader(json, path.string());
  const std::string schema = reader.Get("schema").Text();
  if (schema != kRigSchema) reader.Fail("has the schema '" + schema + "', not '" + kRigSchema + "'");
  RigResult result;
  result.name = reader.Get("name").Text();
  ReadRig(reader, &result);
  ReadRigCovariance(reader.Get("covariance"), &result);
  for (const RigCamera& camera : result.rig.cameras) {
    result.errors.push_back(ReadErrors(reader.Get("errors").Get(camera.name.c_str())));
  }
  result.relative_cameras = ReadRelative(reader.Get("relative"), &result.truth.relative_cameras);
  result.relative_targets = ReadRelative(reader.Get("relative_targets"), nullptr);
  result.relative_bases = ReadRelative(reader.Get("relative_bases"), nullptr);
  ReadCaptures(reader.Get("captures"), &result);
  const JsonReader solve = reader.Get("solve");
  result.solution.convergence.converged = true;
  result.solution.convergence.iterations = solve.Get("iterations").Int(0, kMostCounted);
  result.solution.convergence.initial_cost = ReadFinite(solve, "initial_cost", std::numeric_limits<double>::infinity());
  result.solution.convergence.final_cost = ReadFinite(solve, "final_cost", std::numeric_limits<double>::infinity());
  result.solution.convergence.seconds = ReadMagnitude(solve, "seconds");
  result.solution.convergence.message = solve.Get("message").Text();
  result.solution.covariance_dof =
      ReadOptionalMagnitude(solve, "covariance_dof").value_or(std::numeric_limits<double>::infinity());
  result.holdout_chi2 = ReadOptionalMagnitude(solve, "holdout_chi2_per_dof");
  result.verdict = ReadVerdict(reader.Get("verdict"));
  result.timing = ReadTiming(reader.Get("timing_s"));
  return result;
}

std::string RigTruthToJson(const RigProblem& rig, const RigTruth& truth) {
  Json json;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const std::string mount = MountText(rig, rig.cameras[c]);
    Json& entry = json["cameras"][rig.cameras[c].name];
    entry = Json{{"mount", mount}, {"pose", PoseJson(truth.mount_from_camera[c], mount, rig.cameras[c].name)}};
    if (truth.cameras[c]) entry["camera"] = CameraJson(*truth.cameras[c]);
  }
  for (size_t t = 0; t < rig.targets.size(); ++t) {
    if (!truth.mount_from_target[t]) continue;
    const std::string mount = MountText(rig, rig.targets[t]);
    json["targets"][rig.targets[t].name] =
        Json{{"mount", mount}, {"pose", PoseJson(*truth.mount_from_target[t], mount, rig.targets[t].name)}};
  }
  for (size_t r = 0; r < rig.robots.size(); ++r) {
    Json entry;
    if (truth.world_from_base[r]) {
      entry["world_from_base"] = PoseJson(*truth.world_from_base[r], "world", rig.robots[r] + ".base");
    }
    for (Eigen::Index place = 0; r < truth.arm_errors.size() && place < truth.arm_errors[r].size(); ++place) {
      entry["robot"][ArmParamName(static_cast<int>(place))] = truth.arm_errors[r][place];
    }
    if (!entry.is_null()) json["robots"][rig.robots[r]] = std::move(entry);
  }
  return FileText(json);
}

RigTruth ReadRigTruth(const std::filesystem::path& path, const RigProblem& rig) {
  const Json json = ReadJsonFile(path, 1 << 20);
  const JsonReader reader(json, path.string());
  RigTruth truth;
  for (const RigCamera& camera : rig.cameras) {
    const JsonReader entry = reader.Get("cameras").Get(camera.name.c_str());
    truth.mount_from_camera.push_back(ReadPoseInMount(entry.Get("pose"), rig, camera));
    truth.cameras.emplace_back();
    if (entry.Has("camera")) truth.cameras.back() = ReadCameraJson(entry.Get("camera"));
  }
  for (const RigTarget& target : rig.targets) {
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
