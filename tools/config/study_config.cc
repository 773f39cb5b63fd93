#include "tools/config/study_config.h"
#include "tools/config/common_keys.h"

#include <algorithm>
#include <limits>

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

// A cell under construction.
struct Variant {
  StudyCell cell;
  StudyLabels labels;
};

// Replaces each variant by as many as there are values, in their order, and sets one value in each.
template <class T, class Set>
void Vary(const std::vector<T>& values, std::vector<Variant>* variants, const Set& set) {
  std::vector<Variant> varied;
  for (const Variant& variant : *variants) {
    for (const T& value : values) {
      varied.push_back(variant);
      set(value, &varied.back());
    }
  }
  *variants = std::move(varied);
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
  const std::vector<double> pixel_sigmas = ReadList<double>(reader, "pixel_noise", {0.1}, read_pixel_sigma, PixelsNode);
  const std::vector<RobotNoise> robot_noises =
      ReadList<RobotNoise>(reader, "robot_noise", {RobotNoise{}}, ReadNoise, NoiseNode);
  std::vector<int> captures = ReadList<int>(
      reader, "captures", {},
      [](const ConfigValue& value) {
        return value.AsInt({3, 10000});
      },
      [](int num_captures) { return YAML::Node(num_captures); });
  if (captures.empty()) captures = {0};  // Each scene has as many as its motion states.
  const std::vector<double> outliers = ReadList<double>(reader, "outlier_points", {0.0}, ReadShare, ShareNode);
  const std::vector<double> wrongs = ReadList<double>(reader, "wrong_captures", {0.0}, ReadShare, ShareNode);
  const std::vector<std::string> robot_models = ReadList<std::string>(
      reader, "robot_model", {"auto"},
      [](const ConfigValue& value) {
        return value.AsChoice({"exact", "given", "estimated", "auto"});
      },
      [](const std::string& model) { return YAML::Node(model); });
  const std::vector<std::string> kinematics = ReadList<std::string>(
      reader, "kinematics", {"auto"},
      [](const ConfigValue& value) {
        return value.AsChoice({"none", "auto", "offsets", "geometry", "gravity"});
      },
      [](const std::string& model) { return YAML::Node(model); });
  const std::vector<TargetShape> target_shapes =
      ReadList<TargetShape>(reader, "target_shape", {TargetShape()}, ReadTrueShape, ShapeNode);
  const std::string shape_model = reader.Choice("shape_model", {"none", "auto"}, "auto");
  // If left out, each scene decides.
  std::optional<bool> give_camera;
  if (reader.Has("give_camera")) give_camera = reader.Bool("give_camera", true);
  CalibrationOptions options;
  options.methods = ReadMethods(reader);
  std::vector<std::string> seeds = HandEyeMethodNames();
  seeds.emplace_back(kBestSeed);
  options.seed = reader.Choice("start", seeds, kBestSeed);
  options.bundle.loss = *FindLossKind(reader.Choice("loss", LossNames(), "truncated"));
  options.bundle.free_intrinsics = ReadFreeIntrinsics(reader, {});
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

  for (const NamedScene& named : scenes) {
    for (const int num_captures : captures) {
      SceneConfig scene = named.scene;
      const int num_two_step = scene.two_step ? 3 + scene.two_step->num_turns : 0;
      if (num_captures > 0) {
        if (num_captures < num_two_step) named.place.Fail("has more captures in its two-step motion than requested");
        scene.motion.num_captures = num_captures - num_two_step;
      }
      Rng rng(scene.seed);
      StudyCell cell;
      cell.camera = scene.camera;
      cell.hand_eye = scene.hand_eye;
      cell.target = AllPoints(*scene.target);
      if (scene.arm) {
        const std::optional<Failure> failure = SetUpStudyRobot(scene, &rng, &cell);
        if (failure) named.place.Fail(failure->reason);
      } else {
        const Outcome<std::vector<SimulatedPose>> poses = SimulateScenePoses(scene, &rng);
        if (!poses) named.place.Fail(poses.reason());
        cell.poses = *poses;
      }
      cell.options = options;
      cell.options.setup = scene.setup;
      cell.num_repeats = scene.num_repeats;
      cell.options.symmetries = {Rigid3d()};
      cell.options.camera_model = scene.camera.model;
      cell.options.width_px = scene.camera.width_px;
      cell.options.height_px = scene.camera.height_px;
      if (give_camera.value_or(scene.give_camera)) cell.options.camera = scene.camera;
      cell.options.choose.target_shape = shape_model == "auto";
      cell.options.shape = DesignedShape(cell.target.points_in_target);
      cell.shape = cell.options.shape;
      std::vector<Variant> variants = {{cell, {}}};
      StudyLabels& labels = variants.front().labels;
      labels.scene = named.name;
      labels.setup = scene.setup;
      labels.num_captures = static_cast<int>(cell.poses.size());
      labels.num_points = cell.target.size();
      Vary(pixel_sigmas, &variants, [](double sigma_px, Variant* variant) {
        variant->cell.pixel_sigma_px = variant->labels.pixel_sigma_px = sigma_px;
      });
      Vary(robot_noises, &variants, [](const RobotNoise& noise, Variant* variant) {
        variant->cell.robot_noise = variant->labels.robot_noise = noise;
        variant->cell.options.bundle.robot_noise = noise;
      });
      Vary(target_shapes, &variants, [](const TargetShape& shape, Variant* variant) {
        variant->cell.shape.params = variant->labels.shape_params = shape.params;
      });
      Vary(outliers, &variants, [](double share, Variant* variant) {
        variant->cell.outlier_points = variant->labels.outlier_points = share;
      });
      Vary(wrongs, &variants, [](double share, Variant* variant) {
        variant->cell.wrong_captures = variant->labels.wrong_captures = share;
      });
      Vary(robot_models, &variants, [](const std::string& model, Variant* variant) {
        variant->labels.robot_model = model;
        variant->cell.options.bundle.robot = RobotModel(model);
        variant->cell.options.choose.robot_noise = model == "auto";
      });
      if (scene.arm) {
        Vary(kinematics, &variants, [&](const std::string& model, Variant* variant) {
          const Kinematics kind = *FindValue<Kinematics>(kKinematicsNames, model);
          if (kind == Kinematics::kGravity && scene.arm->nominal.load == nullptr) {
            named.place.Fail(
                "has an arm whose links have no known masses, so that kinematics: gravity is not possible");
          }
          const std::vector<std::shared_ptr<const SharedEffects>> errors =
              CandidateArmErrors(scene.arm->nominal, kind, variant->cell.poses.size());
          variant->labels.kinematics = model;
          variant->cell.options.bundle.target_scale_sigma = kPrintScaleSigma;
          if (model == "auto") {
            variant->cell.options.choose.effects = errors;
          } else if (!errors.empty()) {
            variant->cell.options.bundle.effects = errors.front();
          }
        });
      }
      for (Variant& variant : variants) {
        study.cells.push_back(std::move(variant.cell));
        study.labels.push_back(std::move(variant.labels));
      }
    }
  }
  return study;
}

}  // namespace heba
