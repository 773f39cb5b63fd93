#include "tools/study/study_cells.h"

#include <system_error>

#include <nlohmann/json.hpp>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/io/json_reader.h"
#include "solvers/residuals/loss.h"
#include "tools/files/program_digest.h"
#include "tools/run/digest.h"

namespace heba {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

Json ErrorsJson(const StudyErrors& errors) {
  Json json = {{"hand_eye_m", errors.hand_eye_m},
               {"hand_eye_rad", errors.hand_eye_rad},
               {"board_m", errors.board_m},
               {"board_rad", errors.board_rad}};
  if (errors.focal_px) json["focal_px"] = *errors.focal_px;
  if (errors.inside_m) json["inside_m"] = *errors.inside_m;
  if (errors.outside_m) json["outside_m"] = *errors.outside_m;
  return json;
}

StudyErrors ReadErrors(const JsonReader& reader) {
  StudyErrors errors;
  errors.hand_eye_m = reader.Get("hand_eye_m").Number();
  errors.hand_eye_rad = reader.Get("hand_eye_rad").Number();
  errors.board_m = reader.Get("board_m").Number();
  errors.board_rad = reader.Get("board_rad").Number();
  if (reader.Has("focal_px")) errors.focal_px = reader.Get("focal_px").Number();
  if (reader.Has("inside_m")) errors.inside_m = reader.Get("inside_m").Number();
  if (reader.Has("outside_m")) errors.outside_m = reader.Get("outside_m").Number();
  return errors;
}

Json MethodJson(const MethodSummary& method) {
  Json json = {{"method", method.method},
               {"trials", method.num_trials},
               {"failed", method.num_failed},
               {"rms", ErrorsJson(method.rms)},
               {"axxb_mean_mm", method.axxb_mean_mm}};
  if (method.coverage) json["coverage"] = *method.coverage;
  if (method.right_model) json["right_model"] = *method.right_model;
  if (method.estimated_effects) json["estimated_effects"] = *method.estimated_effects;
  if (method.coverage_inside) json["coverage_inside"] = *method.coverage_inside;
  if (method.coverage_outside) json["coverage_outside"] = *method.coverage_outside;
  if (method.pixel_sigma_px) json["pixel_sigma_px"] = *method.pixel_sigma_px;
  if (method.robot_noise) json["robot_noise"] = {method.robot_noise->translation_m, method.robot_noise->rotation_rad};
  return json;
}

MethodSummary ReadMethod(const JsonReader& reader) {
  MethodSummary method;
  method.method = reader.Get("method").Text();
  method.num_trials = static_cast<int>(reader.Get("trials").Number());
  method.num_failed = static_cast<int>(reader.Get("failed").Number());
  method.rms = ReadErrors(reader.Get("rms"));
  method.axxb_mean_mm = reader.Get("axxb_mean_mm").Number();
  if (reader.Has("coverage")) method.coverage = reader.Get("coverage").Number();
  if (reader.Has("right_model")) method.right_model = reader.Get("right_model").Number();
  if (reader.Has("estimated_effects")) method.estimated_effects = reader.Get("estimated_effects").Number();
  if (reader.Has("coverage_inside")) method.coverage_inside = reader.Get("coverage_inside").Number();
  if (reader.Has("coverage_outside")) method.coverage_outside = reader.Get("coverage_outside").Number();
  if (reader.Has("pixel_sigma_px")) method.pixel_sigma_px = reader.Get("pixel_sigma_px").Number();
  if (reader.Has("robot_noise")) {
    const std::vector<double> noise = reader.Get("robot_noise").Numbers(2);
    method.robot_noise = RobotNoise{noise[0], noise[1]};
  }
  return method;
}

// Returns a digest of everything that the result of a cell depends on.
std::string MadeFrom(const StudyConfig& study, int index) {
  const StudyCell& cell = study.cells[static_cast<size_t>(index)];
  const BundleOptions& bundle = cell.options.bundle;
  std::string text = DigestOfProgram() + " " + std::to_string(study.num_trials) + " " + std::to_string(study.seed);
  const auto add = [&text](double value) { text += " " + RoundTrip(value); };
  const auto add_pose = [&](const Rigid3d& pose) {
    for (int i = 0; i < 3; ++i) add(pose.translation[i]);
    for (int i = 0; i < 4; ++i) add(pose.rotation.coeffs()[i]);
  };
  text += " " + cell.camera.model;
  for (const double param : cell.camera.params) add(param);
  add(cell.camera.width_px);
  add(cell.camera.height_px);
  add_pose(cell.hand_eye.camera_mount_from_camera);
  add_pose(cell.hand_eye.target_mount_from_target);
  for (Eigen::Index i = 0; i < cell.target.size(); ++i) {
    for (int k = 0; k < 3; ++k) add(cell.target.points_in_target(k, i));
    add(cell.target.RadiusM(i));
  }
  for (const SimulatedPose& pose : cell.poses) {
    text += " " + std::string(RoleName(pose.role));
    add_pose(pose.camera_from_target);
  }
  for (const double value : {cell.pixel_sigma_px, cell.robot_noise.translation_m, cell.robot_noise.rotation_rad,
                             cell.outlier_points, cell.wrong_captures}) {
    add(value);
  }
  text += " " + Join(cell.options.methods, ",") + " " + cell.options.seed + " " +
          std::string(LossOf(bundle.loss).name) + " " + std::string(SetupName(cell.options.setup)) + " " +
          cell.options.camera_model;
  add(cell.options.camera ? 1 : 0);
  if (cell.num_repeats > 1) add(cell.num_repeats);
  for (const double param : cell.shape.params) add(param);
  add(cell.options.choose.robot_noise ? 1 : 0);
  add(cell.options.choose.target_shape ? 1 : 0);
  add(static_cast<double>(bundle.robot));
  add(bundle.robot_noise.translation_m);
  add(bundle.robot_noise.rotation_rad);
  for (const ParameterGroup group : bundle.free_intrinsics) add(static_cast<double>(group));
  if (cell.robot) {
    text += " " + study.labels[static_cast<size_t>(index)].kinematics;
    for (const EffectGroup& group : cell.robot->errors->groups) add(group.sigma);
    add(cell.robot->joint_noise_rad);
    for (const Matrix6X& by_joints : cell.robot->gripper_by_joints) add(by_joints.sum());
    for (const StudyPlace& place : cell.robot->places) add_pose(place.camera_mount_from_target_mount);
  }
  return DigestOf(text);
}

}  // namespace

StudyCells::StudyCells(const fs::path& folder, const StudyConfig& study) : folder_(folder / "cells"), study_(study) {
  std::error_code error;
  const bool is_study = fs::exists(folder / "study.csv", error) || fs::exists(folder_, error);
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    // Another shard may just have created the folder of the cells.
    const std::string name = entry.path().filename().string();
    if (is_study || name.starts_with(".") || name == "cells") continue;
    throw InputError(folder.string() + ": holds other files (no study.csv); name a new or empty folder");
  }
  fs::create_directories(folder_, error);
  if (error) throw InputError(folder_.string() + ": cannot be created (" + error.message() + ")");
}

fs::path StudyCells::FileOf(int cell) const { return folder_ / (std::to_string(cell) + ".json"); }

std::optional<CellResult> StudyCells::Find(int cell) const {
  std::error_code error;
  if (!fs::exists(FileOf(cell), error)) return std::nullopt;
  try {
    const Json json = ReadJsonFile(FileOf(cell), 1 << 20);
    const JsonReader reader(json, FileOf(cell).string());
    if (reader.Get("made_from").Text() != MadeFrom(study_, cell)) return std::nullopt;
    CellResult result;
    result.cell = cell;
    result.labels = study_.labels[static_cast<size_t>(cell)];
    if (reader.Has("bound")) {
      result.bound = ReadErrors(reader.Get("bound"));
    } else {
      result.bound = Failure{reader.Get("no_bound").Text()};
    }
    for (const JsonReader& method : reader.Get("methods").List()) result.methods.push_back(ReadMethod(method));
    return result;
  } catch (const InputError&) {
    return std::nullopt;  // The file was written by another version or is damaged.
  }
}

void StudyCells::Keep(const CellResult& result) const {
  Json json;
  json["made_from"] = MadeFrom(study_, result.cell);
  if (result.bound) {
    json["bound"] = ErrorsJson(*result.bound);
  } else {
    json["no_bound"] = result.bound.reason();
  }
  json["methods"] = Json::array();
  for (const MethodSummary& method : result.methods) json["methods"].push_back(MethodJson(method));
  WriteFileAtomically(FileOf(result.cell), json.dump() + "\n");
}

}  // namespace heba
