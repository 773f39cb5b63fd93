#include "heba/io/result_file.h"

#include <cmath>
#include <map>
#include <utility>

#include <nlohmann/json.hpp>

#include "heba/base/units.h"
#include "heba/data/hand_eye.h"
#include "heba/io/arm_json.h"
#include "heba/io/result_json.h"

namespace heba {
namespace {

// Returns the figures of a solve, with those of the noise before the degrees of freedom and that of held-out captures
// after them.
Json SolveJson(const Convergence& convergence, double covariance_dof, const Json& noise, const Json& holdout) {
  Json json{{"iterations", convergence.iterations},
            {"initial_cost", Finite(convergence.initial_cost)},
            {"final_cost", Finite(convergence.final_cost)}};
  json.update(noise);
  json["covariance_dof"] = Finite(covariance_dof);
  json.update(holdout);
  json["seconds"] = convergence.seconds;
  json["message"] = convergence.message;
  return json;
}

// Returns the kinematics of an arm with the effects that are part of the solution.
Json ArmJson(const RobotSummary& robot, const ArmEffects& effects) {
  Json json = ArmJson(robot);
  json["estimated"] = ArmEffectsJson(effects);
  return json;
}

// Returns the errors of the parameters of an arm; null if they are not known.
Json ArmErrorsJson(const Eigen::VectorXd& errors) {
  Json json;
  for (Eigen::Index i = 0; i < errors.size(); ++i) json[ArmParamName(static_cast<int>(i))] = errors[i];
  return json;
}

// Returns the correction of an arm's pose, in the gripper's frame.
Json CorrectionJson(const Rigid3d& correction) { return TangentJson(LocalCoordinates(Rigid3d(), correction)); }

// Parts of the result of one camera.

Json TruthErrorsJson(const std::optional<TruthErrors>& errors) {
  if (!errors) return nullptr;
  Json json;
  json["hand_eye_mm"] = errors->hand_eye_mm;
  json["hand_eye_deg"] = errors->hand_eye_deg;
  json["board_mm"] = OrNull(errors->board_mm);
  json["board_deg"] = OrNull(errors->board_deg);
  json["focal_px"] = OrNull(errors->focal_px);
  return json;
}

Json ErrorsJson(const Errors& errors) {
  const std::optional<BoardScatter>& scatter = errors.board_scatter;
  Json json = FiguresJson(errors);
  json["holdout_chi2_per_dof"] = OrNull(errors.holdout_chi2);
  json["holdout_sigmas"] = OrNull(errors.holdout_sigmas);
  json["axxb_mean_mm"] = OrNull(errors.axxb_mean_mm);
  json["board_translation_rms_mm"] = scatter ? Json(scatter->translation_rms_mm) : Json(nullptr);
  json["board_rotation_rms_deg"] = scatter ? Json(scatter->rotation_rms_deg) : Json(nullptr);
  json["truth"] = TruthErrorsJson(errors.truth);
  return json;
}

// Returns the noise of a solution, as members of its solve.
Json NoiseJson(const PairSolution& solution) {
  const std::optional<RobotNoise>& noise = solution.robot_noise;
  const std::optional<RobotNoise>& smooth = solution.smooth_noise;
  return Json{{"pixel_sigma", solution.pixel_sigma_px},
              {"robot_sigma_deg", noise ? Json(RadToDeg(noise->rotation_rad)) : Json(nullptr)},
              {"robot_sigma_mm", noise ? Json(1000 * noise->translation_m) : Json(nullptr)},
              {"joint_sigma_deg", noise && noise->joint_rad > 0 ? Json(RadToDeg(noise->joint_rad)) : Json(nullptr)},
              {"smooth_sigma_deg", smooth ? Json(RadToDeg(smooth->rotation_rad)) : Json(nullptr)},
              {"smooth_sigma_mm", smooth ? Json(1000 * smooth->translation_m) : Json(nullptr)}};
}

Json EstimateJson(const Estimate& estimate, Setup setup) {
  Json json;
  json["method"] = estimate.method;
  json["kind"] = EstimateKindName(estimate.kind);
  json["ok"] = estimate.ok;
  json["reason"] = estimate.reason.ToString();
  const PairSolution* solution = estimate.solution ? &*estimate.solution : nullptr;
  const Covariance* const covariance = solution != nullptr ? &solution->covariance : nullptr;
  if (!estimate.ok) {
    for (const char* key : {"hand_eye", "board", "camera"}) json[key] = nullptr;
  } else {
    json["hand_eye"] = PoseJson(estimate.hand_eye.camera_mount_from_camera, CameraMountName(setup), "camera",
                                covariance, std::string(kHandEyeBlock));
    json["board"] = PoseJson(estimate.hand_eye.target_mount_from_target, TargetMountName(setup), "target");
    json["camera"] = nullptr;  // Estimates from given poses of the target have no camera.
    if (!estimate.camera.params.empty()) {
      json["camera"] = CameraJson(estimate.camera, covariance, std::string(kCameraBlock));
    }
  }
  json["target_shape"] =
      solution != nullptr ? ShapeJson(solution->shape, solution->covariance, std::string(kTargetBlock)) : Json(nullptr);
  json["errors"] = ErrorsJson(estimate.errors);
  json["covariance"] = nullptr;
  json["solve"] = nullptr;
  if (solution != nullptr) {
    // Smooth errors, whose basis is not written, are left out: what remains is the covariance of the others.
    const bool has_smooth = solution->smooth_noise.has_value();
    json["covariance"] =
        CovarianceJson(*covariance, has_smooth ? covariance->layout.Block(kRobotBlock) : UnknownBlock());
    const Covariance& repeatable = solution->covariance_repeatable;
    if (repeatable.matrix.size() > 0) {
      json["covariance_repeatable"] =
          CovarianceJson(repeatable, has_smooth ? repeatable.layout.Block(kRobotBlock) : UnknownBlock());
    }
    json["solve"] = SolveJson(solution->convergence, solution->covariance_dof, NoiseJson(*solution), Json::object());
  }
  return json;
}

Json WorkingPointJson(const std::optional<WorkingPoint>& point) {
  if (!point) return nullptr;
  Json std_m = Json::array();
  for (const double variance : point->covariance_m2.diagonal()) std_m.push_back(Finite(std::sqrt(variance)));
  const Eigen::Vector3d& at = point->in_camera_m;
  return Json{
      {"in_camera_m", {at.x(), at.y(), at.z()}}, {"std_m", std_m}, {"covariance_m2", MatrixJson(point->covariance_m2)}};
}

Json ModelJson(const ModelSummary& model) {
  Json alternatives = Json::array();
  for (const ModelEntry& entry : model.alternatives) {
    alternatives.push_back(Json{{"name", entry.name},
                                {"log_likelihood", Finite(entry.log_likelihood)},
                                {"dof", entry.dof},
                                {"p", OrNull(entry.p)}});
    if (entry.odds) alternatives.back()["odds"] = Finite(*entry.odds);
    if (!entry.reason.empty()) alternatives.back()["reason"] = entry.reason.ToString();
  }
  return Json{{"robot_noise", model.robot_noise},
              {"target_shape", model.target_shape},
              {"camera", model.camera},
              {"alternatives", alternatives}};
}

// Returns the correction of the only arm in each capture.
std::map<std::string, Rigid3d> CorrectionsOfArm(const RunResult& result) {
  std::map<std::string, Rigid3d> corrections;
  for (const CapturePoses& capture : result.captures) {
    if (!capture.corrections.empty()) corrections[capture.name] = capture.corrections[0];
  }
  return corrections;
}

Json CaptureJson(const ImageResult& image, const std::map<std::string, Rigid3d>& corrections) {
  const TargetInImage target = image.targets.empty() ? TargetInImage() : image.targets.front();
  const auto correction = corrections.find(image.capture);
  return Json{
      {"image", image.capture},
      {"role", RoleName(image.role)},
      {"points", target.num_points},
      {"points_second_pass", target.num_second_pass},
      {"points_rejected", target.num_rejected},
      {"used", image.used},
      {"reason", image.reason},
      {"repeat_of", image.repeat_of.empty() ? Json(nullptr) : Json(image.repeat_of)},
      {"rms_px", OrNull(target.rms_px)},
      {"holdout_target_mm", OrNull(image.holdout_target_mm)},
      {"robot_correction", correction == corrections.end() ? Json(nullptr) : CorrectionJson(correction->second)},
      {"move_without", MoveJson(image.move_without)}};
}

// Parts of the result of several cameras.

Json NoiseJson(const std::optional<RobotNoise>& noise, const std::optional<RobotNoise>& stddev) {
  if (!noise) return nullptr;
  Json json = NoiseJson(noise, "");
  json["joint_deg"] = noise->joint_rad > 0 ? Json(RadToDeg(noise->joint_rad)) : Json(nullptr);
  json.update(NoiseJson(stddev, "std_"));
  return json;
}

Json TruthJson(const std::vector<std::optional<PoseError>>& errors, size_t place) {
  const std::optional<PoseError> error = ErrorAt(errors, place);
  return error ? Json{{"mm", error->mm}, {"deg", error->deg}} : Json(nullptr);
}

Json RelativeJson(const std::vector<RelativePose>& poses, const std::vector<std::optional<PoseError>>& truth) {
  Json list = Json::array();
  for (size_t i = 0; i < poses.size(); ++i) {
    const RelativePose& pose = poses[i];
    Json json = PoseJson(pose.parent_from_child, pose.parent, pose.child);
    for (Eigen::Index r = 0; r < 6; ++r) {
      json[r < 3 ? "std_translation_m" : "std_rotation_rad"].push_back(Finite(std::sqrt(pose.covariance(r, r))));
    }
    json["covariance"] = MatrixJson(pose.covariance);
    json["truth"] = TruthJson(truth, i);
    list.push_back(std::move(json));
  }
  return list;
}

Json ErrorsJson(const CameraErrors& errors) {
  Json json = FiguresJson(errors);
  json["truth"] = nullptr;
  if (errors.truth_mm) json["truth"] = Json{{"mm", *errors.truth_mm}, {"deg", OrNull(errors.truth_deg)}};
  return json;
}

Json CorrectionsJson(const Problem& rig, const std::vector<Rigid3d>& corrections) {
  if (corrections.empty()) return nullptr;
  Json json = Json::object();
  for (size_t r = 0; r < rig.robots.size(); ++r) {
    json[rig.robots[r]] = CorrectionJson(corrections[r]);
  }
  return json;
}

// Returns one entry a camera and capture.
Json CapturesJson(const RunResult& result) {
  std::map<std::string, const CapturePoses*> capture_of;
  for (const CapturePoses& capture : result.captures) capture_of[capture.name] = &capture;
  Json list = Json::array();
  for (const ImageResult& image : result.images) {
    Json targets = Json::array();
    int num_points = 0;
    int num_rejected = 0;
    for (const TargetInImage& target : image.targets) {
      num_points += target.num_points;
      num_rejected += target.num_rejected;
      targets.push_back(Json{{"target", target.target},
                             {"points", target.num_points},
                             {"points_second_pass", target.num_second_pass},
                             {"points_rejected", target.num_rejected},
                             {"used", target.used},
                             {"rms_px", OrNull(target.rms_px)}});
    }
    const auto capture = capture_of.find(image.capture);
    list.push_back(Json{
        {"capture", image.capture},
        {"camera", image.camera},
        {"image", image.image},
        {"role", RoleName(image.role)},
        {"points", num_points},
        {"points_rejected", num_rejected},
        {"searched", image.was_searched},
        {"used", image.used},
        {"reason", image.reason},
        {"repeat_of", image.repeat_of.empty() ? Json(nullptr) : Json(image.repeat_of)},
        {"targets", targets},
        {"holdout_target_mm", OrNull(image.holdout_target_mm)},
        {"move_without", MoveJson(image.move_without)},
        {"robot_correction",
         capture == capture_of.end() ? Json(nullptr) : CorrectionsJson(result.rig, capture->second->corrections)}});
  }
  return list;
}

// Returns the kinematics of an arm; null if the data set did not name them.
Json KinematicsJson(const RunResult& result, size_t robot) {
  if (robot >= result.arms.size() || !result.arms[robot]) return nullptr;
  ArmEffects effects;
  if (EffectsOf(result.rig, robot) != nullptr) {
    effects = {result.rig.effects[robot], result.solution.effects[robot], result.solution.effect_sigmas[robot]};
  }
  return ArmJson(*result.arms[robot], effects);
}

Json CameraEntryJson(const RunResult& result, size_t index) {
  const ProblemCamera& camera = result.rig.cameras[index];
  const Solution& solution = result.solution;
  const std::string mount = MountText(result.rig, camera);
  return Json{{"mount", mount},
              {"pose", PoseJson(solution.poses.mount_from_camera[index], mount, camera.name, &solution.covariance,
                                CameraPoseBlock(camera))},
              {"camera", CameraJson(solution.cameras[index], &solution.covariance, CameraBlock(camera))},
              {"pixel_sigma", solution.pixel_sigmas_px[index]},
              {"image_sigma", solution.image_sigmas_px[index]},
              {"working_point",
               index < result.working_points.size() ? WorkingPointJson(result.working_points[index]) : Json(nullptr)}};
}

Json TargetEntryJson(const RunResult& result, size_t index) {
  const ProblemTarget& target = result.rig.targets[index];
  const Solution& solution = result.solution;
  const std::string mount = MountText(result.rig, target);
  return Json{{"mount", mount},
              {"type", result.target_types[index]},
              {"points", index < result.num_target_points.size() ? result.num_target_points[index] : 0},
              {"pose", PoseJson(solution.poses.mount_from_target[index], mount, target.name, &solution.covariance,
                                TargetPoseBlock(target))},
              {"shape", ShapeJson(solution.shapes[index], solution.covariance, TargetShapeBlock(target))},
              {"point_offsets", PointOffsetsJson(result.point_offsets, index)},
              {"truth", TruthJson(result.truth.targets, index)}};
}

Json RobotEntryJson(const RunResult& result, size_t index) {
  const std::string& robot = result.rig.robots[index];
  const Solution& solution = result.solution;
  const std::optional<RobotNoise> smooth = SmoothNoiseOf(solution, index);
  return Json{{"world_from_base", PoseJson(solution.poses.world_from_base[index], "world", robot + ".base",
                                           &solution.covariance, BaseBlock(robot))},
              {"truth", TruthJson(result.truth.bases, index)},
              {"noise", NoiseJson(solution.robot_noise[index], solution.robot_noise_stddev[index])},
              {"smooth_errors", smooth ? NoiseJson(smooth, "") : Json(nullptr)},
              {"robot", KinematicsJson(result, index)}};
}

// Returns what a result of either form begins with.
Json HeadJson(const RunResult& result, const char* schema) {
  Json json;
  json["schema"] = schema;
  json["heba"] = Version();
  json["name"] = result.name;
  for (const auto& [key, value] : result.about) json["about"][key] = value;
  if (result.time_offset) {
    json["time_offset"] = Json{{"value_s", result.time_offset->value_s}, {"std_s", result.time_offset->sigma_s}};
  }
  return json;
}

Json ShortJson(const RunResult& result) {
  const Setup setup = SetupOf(result.rig.cameras[0].mount);
  Json json = HeadJson(result, kResultSchema);
  json["setup"] = SetupName(setup);
  json["target"] = Json{{"type", result.target_types[0]},
                        {"points", result.num_target_points[0]},
                        {"point_offsets", PointOffsetsJson(result.point_offsets, 0)}};
  json["captures"] = Json::array();
  const std::map<std::string, Rigid3d> corrections = CorrectionsOfArm(result);
  for (const ImageResult& image : result.images) json["captures"].push_back(CaptureJson(image, corrections));
  json["verdict"] = VerdictJson(result.verdict);
  json["model"] = ModelJson(result.model);
  const Estimate* const with_arm = EstimateWithArm(result);
  json["estimates"] = Json::array();
  for (const Estimate& estimate : result.estimates) {
    json["estimates"].push_back(EstimateJson(estimate, setup));
    if (!result.arms[0] || &estimate != with_arm) continue;
    const RobotSummary& arm = *result.arms[0];
    Json& robot = json["estimates"].back()["robot"];
    if (!arm.is_estimated || !estimate.solution) {
      robot = ArmJson(arm);
    } else {
      const PairSolution& solution = *estimate.solution;
      robot = ArmJson(arm, {solution.shared_effects, solution.effects, solution.effect_sigmas});
    }
  }
  json["working_point"] = WorkingPointJson(result.working_points[0]);
  json["timing_s"] = TimingJson(result.timing);
  return json;
}

Json LongJson(const RunResult& result) {
  const Problem& rig = result.rig;
  Json json = HeadJson(result, kLongSchema);
  json["verdict"] = VerdictJson(result.verdict);
  for (const char* key : {"cameras", "errors", "targets", "robots"}) json[key] = Json::object();
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    json["cameras"][rig.cameras[c].name] = CameraEntryJson(result, c);
    json["errors"][rig.cameras[c].name] = ErrorsJson(result.errors[c]);
  }
  for (size_t t = 0; t < rig.targets.size(); ++t) json["targets"][rig.targets[t].name] = TargetEntryJson(result, t);
  for (size_t r = 0; r < rig.robots.size(); ++r) json["robots"][rig.robots[r]] = RobotEntryJson(result, r);
  json["relative"] = RelativeJson(result.relative_cameras, result.truth.relative_cameras);
  json["relative_targets"] = RelativeJson(result.relative_targets, {});
  json["relative_bases"] = RelativeJson(result.relative_bases, {});
  json["captures"] = CapturesJson(result);
  json["covariance"] = CovarianceJson(result.solution.covariance);
  if (result.solution.covariance_repeatable.matrix.size() > 0) {
    json["covariance_repeatable"] = CovarianceJson(result.solution.covariance_repeatable);
  }
  json["solve"] = SolveJson(result.solution.convergence, result.solution.covariance_dof, Json::object(),
                            Json{{"holdout_chi2_per_dof", OrNull(result.holdout_chi2)}});
  json["timing_s"] = TimingJson(result.timing);
  return json;
}

}  // namespace

std::string Version() { return HEBA_VERSION; }

std::string ResultToJson(const RunResult& result) {
  return FileText(IsShort(result) ? ShortJson(result) : LongJson(result));
}

std::string TruthToJson(const Truth& truth, Setup setup) {
  Json json;
  json["hand_eye"] = PoseJson(truth.camera_mount_from_camera, CameraMountName(setup), "camera");
  if (truth.target_mount_from_target) {
    json["board"] = PoseJson(*truth.target_mount_from_target, TargetMountName(setup), "target");
  }
  if (truth.camera) json["camera"] = CameraJson(*truth.camera);
  if (truth.arm_errors.size() > 0) json["robot"] = ArmErrorsJson(truth.arm_errors);
  return FileText(json);
}

std::string TruthToJson(const Problem& rig, const CellTruth& truth) {
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
    if (r < truth.arm_errors.size() && truth.arm_errors[r].size() > 0) {
      entry["robot"] = ArmErrorsJson(truth.arm_errors[r]);
    }
    if (!entry.is_null()) json["robots"][rig.robots[r]] = std::move(entry);
  }
  return FileText(json);
}

}  // namespace heba
