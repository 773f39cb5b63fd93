#include "heba/io/result_file.h"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "heba/base/units.h"
#include "heba/io/arm_json.h"
#include "heba/io/result_json.h"

namespace heba {
namespace {

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
  Json json;
  json["reprojection_rms_px"] = OrNull(errors.reprojection_rms_px);
  json["holdout_rms_px"] = OrNull(errors.holdout_rms_px);
  json["holdout_target_mm"] = OrNull(errors.holdout_target_mm);
  json["holdout_target_deg"] = OrNull(errors.holdout_target_deg);
  json["holdout_chi2_per_dof"] = OrNull(errors.holdout_chi2);
  json["holdout_sigmas"] = OrNull(errors.holdout_sigmas);
  json["axxb_mean_mm"] = OrNull(errors.axxb_mean_mm);
  json["board_translation_rms_mm"] =
      errors.board_scatter ? Json(errors.board_scatter->translation_rms_mm) : Json(nullptr);
  json["board_rotation_rms_deg"] = errors.board_scatter ? Json(errors.board_scatter->rotation_rms_deg) : Json(nullptr);
  json["truth"] = TruthErrorsJson(errors.truth);
  return json;
}

// Returns the correction of the robot's pose by the refinement, in the gripper's frame (m, rad).
std::optional<Tangent6> CorrectionOf(const CaptureResult& capture) {
  if (!capture.correction) return std::nullopt;
  Tangent6 tangent;
  tangent << capture.correction->translation, LogRotation(capture.correction->rotation);
  return tangent;
}

// Returns the covariance of the unknowns. Smooth errors, whose basis is not written, are left out: what remains is the
// covariance of the others.
Json CovarianceJson(const Solution& solution) {
  const Covariance& covariance = solution.covariance;
  const UnknownBlock robot = covariance.layout.Block(kRobotBlock);
  std::vector<Eigen::Index> written;
  for (Eigen::Index i = 0; i < covariance.matrix.rows(); ++i) {
    const bool is_smooth = solution.smooth_noise && i >= robot.first && i < robot.end();
    if (!is_smooth) written.push_back(i);
  }
  return CovarianceJson(covariance, written);
}

Json EstimateJson(const Estimate& estimate, Setup setup) {
  Json json;
  json["method"] = estimate.method;
  json["kind"] = EstimateKindName(estimate.kind);
  json["ok"] = estimate.ok;
  json["reason"] = estimate.reason;
  const Solution* solution = estimate.solution ? &*estimate.solution : nullptr;
  if (!estimate.ok) {
    for (const char* key : {"hand_eye", "board", "camera"}) json[key] = nullptr;
  } else {
    Json hand_eye = PoseJson(estimate.hand_eye.camera_mount_from_camera, CameraMountName(setup), "camera");
    hand_eye["std_translation_m"] = nullptr;
    hand_eye["std_rotation_rad"] = nullptr;
    if (solution != nullptr) {
      AddPoseSigmas(solution->covariance, std::string(kHandEyeBlock), &hand_eye);
    }
    json["hand_eye"] = hand_eye;
    json["board"] = PoseJson(estimate.hand_eye.target_mount_from_target, TargetMountName(setup), "target");
    json["camera"] = nullptr;  // Estimates from given poses of the target have no camera.
    if (!estimate.camera.params.empty()) {
      json["camera"] = CameraJson(estimate.camera);
      json["camera"]["std"] = solution != nullptr
                                  ? CameraSigmaJson(estimate.camera, solution->covariance, std::string(kCameraBlock))
                                  : Json(nullptr);
    }
  }
  json["target_shape"] =
      solution != nullptr ? ShapeJson(solution->shape, solution->covariance, std::string(kTargetBlock)) : Json(nullptr);
  json["errors"] = ErrorsJson(estimate.errors);
  json["covariance"] = nullptr;
  json["solve"] = nullptr;
  if (solution != nullptr) {
    json["covariance"] = CovarianceJson(*solution);
    const Convergence& convergence = solution->convergence;
    const std::optional<RobotNoise>& noise = solution->robot_noise;
    const std::optional<RobotNoise>& smooth = solution->smooth_noise;
    json["solve"] =
        Json{{"iterations", convergence.iterations},
             {"initial_cost", Finite(convergence.initial_cost)},
             {"final_cost", Finite(convergence.final_cost)},
             {"pixel_sigma", solution->pixel_sigma_px},
             {"robot_sigma_deg", noise ? Json(RadToDeg(noise->rotation_rad)) : Json(nullptr)},
             {"robot_sigma_mm", noise ? Json(1000 * noise->translation_m) : Json(nullptr)},
             {"joint_sigma_deg", noise && noise->joint_rad > 0 ? Json(RadToDeg(noise->joint_rad)) : Json(nullptr)},
             {"smooth_sigma_deg", smooth ? Json(RadToDeg(smooth->rotation_rad)) : Json(nullptr)},
             {"smooth_sigma_mm", smooth ? Json(1000 * smooth->translation_m) : Json(nullptr)},
             {"covariance_dof", Finite(solution->covariance_dof)},
             {"seconds", convergence.seconds},
             {"message", convergence.message}};
  }
  return json;
}

Json WorkingPointJson(const std::optional<WorkingPoint>& point) {
  if (!point) return nullptr;
  Json std_m = Json::array();
  Json rows = Json::array();
  for (int i = 0; i < 3; ++i) {
    const auto row = point->covariance_m2.row(i);
    std_m.push_back(Finite(std::sqrt(row[i])));
    rows.push_back({Finite(row[0]), Finite(row[1]), Finite(row[2])});
  }
  const Eigen::Vector3d& at = point->in_camera_m;
  return Json{{"in_camera_m", {at.x(), at.y(), at.z()}}, {"std_m", std_m}, {"covariance_m2", rows}};
}

Json ModelJson(const ModelSummary& model) {
  Json alternatives = Json::array();
  for (const ModelEntry& entry : model.alternatives) {
    alternatives.push_back(Json{{"name", entry.name},
                                {"log_likelihood", Finite(entry.log_likelihood)},
                                {"dof", entry.dof},
                                {"p", OrNull(entry.p)}});
    if (entry.odds) alternatives.back()["odds"] = Finite(*entry.odds);
    if (!entry.reason.empty()) alternatives.back()["reason"] = entry.reason;
  }
  return Json{{"robot_noise", model.robot_noise},
              {"target_shape", model.target_shape},
              {"camera", model.camera},
              {"alternatives", alternatives}};
}

// Returns the estimate that the arm is part of: that of the refinement of reprojection errors, unless only that of the
// poses has a result. Null if there is neither.
const Estimate* EstimateWithRobot(const RunResult& result) {
  const Estimate* found = nullptr;
  for (const Estimate& estimate : result.estimates) {
    if (estimate.method == kBundleMethod && (estimate.ok || found == nullptr)) found = &estimate;
    if (estimate.method == kChainMethod && estimate.ok) found = &estimate;
  }
  return found;
}

}  // namespace

std::string Version() { return HEBA_VERSION; }

std::string ResultToJson(const RunResult& result) {
  Json json;
  json["schema"] = kResultSchema;
  json["heba"] = Version();
  json["name"] = result.name;
  json["setup"] = SetupName(result.setup);
  json["target"] = Json{{"type", result.target_type}, {"points", result.num_target_points}};
  if (!result.about.empty()) {
    json["about"] = Json::object();
    for (const auto& [key, value] : result.about) json["about"][key] = value;
  }
  json["captures"] = Json::array();
  for (const CaptureResult& capture : result.captures) {
    json["captures"].push_back(Json{{"image", capture.image},
                                    {"role", RoleName(capture.role)},
                                    {"points", capture.num_points},
                                    {"points_second_pass", capture.num_second_pass},
                                    {"points_rejected", capture.num_rejected},
                                    {"used", capture.used},
                                    {"reason", capture.reason},
                                    {"repeat_of", capture.repeat_of.empty() ? Json(nullptr) : Json(capture.repeat_of)},
                                    {"rms_px", OrNull(capture.rms_px)},
                                    {"holdout_target_mm", OrNull(capture.holdout_target_mm)},
                                    {"robot_correction", TangentJson(CorrectionOf(capture))},
                                    {"move_without", MoveJson(capture.move_without)}});
  }
  json["verdict"] = VerdictJson(result.verdict);
  json["model"] = ModelJson(result.model);
  const Estimate* const with_robot = EstimateWithRobot(result);
  json["estimates"] = Json::array();
  for (const Estimate& estimate : result.estimates) {
    json["estimates"].push_back(EstimateJson(estimate, result.setup));
    if (!result.robot || &estimate != with_robot) continue;
    json["estimates"].back()["robot"] = ArmJson(*result.robot);
    if (!result.robot->is_estimated || !estimate.solution) continue;
    const Solution& solution = *estimate.solution;
    json["estimates"].back()["robot"]["estimated"] =
        ArmEffectsJson({solution.shared_effects, solution.effects, solution.effect_sigmas});
  }
  json["working_point"] = WorkingPointJson(result.working_point);
  json["timing_s"] = TimingJson(result.timing);
  return FileText(json);
}

std::string TruthToJson(const Truth& truth, Setup setup) {
  Json json;
  json["hand_eye"] = PoseJson(truth.camera_mount_from_camera, CameraMountName(setup), "camera");
  if (truth.target_mount_from_target) {
    json["board"] = PoseJson(*truth.target_mount_from_target, TargetMountName(setup), "target");
  }
  if (truth.camera) json["camera"] = CameraJson(*truth.camera);
  for (Eigen::Index place = 0; place < truth.arm_errors.size(); ++place) {
    json["robot"][ArmParamName(static_cast<int>(place))] = truth.arm_errors[place];
  }
  return json.dump(1) + "\n";
}

}  // namespace heba
