#include "tools/config/study_config.h"
#include "tools/config/common_keys.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/config/yaml_reader.h"
#include "heba/detection.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/residuals/loss.h"
#include "tools/config/file_kind.h"
#include "tools/config/robot_noise_config.h"
#include "tools/config/run_config.h"
#include "tools/config/scene_config.h"
#include "tools/config/study_robot.h"
#include "tools/run/arm_setup.h"

namespace heba {
namespace {

struct NamedScene {
  std::string name;
  ConfigValue place;
  SceneConfig scene;
};

// Reads a mapping from names to scenes, each a file or a mapping itself.
std::vector<NamedScene> ReadScenes(MapReader& reader) {
  const ConfigValue value = reader.Get("scenes");
  if (!value.IsMap() || value.node().size() == 0) value.Fail("a mapping from names to scenes is needed");
  MapReader scenes(value);
  std::vector<NamedScene> result;
  YAML::Node used(YAML::NodeType::Map);
  for (const auto& entry : value.node()) {
    const std::string name = entry.first.as<std::string>();
    const ConfigValue scene = scenes.Get(name);
    result.push_back({name, scene, scene.IsMap() ? ReadScene(scene) : ReadSceneConfig(scene.AsPath())});
    used[name] = result.back().scene.used;
  }
  reader.Record("scenes", used);
  return result;
}

// Reads a list of values to vary, or a single value. `node_of` converts a value to its node in the config as used.
template <class T, class Read, class NodeOf>
std::vector<T> ReadList(MapReader& reader, const std::string& key, const std::vector<T>& fallback, const Read& read,
                        const NodeOf& node_of) {
  std::vector<T> list = fallback;
  if (const std::optional<ConfigValue> value = reader.Find(key)) {
    list.clear();
    const std::vector<ConfigValue> items = value->IsList() ? value->AsList() : std::vector<ConfigValue>{*value};
    for (const ConfigValue& item : items) list.push_back(read(item));
    if (list.empty()) value->Fail("the list is empty");
  }
  if (list.empty()) return list;
  YAML::Node used(YAML::NodeType::Sequence);
  for (const T& value : list) used.push_back(node_of(value));
  reader.Record(key, used);
  return list;
}

double ReadShare(const ConfigValue& value) {
  const double share = value.AsNumber();
  if (!(share >= 0 && share <= 1)) value.Fail("a share from 0 to 1 is needed");
  return share;
}

YAML::Node ShareNode(double share) { return YAML::Node(RoundTrip(share)); }
YAML::Node PixelsNode(double value_px) { return QuantityNode(value_px, Quantity::kPixels); }

RobotNoise ReadNoise(const ConfigValue& value) {
  MapReader reader(value);
  return ReadRobotNoise(reader);
}

YAML::Node NoiseNode(const RobotNoise& noise) {
  YAML::Node node;
  node["translation"] = QuantityNode(noise.translation_m, Quantity::kLength);
  node["rotation"] = QuantityNode(noise.rotation_rad, Quantity::kAngle);
  return node;
}

constexpr std::array<const char*, TargetShape::kNumParams> kShapeKeys = {"scale_x", "scale_y", "bend_x", "bend_y"};

// Reads the deviation of the target from its design, with the keys of a scene's `print`.
TargetShape ReadTrueShape(const ConfigValue& value) {
  MapReader reader(value);
  TargetShape shape;
  for (size_t i = 0; i < shape.params.size(); ++i) {
    const std::optional<ConfigValue> param = reader.Find(kShapeKeys[i]);
    if (!param) continue;
    shape.params[i] = i < 2 ? param->AsNumber() : param->AsQuantity(Quantity::kLength);
    if (i < 2 && !(shape.params[i] >= 0.5 && shape.params[i] <= 2)) param->Fail("must be from 0.5 to 2");
    if (i >= 2 && std::abs(shape.params[i]) > 0.1) param->Fail("must be at most 100 mm");
  }
  reader.Finish();
  return shape;
}

YAML::Node ShapeNode(const TargetShape& shape) {
  YAML::Node node;
  for (size_t i = 0; i < shape.params.size(); ++i) {
    node[kShapeKeys[i]] =
        i < 2 ? YAML::Node(RoundTrip(shape.params[i])) : QuantityNode(shape.params[i], Quantity::kLength);
  }
  return node;
}

BundleOptions::Robot RobotModel(const std::string& name) {
  if (name == "exact") return BundleOptions::Robot::kExact;
  return name == "given" ? BundleOptions::Robot::kGivenNoise : BundleOptions::Robot::kEstimatedNoise;
}

// Reads the free intrinsics: one list of groups, or a list of such lists to vary.
std::vector<std::vector<ParameterGroup>> ReadIntrinsics(MapReader& reader) {
  const std::optional<ConfigValue> value = reader.Find("intrinsics");
  const std::vector<ConfigValue> items = value && value->IsList() ? value->AsList() : std::vector<ConfigValue>();
  if (items.empty() || !items.front().IsList()) return {ReadFreeIntrinsics(reader, {})};
  return ReadList<std::vector<ParameterGroup>>(reader, "intrinsics", {}, &ReadParameterGroups, &ParameterGroupsNode);
}

std::vector<RigEstimator> ReadEstimators(MapReader& reader) {
  const std::vector<std::string> names(kRigEstimatorNames.begin(), kRigEstimatorNames.end());
  std::vector<RigEstimator> known;
  return ReadList<RigEstimator>(
      reader, "estimators", RigStudyCell().estimators,
      [&](const ConfigValue& value) {
        const std::string name = value.AsChoice(names);
        const auto estimator = static_cast<RigEstimator>(std::find(names.begin(), names.end(), name) - names.begin());
        if (std::find(known.begin(), known.end(), estimator) != known.end()) value.Fail("is listed twice");
        known.push_back(estimator);
        return estimator;
      },
      [](RigEstimator estimator) { return YAML::Node(kRigEstimatorNames[static_cast<size_t>(estimator)]); });
}

// A cell under construction.
template <class Cell>
struct Variant {
  Cell cell;
  StudyLabels labels;
};

// Replaces each variant by as many as there are values, in their order, and sets one value in each.
template <class T, class Cell, class Set>
void Vary(const std::vector<T>& values, std::vector<Variant<Cell>>* variants, const Set& set) {
  std::vector<Variant<Cell>> varied;
  for (const Variant<Cell>& variant : *variants) {
    for (const T& value : values) {
      varied.push_back(variant);
      set(value, &varied.back());
    }
  }
  *variants = std::move(varied);
}

// The values of all lists, and what all cells have in common.
struct StudyGrid {
  std::vector<double> pixel_sigmas;
  std::vector<RobotNoise> robot_noises;
  std::vector<int> captures;  // Zero stands for those of the scene.
  std::vector<double> outliers;
  std::vector<double> wrongs;
  std::vector<std::string> robot_models;
  std::vector<std::string> kinematics;
  std::vector<TargetShape> target_shapes;
  std::vector<std::vector<ParameterGroup>> intrinsics;
  std::vector<RigEstimator> estimators;
  bool chooses_shape = true;
  std::optional<bool> give_camera;  // If not set, each scene decides.
  CalibrationOptions options;
};

template <class Cell>
void AddCells(std::vector<Variant<Cell>> variants, StudyConfig* study) {
  for (Variant<Cell>& variant : variants) {
    study->cells.emplace_back(std::move(variant.cell));
    study->labels.push_back(std::move(variant.labels));
  }
}

void AddCameraCells(const StudyGrid& grid, const NamedScene& named, int num_captures, SceneConfig scene,
                    StudyConfig* study) {
  const int num_two_step = scene.two_step ? 3 + scene.two_step->num_turns : 0;
  if (num_captures > 0) {
    if (num_captures < num_two_step) named.place.Fail("has more captures in its two-step motion than requested");
    scene.options.motion.num_captures = num_captures - num_two_step;
  }
  Rng rng(scene.seed);
  StudyCell cell;
  cell.camera = scene.problem.cameras[0].camera;
  cell.hand_eye = HandEyeOf(scene);
  cell.target = AllPoints(*scene.targets[0].target);
  const std::optional<SceneArm>& arm = scene.arms[0];
  if (arm) {
    const std::optional<Failure> failure = SetUpStudyRobot(scene, &rng, &cell);
    if (failure) named.place.Fail(failure->ToString());
  } else {
    const Outcome<std::vector<SimulatedPose>> poses = SimulateScenePoses(scene, &rng);
    if (!poses) named.place.Fail(poses.reason());
    cell.poses = *poses;
  }
  cell.options = grid.options;
  cell.options.setup = *scene.setup;
  cell.num_repeats = scene.num_repeats;
  cell.options.symmetries = {Rigid3d()};
  cell.options.camera_model = cell.camera.model;
  cell.options.width_px = cell.camera.width_px;
  cell.options.height_px = cell.camera.height_px;
  if (grid.give_camera.value_or(scene.give_camera)) cell.options.camera = cell.camera;
  cell.options.choose.target_shape = grid.chooses_shape;
  cell.options.shape = DesignedShape(cell.target.points_in_target);
  cell.shape = cell.options.shape;
  std::vector<Variant<StudyCell>> variants = {{cell, {}}};
  StudyLabels& labels = variants.front().labels;
  labels.scene = named.name;
  labels.setup = *scene.setup;
  labels.num_captures = static_cast<int>(cell.poses.size());
  labels.num_points = cell.target.size();
  Vary(grid.pixel_sigmas, &variants, [](double sigma_px, auto* variant) {
    variant->cell.pixel_sigma_px = variant->labels.pixel_sigma_px = sigma_px;
  });
  Vary(grid.robot_noises, &variants, [](const RobotNoise& noise, auto* variant) {
    variant->cell.robot_noise = variant->labels.robot_noise = noise;
    variant->cell.options.bundle.robot_noise = noise;
  });
  Vary(grid.target_shapes, &variants, [](const TargetShape& shape, auto* variant) {
    variant->cell.shape.params = variant->labels.shape_params = shape.params;
  });
  Vary(grid.outliers, &variants,
       [](double share, auto* variant) { variant->cell.outlier_points = variant->labels.outlier_points = share; });
  Vary(grid.wrongs, &variants,
       [](double share, auto* variant) { variant->cell.wrong_captures = variant->labels.wrong_captures = share; });
  Vary(grid.robot_models, &variants, [](const std::string& model, auto* variant) {
    variant->labels.robot_model = model;
    variant->cell.options.bundle.robot = RobotModel(model);
    variant->cell.options.choose.robot_noise = model == "auto";
  });
  Vary(grid.intrinsics, &variants, [](const std::vector<ParameterGroup>& groups, auto* variant) {
    variant->cell.options.bundle.free_intrinsics = variant->labels.free_intrinsics = groups;
  });
  if (arm) {
    Vary(grid.kinematics, &variants, [&](const std::string& model, auto* variant) {
      const Kinematics kind = *FindValue<Kinematics>(kKinematicsNames, model);
      if (kind == Kinematics::kGravity && arm->nominal.load == nullptr) {
        named.place.Fail("has an arm whose links have no known masses, so that kinematics: gravity is not possible");
      }
      const std::vector<std::shared_ptr<const SharedEffects>> errors =
          CandidateArmErrors(arm->nominal, kind, variant->cell.poses.size());
      variant->labels.kinematics = model;
      variant->cell.options.bundle.target_scale_sigma = kPrintScaleSigma;
      if (model == "auto") {
        variant->cell.options.choose.effects = errors;
      } else if (!errors.empty()) {
        variant->cell.options.bundle.effects = errors.front();
      }
    });
  }
  AddCells(std::move(variants), study);
}

// Returns the number with the noun: "1 arm", "2 targets".
std::string Counted(size_t number, const std::string& noun) {
  return std::to_string(number) + " " + noun + (number == 1 ? "" : "s");
}

void AddRigCells(const StudyGrid& grid, const NamedScene& named, int num_captures, SceneConfig scene,
                 StudyConfig* study) {
  if (num_captures > 0) scene.options.motion.num_captures = num_captures;
  Rng rng(scene.seed);
  RigStudyCell cell;
  cell.rig = scene.problem;
  cell.poses = scene.poses;
  cell.targets = SimulatedTargets(scene);
  cell.simulation = scene.options;
  const Outcome<std::vector<ArmPoses>> arms =
      SimulateArmPoses(scene.problem, scene.poses, cell.targets, scene.options, &rng);
  if (!arms) named.place.Fail(arms.reason());
  cell.arms = *arms;
  if (grid.give_camera.value_or(scene.give_camera)) cell.options.has_camera.assign(scene.problem.cameras.size(), true);
  cell.options.choose_target_shape = grid.chooses_shape;
  cell.options.adjustment.loss = grid.options.bundle.loss;
  cell.estimators = grid.estimators;
  std::vector<Variant<RigStudyCell>> variants = {{cell, {}}};
  StudyLabels& labels = variants.front().labels;
  labels.scene = named.name;
  labels.rig = Counted(scene.problem.cameras.size(), "camera") + ", " +
               Counted(scene.problem.targets.size(), "target") + ", " + Counted(scene.problem.robots.size(), "arm");
  labels.num_captures = static_cast<int>(cell.arms.size());
  for (const SimulatedTarget& target : cell.targets) {
    labels.num_points += static_cast<int>(target.points_in_target.cols());
  }
  Vary(grid.pixel_sigmas, &variants, [](double sigma_px, auto* variant) {
    variant->cell.simulation.noise_px = variant->labels.pixel_sigma_px = sigma_px;
  });
  Vary(grid.robot_noises, &variants, [](const RobotNoise& noise, auto* variant) {
    variant->cell.simulation.robot_noise = variant->labels.robot_noise = noise;
    variant->cell.options.adjustment.robot_noise = noise;
  });
  Vary(grid.robot_models, &variants, [](const std::string& model, auto* variant) {
    variant->labels.robot_model = model;
    variant->cell.options.adjustment.robot = RobotModel(model);
  });
  Vary(grid.intrinsics, &variants, [](const std::vector<ParameterGroup>& groups, auto* variant) {
    variant->labels.free_intrinsics = groups;
    for (RigCamera& camera : variant->cell.rig.cameras) camera.free_intrinsics = groups;
  });
  AddCells(std::move(variants), study);
}

// Refuses what a scene has and a study does not simulate.
void RefuseUnsimulated(const NamedScene& named) {
  const SceneConfig& scene = named.scene;
  if (!scene.camera_motions.empty()) {
    const std::string& name = scene.problem.cameras[scene.camera_motions.front().camera].name;
    named.place.Fail("moves " + (name.empty() ? "its camera" : "camera " + name) +
                     " during the captures, which a study does not simulate");
  }
  if (!scene.setup && scene.num_repeats > 1) {
    named.place.Fail("repeats the captures of several cameras, which a study does not simulate");
  }
}

// Refuses values that have no effect on the scenes.
void RefuseUnused(const StudyGrid& grid, const std::vector<NamedScene>& scenes, MapReader& reader) {
  const auto rig =
      std::find_if(scenes.begin(), scenes.end(), [](const NamedScene& named) { return !named.scene.setup; });
  if (rig == scenes.end()) {
    if (grid.estimators != RigStudyCell().estimators) {
      reader.Get("estimators").Fail("is for rigs; no scene has 'cameras' and 'targets'");
    }
    return;
  }
  const auto is_zero = [](double share) { return share == 0; };
  const std::pair<const char*, bool> unused[] = {
      {"outlier_points", !std::all_of(grid.outliers.begin(), grid.outliers.end(), is_zero)},
      {"wrong_captures", !std::all_of(grid.wrongs.begin(), grid.wrongs.end(), is_zero)},
      {"target_shape", std::any_of(grid.target_shapes.begin(), grid.target_shapes.end(),
                                   [](const TargetShape& shape) { return shape.params != TargetShape().params; })},
      {"kinematics", grid.kinematics != std::vector<std::string>{"auto"}},
      {"methods", !grid.options.methods.empty()},
      {"start", grid.options.seed != kBestSeed}};
  for (const auto& [key, is_used] : unused) {
    if (is_used) reader.Get(key).Fail("is for scenes of one camera; scene " + Quoted(rig->name) + " is a rig");
  }
}

}  // namespace

StudyConfig ReadStudyConfig(const std::filesystem::path& path) {
  StudyConfig study;
  RefuseFolder(path, FileKind::kStudy);
  const ConfigValue file = ReadYamlFile(path);
  RefuseOtherKind(file, path, FileKind::kStudy);
  MapReader reader(file);
  study.name = ReadFolderName(reader, path.stem().string());
  study.num_trials = reader.Int("trials", {1, 100000000}, 300);
  study.seed = static_cast<uint64_t>(reader.Int("seed", {0, std::numeric_limits<int>::max()}, 1));
  const std::vector<NamedScene> scenes = ReadScenes(reader);
  const auto read_pixel_sigma = [](const ConfigValue& value) {
    const double sigma_px = value.AsQuantity(Quantity::kPixels);
    if (!(sigma_px > 0)) value.Fail("must be greater than zero");
    return sigma_px;
  };
  StudyGrid grid;
  grid.pixel_sigmas = ReadList<double>(reader, "pixel_noise", {0.1}, read_pixel_sigma, PixelsNode);
  grid.robot_noises = ReadList<RobotNoise>(reader, "robot_noise", {RobotNoise{}}, ReadNoise, NoiseNode);
  grid.captures = ReadList<int>(
      reader, "captures", {},
      [](const ConfigValue& value) {
        return value.AsInt({3, 10000});
      },
      [](int num_captures) { return YAML::Node(num_captures); });
  if (grid.captures.empty()) grid.captures = {0};  // Each scene has as many as its motion states.
  grid.outliers = ReadList<double>(reader, "outlier_points", {0.0}, ReadShare, ShareNode);
  grid.wrongs = ReadList<double>(reader, "wrong_captures", {0.0}, ReadShare, ShareNode);
  grid.robot_models = ReadList<std::string>(
      reader, "robot_model", {"auto"},
      [](const ConfigValue& value) {
        return value.AsChoice({"exact", "given", "estimated", "auto"});
      },
      [](const std::string& model) { return YAML::Node(model); });
  grid.kinematics = ReadList<std::string>(
      reader, "kinematics", {"auto"},
      [](const ConfigValue& value) {
        return value.AsChoice({"none", "auto", "offsets", "geometry", "gravity"});
      },
      [](const std::string& model) { return YAML::Node(model); });
  grid.target_shapes = ReadList<TargetShape>(reader, "target_shape", {TargetShape()}, ReadTrueShape, ShapeNode);
  grid.chooses_shape = reader.Choice("shape_model", {"none", "auto"}, "auto") == "auto";
  if (reader.Has("give_camera")) grid.give_camera = reader.Bool("give_camera", true);
  grid.estimators = ReadEstimators(reader);
  grid.options.methods = ReadMethods(reader);
  std::vector<std::string> seeds = HandEyeMethodNames();
  seeds.emplace_back(kBestSeed);
  grid.options.seed = reader.Choice("start", seeds, kBestSeed);
  grid.options.bundle.loss = *FindLossKind(reader.Choice("loss", LossNames(), "truncated"));
  grid.intrinsics = ReadIntrinsics(reader);
  if (reader.Has("output")) {
    study.output = reader.Path("output");
  } else {
    study.output = std::filesystem::absolute(path).parent_path() / "studies" / study.name;
    reader.Record("output", YAML::Node(study.output.string()));
  }
  reader.Finish();
  study.used = [&] {
    YAML::Emitter emitter;
    emitter << reader.used();
    return std::string(emitter.c_str()) + "\n";
  }();

  RefuseUnused(grid, scenes, reader);
  for (const NamedScene& named : scenes) RefuseUnsimulated(named);
  for (const NamedScene& named : scenes) {
    for (const int num_captures : grid.captures) {
      const auto add = named.scene.setup ? &AddCameraCells : &AddRigCells;
      add(grid, named, num_captures, named.scene, &study);
    }
  }
  return study;
}

}  // namespace heba
