#include "tools/study/study_cells.h"

#include <system_error>
#include <utility>

#include <nlohmann/json.hpp>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/io/json_reader.h"
#include "solvers/residuals/loss.h"
#include "tools/files/program_digest.h"
#include "tools/run/digest.h"
#include "tools/text/failure_text.h"

namespace heba {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

Json ErrorsJson(const StudyErrors& errors) {
  Json json = {{"hand_eye_m", errors.hand_eye_m}, {"hand_eye_rad", errors.hand_eye_rad}};
  if (errors.board_m) json["board_m"] = *errors.board_m;
  if (errors.board_rad) json["board_rad"] = *errors.board_rad;
  if (errors.focal_px) json["focal_px"] = *errors.focal_px;
  if (errors.inside_m) json["inside_m"] = *errors.inside_m;
  if (errors.outside_m) json["outside_m"] = *errors.outside_m;
  return json;
}

StudyErrors ReadErrors(const JsonReader& reader) {
  StudyErrors errors;
  errors.hand_eye_m = reader.Get("hand_eye_m").Number();
  errors.hand_eye_rad = reader.Get("hand_eye_rad").Number();
  if (reader.Has("board_m")) errors.board_m = reader.Get("board_m").Number();
  if (reader.Has("board_rad")) errors.board_rad = reader.Get("board_rad").Number();
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

// The text of everything that the result of a cell depends on.
class Content {
 public:
  void Add(const std::string& text) { text_ += " " + text; }
  void Add(double value) { text_ += " " + RoundTrip(value); }
  void Add(const Rigid3d& pose) {
    for (int i = 0; i < 3; ++i) Add(pose.translation[i]);
    for (int i = 0; i < 4; ++i) Add(pose.rotation.coeffs()[i]);
  }
  void Add(const Camera& camera) {
    Add(camera.model);
    for (const double param : camera.params) Add(param);
    Add(camera.width_px);
    Add(camera.height_px);
  }
  void Add(const RobotNoise& noise) {
    Add(noise.translation_m);
    Add(noise.rotation_rad);
  }
  void Add(const std::vector<ParameterGroup>& groups) {
    for (const ParameterGroup group : groups) Add(static_cast<double>(group));
  }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

void AddCell(const StudyCell& cell, const StudyLabels& labels, Content* content) {
  const BundleOptions& bundle = cell.options.bundle;
  content->Add(cell.camera);
  content->Add(cell.hand_eye.camera_mount_from_camera);
  content->Add(cell.hand_eye.target_mount_from_target);
  for (Eigen::Index i = 0; i < cell.target.size(); ++i) {
    for (int k = 0; k < 3; ++k) content->Add(cell.target.points_in_target(k, i));
    content->Add(cell.target.RadiusM(i));
  }
  for (const SimulatedPose& pose : cell.poses) {
    content->Add(std::string(RoleName(pose.role)));
    content->Add(pose.camera_from_target);
  }
  content->Add(cell.pixel_sigma_px);
  content->Add(cell.robot_noise);
  content->Add(cell.outlier_points);
  content->Add(cell.wrong_captures);
  content->Add(Join(cell.options.methods, ",") + " " + cell.options.seed + " " + std::string(LossOf(bundle.loss).name) +
               " " + std::string(SetupName(cell.options.setup)) + " " + cell.options.camera_model);
  content->Add(cell.options.camera ? 1 : 0);
  if (cell.num_repeats > 1) content->Add(cell.num_repeats);
  for (const double param : cell.shape.params) content->Add(param);
  content->Add(cell.options.choose.robot_noise ? 1 : 0);
  content->Add(cell.options.choose.target_shape ? 1 : 0);
  content->Add(static_cast<double>(bundle.robot));
  content->Add(bundle.robot_noise);
  content->Add(bundle.free_intrinsics);
  if (cell.robot) {
    content->Add(labels.kinematics);
    for (const EffectGroup& group : cell.robot->errors->groups) content->Add(group.sigma);
    content->Add(cell.robot->joint_noise_rad);
    for (const Matrix6X& by_joints : cell.robot->gripper_by_joints) content->Add(by_joints.sum());
    for (const StudyPlace& place : cell.robot->places) content->Add(place.camera_mount_from_target_mount);
  }
}

void AddCell(const RigStudyCell& cell, const StudyLabels& /*labels*/, Content* content) {
  content->Add("rig");
  for (const std::string& robot : cell.rig.robots) content->Add(robot);
  for (const RigCamera& camera : cell.rig.cameras) {
    content->Add(camera.name + " " + MountText(cell.rig, camera));
    content->Add(camera.camera);
    content->Add(camera.free_intrinsics);
  }
  for (size_t t = 0; t < cell.rig.targets.size(); ++t) {
    content->Add(cell.rig.targets[t].name + " " + MountText(cell.rig, cell.rig.targets[t]));
    for (const double coordinate : cell.targets[t].points_in_target.reshaped()) content->Add(coordinate);
    content->Add(cell.targets[t].z_out ? 1 : 0);
  }
  for (const std::vector<Rigid3d>* poses :
       {&cell.poses.mount_from_camera, &cell.poses.mount_from_target, &cell.poses.world_from_base}) {
    for (const Rigid3d& pose : *poses) content->Add(pose);
  }
  for (const ArmPoses& arms : cell.arms) {
    for (const Rigid3d& pose : arms) content->Add(pose);
  }
  content->Add(cell.simulation.noise_px);
  content->Add(cell.simulation.robot_noise);
  content->Add(cell.simulation.motion.margin_px);
  const RigOptions& adjustment = cell.options.adjustment;
  content->Add(std::string(LossOf(adjustment.loss).name));
  content->Add(static_cast<double>(adjustment.robot));
  content->Add(adjustment.robot_noise);
  content->Add(cell.options.choose_target_shape ? 1 : 0);
  content->Add(static_cast<double>(cell.options.has_camera.size()));
  for (const RigEstimator estimator : cell.estimators) content->Add(static_cast<double>(estimator));
}

// Returns a digest of everything that the result of a cell depends on.
std::string MadeFrom(const StudyConfig& study, int index) {
  Content content;
  content.Add(DigestOfProgram() + " " + std::to_string(study.num_trials) + " " + std::to_string(study.seed));
  const auto place = static_cast<size_t>(index);
  std::visit([&](const auto& cell) { AddCell(cell, study.labels[place], &content); }, study.cells[place]);
  return DigestOf(content.text());
}

Json ResultJson(const CellResult& result) {
  Json json;
  if (!result.labels.pose.empty()) json["pose"] = result.labels.pose;
  if (result.bound) {
    json["bound"] = ErrorsJson(*result.bound);
  } else {
    json["no_bound"] = FailureText(result.bound.failure());
  }
  json["methods"] = Json::array();
  for (const MethodSummary& method : result.methods) json["methods"].push_back(MethodJson(method));
  return json;
}

CellResult ReadResult(const JsonReader& reader, int cell, StudyLabels labels) {
  CellResult result;
  result.cell = cell;
  result.labels = std::move(labels);
  if (reader.Has("pose")) result.labels.pose = reader.Get("pose").Text();
  if (reader.Has("bound")) {
    result.bound = ReadErrors(reader.Get("bound"));
  } else {
    result.bound = Failure{reader.Get("no_bound").Text()};
  }
  for (const JsonReader& method : reader.Get("methods").List()) result.methods.push_back(ReadMethod(method));
  return result;
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

std::optional<std::vector<CellResult>> StudyCells::Find(int cell) const {
  std::error_code error;
  if (!fs::exists(FileOf(cell), error)) return std::nullopt;
  try {
    const Json json = ReadJsonFile(FileOf(cell), 1 << 20);
    const JsonReader reader(json, FileOf(cell).string());
    if (reader.Get("made_from").Text() != MadeFrom(study_, cell)) return std::nullopt;
    std::vector<CellResult> results;
    for (const JsonReader& result : reader.Get("results").List()) {
      results.push_back(ReadResult(result, cell, study_.labels[static_cast<size_t>(cell)]));
    }
    return results;
  } catch (const InputError&) {
    return std::nullopt;  // The file was written by another version or is damaged.
  }
}

void StudyCells::Keep(const std::vector<CellResult>& results) const {
  const int cell = results.at(0).cell;
  Json json;
  json["made_from"] = MadeFrom(study_, cell);
  json["results"] = Json::array();
  for (const CellResult& result : results) json["results"].push_back(ResultJson(result));
  WriteFileAtomically(FileOf(cell), json.dump() + "\n");
}

}  // namespace heba
