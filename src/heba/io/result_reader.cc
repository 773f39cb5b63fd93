// The reading functions of result_file.h.
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/evaluation/verdict.h"
#include "heba/io/arm_json.h"
#include "heba/io/json_reader.h"
#include "heba/io/result_file.h"
#include "heba/io/result_json.h"

namespace heba {
namespace {

Errors ReadErrors(const JsonReader& reader) {
  Errors errors;
  errors.reprojection_rms_px = ReadOptionalMagnitude(reader, "reprojection_rms_px");
  errors.holdout_rms_px = ReadOptionalMagnitude(reader, "holdout_rms_px");
  errors.holdout_target_mm = ReadOptionalMagnitude(reader, "holdout_target_mm");
  errors.holdout_target_deg = ReadOptionalMagnitude(reader, "holdout_target_deg");
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

// Returns the layout of a calibration with the free parameters that are among `names`. Throws InputError if it has
// other names than these, or has them in another order.
UnknownLayout LayoutOf(const JsonReader& reader, const CameraModel* model, const std::vector<std::string>& names) {
  const auto has = [&](const std::string& name) { return std::find(names.begin(), names.end(), name) != names.end(); };
  SharedEffects effects;
  const std::string of_robot = std::string(kRobotBlock) + ".";
  for (const std::string& name : names) {
    if (name.starts_with(of_robot)) effects.effects.push_back({name.substr(of_robot.size())});
  }
  std::vector<bool> free;
  for (size_t i = 0; model != nullptr && i < model->param_names().size(); ++i) {
    free.push_back(has(std::string(kCameraBlock) + "." + model->param_names()[i]));
  }
  for (const std::string_view param : kTargetShapeParamNames) {
    free.push_back(has(std::string(kTargetBlock) + "." + std::string(param)));
  }
  const auto shared = effects.effects.empty() ? nullptr : std::make_shared<const SharedEffects>(std::move(effects));
  UnknownLayout layout = model == nullptr ? HandEyePoses() : HandEyeUnknowns(*model, {free, shared});
  CheckOrder(reader, names, layout);
  return layout;
}

// `model` is null if the estimate has no camera.
Covariance ReadCovariance(const JsonReader& reader, const CameraModel* model) {
  return ReadCovarianceMatrix(reader, LayoutOf(reader.Get("order"), model, ReadOrder(reader)));
}

Solution ReadSolution(const JsonReader& reader, const Estimate& estimate) {
  Solution solution;
  solution.hand_eye = estimate.hand_eye;
  solution.camera = estimate.camera;
  const CameraModel* const model = estimate.camera.params.empty() ? nullptr : &estimate.camera.Model();
  if (reader.Has("covariance")) solution.covariance = ReadCovariance(reader.Get("covariance"), model);
  if (reader.Has("target_shape")) {
    solution.shape = ReadShapeJson(reader.Get("target_shape"));
  }
  const JsonReader solve = reader.Get("solve");
  solution.convergence.converged = true;
  solution.convergence.iterations = solve.Get("iterations").Int(0, kMostCounted);
  solution.convergence.initial_cost = ReadFinite(solve, "initial_cost", std::numeric_limits<double>::infinity());
  solution.convergence.final_cost = ReadFinite(solve, "final_cost", std::numeric_limits<double>::infinity());
  solution.convergence.seconds = ReadMagnitude(solve, "seconds");
  solution.convergence.message = solve.Get("message").Text();
  solution.pixel_sigma_px = ReadMagnitude(solve, "pixel_sigma");
  if (solve.Has("robot_sigma_mm")) {
    solution.robot_noise =
        RobotNoise{ReadMagnitude(solve, "robot_sigma_mm") / 1000, DegToRad(ReadMagnitude(solve, "robot_sigma_deg"))};
    solution.robot_noise->joint_rad = DegToRad(ReadOptionalMagnitude(solve, "joint_sigma_deg").value_or(0));
  }
  if (solve.Has("smooth_sigma_mm")) {
    solution.smooth_noise =
        RobotNoise{ReadMagnitude(solve, "smooth_sigma_mm") / 1000, DegToRad(ReadMagnitude(solve, "smooth_sigma_deg"))};
  }
  solution.covariance_dof =
      ReadOptionalMagnitude(solve, "covariance_dof").value_or(std::numeric_limits<double>::infinity());
  if (solution.covariance_dof == 0) solve.Get("covariance_dof").Fail("must be greater than 0");
  return solution;
}

Estimate ReadEstimate(const JsonReader& reader, Setup setup) {
  Estimate estimate;
  estimate.method = reader.Get("method").Text();
  estimate.kind = ReadEnum<EstimateKind>(reader.Get("kind"), "kind", kEstimateKindNames);
  estimate.ok = reader.Get("ok").Bool();
  estimate.reason = reader.Get("reason").Text();
  estimate.errors = ReadErrors(reader.Get("errors"));
  if (!estimate.ok) return estimate;
  estimate.hand_eye = {ReadPoseJson(reader.Get("hand_eye"), CameraMountName(setup), "camera"),
                       ReadPoseJson(reader.Get("board"), TargetMountName(setup), "target")};
  if (reader.Has("camera")) estimate.camera = ReadCameraJson(reader.Get("camera"));
  if (estimate.method == "bundle" && !reader.Has("camera")) reader.Fail("'camera' is missing");
  if (reader.Has("solve")) estimate.solution = ReadSolution(reader, estimate);
  return estimate;
}

CaptureResult ReadCapture(const JsonReader& reader) {
  CaptureResult capture;
  capture.image = reader.Get("image").Text();
  const std::optional<CaptureRole> role = FindCaptureRole(reader.Get("role").Text());
  if (!role)
    reader.Get("role").Fail("the role is unknown; one of: home, translate_x, translate_y, rotate, free; or empty");
  capture.role = *role;
  capture.num_points = reader.Get("points").Int(0, kMostCounted);
  capture.num_second_pass = reader.Get("points_second_pass").Int(0, kMostCounted);
  capture.num_rejected = reader.Get("points_rejected").Int(0, kMostCounted);
  capture.used = reader.Get("used").Bool();
  capture.reason = reader.Get("reason").Text();
  if (reader.Has("repeat_of")) capture.repeat_of = reader.Get("repeat_of").Text();
  capture.rms_px = ReadOptionalMagnitude(reader, "rms_px");
  // Results of earlier versions lack this member.
  if (reader.Has("holdout_target_mm")) capture.holdout_target_mm = ReadOptionalMagnitude(reader, "holdout_target_mm");
  const std::optional<Tangent6> correction = ReadTangent(reader, "robot_correction");
  if (correction) capture.correction = Rigid3d(ExpRotation(correction->tail<3>()), correction->head<3>());
  capture.move_without = ReadMove(reader);
  return capture;
}

ModelSummary ReadModel(const JsonReader& reader) {
  ModelSummary model;
  model.robot_noise = reader.Get("robot_noise").Text();
  for (const JsonReader& group : reader.Get("target_shape").List()) model.target_shape.push_back(group.Text());
  model.camera = reader.Get("camera").Text();
  for (const JsonReader& entry : reader.Get("alternatives").List()) {
    model.alternatives.push_back(
        {entry.Get("name").Text(), ReadFinite(entry, "log_likelihood", -std::numeric_limits<double>::infinity()),
         entry.Get("dof").Int(0, kMostCounted), ReadOptional(entry, "p"), ReadOptional(entry, "odds"),
         entry.Has("reason") ? entry.Get("reason").Text() : std::string()});
  }
  return model;
}

}  // namespace

RunResult ReadResult(const std::filesystem::path& path) {
  constexpr size_t kMaxBytes = size_t{64} << 20;
  const nlohmann::ordered_json json = ReadJsonFile(path, kMaxBytes);
  const JsonReader reader(json, path.string());
  const std::string schema = reader.Get("schema").Text();
  if (schema == "heba/rig/1") {
    reader.Fail(
        "is the result of a rig; this command needs that of one camera ('heba compare', 'heba export' and 'heba "
        "locate' read both)");
  }
  if (schema != kResultSchema) reader.Fail("has the schema '" + schema + "', not '" + kResultSchema + "'");
  RunResult result;
  result.name = reader.Get("name").Text();
  const std::optional<Setup> setup = FindSetup(reader.Get("setup").Text());
  if (!setup) reader.Fail("the setup is unknown");
  result.setup = *setup;
  result.target_type = reader.Get("target").Get("type").Text();
  result.num_target_points = reader.Get("target").Get("points").Int(0, kMostCounted);
  for (const JsonReader& capture : reader.Get("captures").List()) result.captures.push_back(ReadCapture(capture));
  for (const JsonReader& estimate : reader.Get("estimates").List()) {
    result.estimates.push_back(ReadEstimate(estimate, result.setup));
    if (!estimate.Has("robot")) continue;
    result.robot = ReadArmJson(estimate.Get("robot"));
    std::optional<Solution>& solution = result.estimates.back().solution;
    if (!solution || !result.robot->is_estimated) continue;
    ArmEffects effects =
        ReadArmEffects(estimate.Get("robot"), *result.robot, solution->covariance.layout.Block(kRobotBlock).effects);
    result.robot->errors_name = effects.shared->name;
    solution->shared_effects = std::move(effects.shared);
    solution->effects = std::move(effects.values);
    solution->effect_sigmas = std::move(effects.sigmas);
  }
  if (reader.Has("working_point")) {
    const JsonReader point = reader.Get("working_point");
    const std::vector<double> at = point.Get("in_camera_m").Numbers(3);
    result.working_point.emplace();
    result.working_point->in_camera_m = Eigen::Vector3d(at[0], at[1], at[2]);
    const std::vector<JsonReader> rows = point.Get("covariance_m2").List();
    if (rows.size() != 3) point.Fail("the covariance is not 3 x 3");
    for (int i = 0; i < 3; ++i) {
      const std::vector<double> row = rows[static_cast<size_t>(i)].Numbers(3);
      result.working_point->covariance_m2.row(i) = Eigen::Map<const Eigen::RowVector3d>(row.data());
    }
    if (!(result.working_point->covariance_m2.diagonal().array() >= 0).all()) point.Fail("a variance is negative");
  }
  if (reader.Has("model")) result.model = ReadModel(reader.Get("model"));
  // Results of versions before 0.2 contain no verdict.
  result.verdict = reader.Has("verdict") ? ReadVerdict(reader.Get("verdict")) : JudgeRun(result);
  result.timing = ReadTiming(reader.Get("timing_s"));
  return result;
}

Truth ReadTruth(const std::filesystem::path& path, Setup setup) {
  const nlohmann::ordered_json json = ReadJsonFile(path, 1 << 20);
  const JsonReader reader(json, path.string());
  Truth truth;
  truth.camera_mount_from_camera = ReadPoseJson(reader.Get("hand_eye"), CameraMountName(setup), "camera");
  if (reader.Has("board")) {
    truth.target_mount_from_target = ReadPoseJson(reader.Get("board"), TargetMountName(setup), "target");
  }
  if (reader.Has("camera")) truth.camera = ReadCameraJson(reader.Get("camera"));
  if (reader.Has("robot")) {
    const std::vector<std::pair<std::string, std::optional<JsonReader>>> errors = reader.Get("robot").Members();
    std::vector<double> values;
    for (const auto& [name, value] : errors) {
      // Files of earlier versions have no compliances.
      const int compliance = static_cast<int>(ArmParam::kCompliance);
      if (static_cast<int>(values.size()) % kNumArmParams == compliance &&
          name != ArmParamName(static_cast<int>(values.size()))) {
        values.push_back(0);
      }
      if (name != ArmParamName(static_cast<int>(values.size())) || !value) {
        reader.Fail("robot: the errors of all parameters of the arm are needed, in their order");
      }
      values.push_back(value->Number());
    }
    while (values.size() % kNumArmParams != 0) values.push_back(0);
    truth.arm_errors = Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
  }
  return truth;
}

}  // namespace heba
