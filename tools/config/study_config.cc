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
#include "tools/config/scene_config.h"
#include "tools/config/short_run_config.h"
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

double ReadPixelSigma(const ConfigValue& value) {
  const double sigma_px = value.AsQuantity(Quantity::kPixels);
  if (!(sigma_px > 0)) value.Fail("must be greater than zero");
  return sigma_px;
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

// Reads the deviation of the target from its design, with the keys of a scene's `print`.
TargetShape ReadTrueShape(const ConfigValue& value) {
  MapReader reader(value);
  TargetShape shape;
  for (size_t i = 0; i < shape.params.size(); ++i) {
    const std::optional<ConfigValue> param = reader.Find(kTargetShapeKeys[i]);
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
    node[kTargetShapeKeys[i]] =
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

std::vector<StudyEstimator> ReadEstimators(MapReader& reader) {
  const std::vector<std::string> names(kStudyEstimatorNames.begin(), kStudyEstimatorNames.end());
  std::vector<StudyEstimator> known;
  return ReadList<StudyEstimator>(
      reader, "estimators", StudyCell().estimators,
      [&](const ConfigValue& value) {
        const std::string name = value.AsChoice(names);
        const auto estimator = static_cast<StudyEstimator>(std::find(names.begin(), names.end(), name) - names.begin());
        if (std::find(known.begin(), known.end(), estimator) != known.end()) value.Fail("is listed twice");
        known.push_back(estimator);
        return estimator;
      },
      [](StudyEstimator estimator) { return YAML::Node(kStudyEstimatorNames[static_cast<size_t>(estimator)]); });
}

// A cell under construction.
struct Variant {
  StudyCell cell;
  StudyLabels labels;
};

// Returns as many variants for each one as there are values, in their order: `with` returns a variant with a value.
template <class T, class With>
std::vector<Variant> Varied(const std::vector<Variant>& variants, const std::vector<T>& values, const With& with) {
  std::vector<Variant> varied;
  for (const Variant& variant : variants) {
    for (const T& value : values) varied.push_back(with(variant, value));
  }
  return varied;
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
  std::vector<StudyEstimator> estimators;
  std::optional<bool> give_camera;  // If not set, each scene decides.
  PairCalibrationOptions options;
};

// Draws the captures of a scene, and of a hand-eye calibration with an arm its robot.
Outcome<CapturesOfCell> DrawCaptures(const SceneConfig& scene) {
  Rng rng(scene.seed);
  if (scene.setup && scene.arms[0]) return DrawArmCaptures(scene, rng);
  CapturesOfCell drawn;
  if (scene.setup) {
    const Outcome<std::vector<SimulatedPose>> poses = SimulateScenePoses(scene, rng);
    if (!poses) return poses.failure();
    for (const SimulatedPose& pose : *poses) drawn.captures.push_back({pose});
    return drawn;
  }
  const Outcome<std::vector<ArmPoses>> arms =
      SimulateArmPoses(scene.problem, scene.poses, SimulatedTargets(scene), scene.options, rng);
  if (!arms) return arms.failure();
  for (const ArmPoses& poses : *arms) drawn.captures.push_back({{}, poses});
  return drawn;
}

// Returns the number with the noun: "1 arm", "2 targets".
std::string Counted(size_t number, const std::string& noun) {
  return std::to_string(number) + " " + noun + (number == 1 ? "" : "s");
}

// Returns the cell of a scene and its labels, before any value is varied.
Variant CellOf(const StudyGrid& grid, const NamedScene& named, int num_captures) {
  SceneConfig scene = named.scene;
  const int num_two_step = scene.two_step ? 3 + scene.two_step->num_turns : 0;
  if (num_captures > 0) {
    if (num_captures < num_two_step) named.place.Fail("has more captures in its two-step motion than requested");
    scene.options.motion.num_captures = num_captures - num_two_step;
  }
  Variant variant;
  StudyCell& cell = variant.cell;
  cell.problem = scene.problem;
  cell.poses = scene.poses;
  for (const SceneTarget& target : scene.targets) {
    cell.targets.push_back({AllPoints(*target.target), target.target->Draw().y_up});
    variant.labels.num_points += cell.targets.back().points.size();
  }
  Outcome<CapturesOfCell> drawn = DrawCaptures(scene);
  if (!drawn) named.place.Fail(drawn.failure().ToString());
  cell.captures = std::move(drawn->captures);
  cell.robot = std::move(drawn->robot);
  cell.num_repeats = scene.num_repeats;
  cell.margin_px = scene.options.motion.margin_px;
  cell.gives_cameras = grid.give_camera.value_or(scene.give_camera);
  cell.options = grid.options;
  cell.estimators = grid.estimators;
  StudyLabels& labels = variant.labels;
  labels.scene = named.name;
  labels.num_captures = static_cast<int>(cell.captures.size());
  if (scene.setup) {
    labels.setup = *scene.setup;
  } else {
    labels.rig = Counted(scene.problem.cameras.size(), "camera") + ", " +
                 Counted(scene.problem.targets.size(), "target") + ", " + Counted(scene.problem.robots.size(), "arm");
  }
  return variant;
}

// Returns the cells of a scene with this many captures, one for each combination of the other values.
std::vector<Variant> CellsOf(const StudyGrid& grid, const NamedScene& named, int num_captures) {
  std::vector<Variant> variants = {CellOf(grid, named, num_captures)};
  variants = Varied(variants, grid.pixel_sigmas, [](Variant variant, double sigma_px) {
    variant.cell.pixel_sigma_px = variant.labels.pixel_sigma_px = sigma_px;
    return variant;
  });
  variants = Varied(variants, grid.robot_noises, [](Variant variant, const RobotNoise& noise) {
    variant.cell.robot_noise = variant.labels.robot_noise = noise;
    variant.cell.options.bundle.robot_noise = noise;
    return variant;
  });
  variants = Varied(variants, grid.target_shapes, [](Variant variant, const TargetShape& shape) {
    variant.cell.shape_params = variant.labels.shape_params = shape.params;
    return variant;
  });
  variants = Varied(variants, grid.outliers, [](Variant variant, double share) {
    variant.cell.outlier_points = variant.labels.outlier_points = share;
    return variant;
  });
  variants = Varied(variants, grid.wrongs, [](Variant variant, double share) {
    variant.cell.wrong_captures = variant.labels.wrong_captures = share;
    return variant;
  });
  variants = Varied(variants, grid.robot_models, [](Variant variant, const std::string& model) {
    variant.labels.robot_model = model;
    variant.cell.options.bundle.robot = RobotModel(model);
    variant.cell.options.choose.robot_noise = model == "auto";
    return variant;
  });
  variants = Varied(variants, grid.intrinsics, [](Variant variant, const std::vector<ParameterGroup>& groups) {
    variant.labels.free_intrinsics = groups;
    for (ProblemCamera& camera : variant.cell.problem.cameras) camera.free_intrinsics = groups;
    return variant;
  });
  if (variants.front().cell.robot) {
    const Arm& arm = named.scene.arms[0]->nominal;
    variants = Varied(variants, grid.kinematics, [&](Variant variant, const std::string& model) {
      const Kinematics kind = *FindValue<Kinematics>(kKinematicsNames, model);
      if (kind == Kinematics::kGravity && arm.load == nullptr) {
        named.place.Fail("has an arm whose links have no known masses, so that kinematics: gravity is not possible");
      }
      const std::vector<std::shared_ptr<const SharedEffects>> errors = CandidateArmErrors(arm, kind);
      variant.labels.kinematics = model;
      variant.cell.options.bundle.target_scale_sigma =
          AsMeasured(named.scene.targets[0].target->scale_sigma().value_or(kTargetScaleSigma));
      if (model == "auto") {
        variant.cell.options.choose.effects = errors;
      } else if (!errors.empty()) {
        variant.cell.options.bundle.effects = errors.front();
      }
      return variant;
    });
  }
  return variants;
}

// Refuses what a scene has and a study does not simulate.
void RefuseUnsimulated(const NamedScene& named) {
  const SceneConfig& scene = named.scene;
  if (!scene.camera_motions.empty() || !scene.camera_creeps.empty()) {
    const size_t camera =
        scene.camera_motions.empty() ? scene.camera_creeps.front().camera : scene.camera_motions.front().camera;
    const std::string& name = scene.problem.cameras[camera].name;
    named.place.Fail("moves " + (name.empty() ? "its camera" : "camera " + name) +
                     " during the captures, which a study does not simulate");
  }
}

// Refuses values that have no effect on the scenes.
void RefuseUnused(const StudyGrid& grid, const std::vector<NamedScene>& scenes, MapReader& reader) {
  const auto rig =
      std::find_if(scenes.begin(), scenes.end(), [](const NamedScene& named) { return !named.scene.setup; });
  if (rig == scenes.end()) {
    if (grid.estimators != StudyCell().estimators) {
      reader.Get("estimators").Fail("is for rigs; no scene has 'cameras' and 'targets'");
    }
    return;
  }
  const std::pair<const char*, bool> unused[] = {{"kinematics", grid.kinematics != std::vector<std::string>{"auto"}},
                                                 {"methods", !grid.options.methods.empty()},
                                                 {"start", grid.options.seed != kBestSeed}};
  for (const auto& [key, is_used] : unused) {
    if (is_used) reader.Get(key).Fail("is for scenes of one camera; scene " + Quoted(rig->name) + " is a rig");
  }
}

// Reads the values of all lists, and what all cells have in common.
StudyGrid ReadGrid(MapReader& reader) {
  StudyGrid grid;
  grid.pixel_sigmas = ReadList<double>(reader, "pixel_noise", {0.1}, ReadPixelSigma, PixelsNode);
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
  grid.options.choose.target_shape = reader.Choice("shape_model", {"none", "auto"}, "auto") == "auto";
  if (reader.Has("give_camera")) grid.give_camera = reader.Bool("give_camera", true);
  grid.estimators = ReadEstimators(reader);
  grid.options.methods = ReadMethods(reader);
  std::vector<std::string> seeds = HandEyeMethodNames();
  seeds.emplace_back(kBestSeed);
  grid.options.seed = reader.Choice("start", seeds, kBestSeed);
  grid.options.bundle.loss = *FindLossKind(reader.Choice("loss", LossNames(), "truncated"));
  grid.intrinsics = ReadIntrinsics(reader);
  return grid;
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
  const StudyGrid grid = ReadGrid(reader);
  study.output = ReadOutput(reader, std::filesystem::absolute(path).parent_path() / "studies" / study.name);
  reader.Finish();
  study.used = UsedText(reader);
  RefuseUnused(grid, scenes, reader);
  for (const NamedScene& named : scenes) RefuseUnsimulated(named);
  for (const NamedScene& named : scenes) {
    for (const int num_captures : grid.captures) {
      for (Variant& variant : CellsOf(grid, named, num_captures)) {
        study.cells.push_back(std::move(variant.cell));
        study.labels.push_back(std::move(variant.labels));
      }
    }
  }
  return study;
}

}  // namespace heba
