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

template <class T>
struct Figure {
  const char* key;
  std::optional<double> T::*value;
};
constexpr Figure<StudyErrors> kErrors[] = {{"board_m", &StudyErrors::board_m},
                                           {"board_rad", &StudyErrors::board_rad},
                                           {"focal_px", &StudyErrors::focal_px},
                                           {"inside_m", &StudyErrors::inside_m},
                                           {"outside_m", &StudyErrors::outside_m}};
constexpr Figure<MethodSummary> kShares[] = {{"coverage", &MethodSummary::coverage},
                                             {"right_model", &MethodSummary::right_model},
                                             {"estimated_effects", &MethodSummary::estimated_effects},
                                             {"coverage_inside", &MethodSummary::coverage_inside},
                                             {"coverage_outside", &MethodSummary::coverage_outside},
                                             {"pixel_sigma_px", &MethodSummary::pixel_sigma_px}};

Json ErrorsJson(const StudyErrors& errors) {
  Json json = {{"hand_eye_m", errors.hand_eye_m}, {"hand_eye_rad", errors.hand_eye_rad}};
  for (const auto& [key, value] : kErrors) {
    if (errors.*value) json[key] = *(errors.*value);
  }
  return json;
}

StudyErrors ReadErrors(const JsonReader& reader) {
  StudyErrors errors;
  errors.hand_eye_m = reader.Get("hand_eye_m").Number();
  errors.hand_eye_rad = reader.Get("hand_eye_rad").Number();
  for (const auto& [key, value] : kErrors) {
    if (reader.Has(key)) errors.*value = reader.Get(key).Number();
  }
  return errors;
}

Json MethodJson(const MethodSummary& method) {
  Json json = {{"method", method.method},
               {"trials", method.num_trials},
               {"failed", method.num_failed},
               {"rms", ErrorsJson(method.rms)},
               {"axxb_mean_mm", method.axxb_mean_mm}};
  for (const auto& [key, value] : kShares) {
    if (method.*value) json[key] = *(method.*value);
  }
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
  for (const auto& [key, value] : kShares) {
    if (reader.Has(key)) method.*value = reader.Get(key).Number();
  }
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
  void Add(const Mount& mount) {
    Add(static_cast<double>(mount.robot));
    Add(static_cast<double>(mount.part));
  }
  void Add(const RobotNoise& noise) {
    Add(noise.translation_m);
    Add(noise.rotation_rad);
  }
  void Add(const std::vector<ParameterGroup>& groups) {
    for (const ParameterGroup group : groups) Add(static_cast<double>(group));
  }
  void Add(const StudyCell& cell, const StudyLabels& labels);
  const std::string& text() const { return text_; }

 private:
  void AddScene(const StudyCell& cell);

  std::string text_;
};

void Content::AddScene(const StudyCell& cell) {
  for (const std::string& robot : cell.problem.robots) Add(robot);
  for (const ProblemCamera& camera : cell.problem.cameras) {
    Add(camera.name + " " + MountText(cell.problem, camera));
    Add(camera.mount);
    Add(camera.camera);
    Add(camera.free_intrinsics);
  }
  for (size_t t = 0; t < cell.targets.size(); ++t) {
    Add(cell.problem.targets[t].name + " " + MountText(cell.problem, cell.problem.targets[t]));
    Add(cell.problem.targets[t].mount);
    const Observations& points = cell.targets[t].points;
    for (const double coordinate : points.points_in_target.reshaped()) Add(coordinate);
    for (Eigen::Index i = 0; i < points.size(); ++i) Add(points.RadiusM(i));
    Add(cell.targets[t].z_out ? 1 : 0);
  }
  for (const std::vector<Rigid3d>* poses :
       {&cell.poses.mount_from_camera, &cell.poses.mount_from_target, &cell.poses.world_from_base}) {
    for (const Rigid3d& pose : *poses) Add(pose);
  }
  for (const StudyCapture& capture : cell.captures) {
    Add(std::string(RoleName(capture.seen.role)));
    Add(capture.seen.camera_from_target);
    for (const Rigid3d& pose : capture.arms) Add(pose);
  }
}

void Content::Add(const StudyCell& cell, const StudyLabels& labels) {
  AddScene(cell);
  for (const double figure : {static_cast<double>(cell.num_repeats), cell.margin_px, cell.pixel_sigma_px,
                              cell.outlier_points, cell.wrong_captures, cell.gives_cameras ? 1.0 : 0.0}) {
    Add(figure);
  }
  Add(cell.robot_noise);
  for (const double param : cell.shape_params) Add(param);
  const BundleOptions& bundle = cell.options.bundle;
  Add(Join(cell.options.methods, ",") + " " + cell.options.seed + " " + std::string(LossOf(bundle.loss).name));
  Add(cell.options.choose.robot_noise ? 1 : 0);
  Add(cell.options.choose.target_shape ? 1 : 0);
  Add(static_cast<double>(bundle.robot));
  Add(bundle.robot_noise);
  for (const StudyEstimator estimator : cell.estimators) Add(static_cast<double>(estimator));
  if (!cell.robot) return;
  Add(labels.kinematics);
  for (const EffectGroup& group : cell.robot->errors->groups) Add(group.sigma);
  Add(cell.robot->joint_noise_rad);
  for (const Matrix6X& by_joints : cell.robot->gripper_by_joints) Add(by_joints.sum());
  for (const StudyPlace& place : cell.robot->places) Add(place.camera_mount_from_target_mount);
}

// Returns a digest of everything that the result of a cell depends on.
std::string MadeFrom(const StudyConfig& study, int index) {
  Content content;
  content.Add(DigestOfProgram() + " " + std::to_string(study.num_trials) + " " + std::to_string(study.seed));
  const auto place = static_cast<size_t>(index);
  content.Add(study.cells[place], study.labels[place]);
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

CellResult ReadPairResult(const JsonReader& reader, int cell, StudyLabels labels) {
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
      results.push_back(ReadPairResult(result, cell, study_.labels[static_cast<size_t>(cell)]));
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
