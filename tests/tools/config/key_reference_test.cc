// The table of keys agrees with the readers: what is known here is what a reader names when it meets an unknown key.
#include "tools/config/key_reference.h"

#include <fstream>
#include <functional>
#include <iterator>
#include <map>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/config/yaml_reader.h"
#include "heba/io/camera_file.h"
#include "heba/io/pose_formats.h"
#include "heba/target.h"
#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"
#include "tools/config/commented_config.h"
#include "tools/config/run_config.h"
#include "tools/config/scene_config.h"
#include "tools/config/study_config.h"

namespace heba {
namespace {
using ::testing::HasSubstr;

using Names = std::set<std::string>;

// Returns the keys of the table directly within a mapping of a document.
Names KeysOfTable(std::string_view document, const std::string& mapping) {
  Names names;
  const std::string prefix = mapping.empty() ? "" : mapping + ".";
  for (const KeyEntry& entry : KeyEntries()) {
    if (entry.document != document || !entry.key.starts_with(prefix)) continue;
    std::string name = entry.key.substr(prefix.size());
    name = name.substr(0, name.find('.'));
    names.insert(name.substr(0, name.find('[')));
  }
  return names;
}

// Returns the keys that a reader knows where it finds the key `unknown_key`.
Names KeysOfReader(const std::function<void()>& read) {
  const std::string error = InputErrorOf(read);
  EXPECT_THAT(error, HasSubstr("unknown key 'unknown_key'"));
  const std::string before = "known here: ";
  const size_t found = error.find(before);
  if (found == std::string::npos) return {};
  Names names;
  for (const std::string& name : Split(error.substr(found + before.size()), ',')) names.insert(Trim(name));
  return names;
}

// Each type of target with its required keys, and those that only have a meaning with another.
const std::pair<std::string, std::string> kTargets[] = {
    {"coded_board", "rows: 6, columns: 7, spacing: 30 mm"},
    {"apriltag_grid", "family: tag36h11, rows: 2, columns: 3, tag_size: 40 mm"},
    {"chessboard", "rows: 6, columns: 7, square: 30 mm"},
    {"charuco", "rows: 6, columns: 7, square: 30 mm, marker: 20 mm, dictionary: DICT_5X5_100"},
    {"circle_grid", "rows: 6, columns: 7, spacing: 30 mm, marker_dot: true"}};

class KeyReferenceTest : public testing::Test {
 protected:
  KeyReferenceTest() {
    std::filesystem::create_directory(folder_ / "images");
    Write("images/a.png", "x");
    Write("images/b.png", "x");
    Write("poses.csv", "image,x,y,z,qx,qy,qz,qw\na.png,0,0,1,0,0,0,1\nb.png,0.1,0,1,0,0,0,1\n");
    Write("cell.yaml",
          "setup: eye_in_hand\n"
          "target: {type: chessboard, rows: 5, columns: 8, square: 20 mm}\n"
          "robot: {model: ur5e}\n"
          "captures: {images: images, poses: poses.csv, pose_format: ros}\n");
    Write("scene.yaml", kScene);
    Write("rig.yaml",
          "cameras: {NAME: {mount: world, images: images}}\n"
          "targets: {NAME: {mount: gripper, target: {type: chessboard, rows: 5, columns: 8, square: 20 mm}}}\n"
          "captures: {poses: poses.csv}\n");
    Write(
        "rig_scene.yaml",
        "cameras: {NAME: {mount: world, pose: {translation: [1 m, 0 m, 0.5 m]}, camera: {model: pinhole, "
        "image_size: [640, 480], fx: 600, fy: 600, cx: 320, cy: 240}}}\n"
        "targets: {NAME: {mount: gripper, pose: {translation: [0 m, 0 m, 0.1 m]}, target: {type: chessboard, rows: 5, "
        "columns: 8, square: 20 mm}}}\n");
    Write("joints.csv", "image,j1,j2,j3,j4,j5,j6\na.png,0,0,1,0,1,0\nb.png,0,0,1,0,1,1\n");
    Write("arm.urdf", R"(<?xml version="1.0"?>
<robot name="arm"><link name="base"/><link name="tip"/>
<joint name="a" type="continuous"><parent link="base"/><child link="tip"/><origin xyz="0 0 1"/><axis xyz="0 0 1"/></joint>
</robot>)");
    Write("angles.csv", "image,a\na.png,0\nb.png,1\n");
    Write("traj.txt", "1 0 0 1 0 0 0 1\n2 0.1 0 1 0 0 0 1\n");
  }
  void Write(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }

  // Compares a mapping of the config with what its reader knows under any of these settings.
  void ExpectConfigKeys(const std::string& mapping, const std::vector<std::vector<std::string>>& variants,
                        const std::string& unknown) const {
    Names known;
    for (std::vector<std::string> settings : variants) {
      settings.push_back(unknown);
      known.merge(KeysOfReader([&] { ReadShortRunConfig(folder_ / "cell.yaml", settings); }));
    }
    EXPECT_EQ(known, KeysOfTable("config", mapping)) << mapping;
  }
  void ExpectSceneKeys(const std::string& mapping, const std::vector<std::string>& settings = {}) const {
    std::vector<std::string> all = settings;
    all.push_back((mapping.empty() ? "" : mapping + ".") + std::string("unknown_key=1"));
    const Names known = KeysOfReader([&] { ReadSceneConfig(folder_ / "scene.yaml", all); });
    EXPECT_EQ(known, KeysOfTable("scene", mapping)) << mapping;
  }
  Names StudyKeys(const std::string& more) const {
    Write("study.yaml", "scenes: {one: scene.yaml}\n" + more);
    return KeysOfReader([&] { ReadStudyConfig(folder_ / "study.yaml"); });
  }

  static constexpr const char* kScene =
      "setup: eye_to_hand\n"
      "target: {type: chessboard, rows: 5, columns: 8, square: 20 mm}\n"
      "camera: {model: pinhole, image_size: [640, 480], fx: 600, fy: 600, cx: 320, cy: 240}\n"
      "hand_eye: {translation: [1 m, 0 m, 0.5 m]}\n"
      "board: {translation: [0 m, 0 m, 0.1 m]}\n";
  TempFolder folder_;
};

TEST_F(KeyReferenceTest, ConfigHasTheKeysOfItsReader) {
  // `base` is taken from the file before its keys are read.
  Names top = KeysOfReader([&] { ReadShortRunConfig(folder_ / "cell.yaml", {"unknown_key=1"}); });
  top.insert("base");
  EXPECT_EQ(top, KeysOfTable("config", ""));
  ExpectConfigKeys("camera", {{}}, "camera.unknown_key=1");
  const std::string folder = (folder_ / "").string();
  ExpectConfigKeys("captures",
                   {{},
                    {"captures.pose_format=joints", "captures.robot=" + folder + "arm.urdf",
                     "captures.poses=" + folder + "angles.csv"},
                    {"captures.images=", "captures.data=" + folder + "traj.txt", "captures.format=tum"},
                    {"captures.joints=" + folder + "joints.csv"}},
                   "captures.unknown_key=1");
  ExpectConfigKeys("robot", {{}, {"robot.model=" + folder + "arm.urdf"}}, "robot.unknown_key=1");
  ExpectConfigKeys("robot.payload", {{"robot.payload={mass: 1 kg, centre: [0 mm, 0 mm, 0 mm]}"}},
                   "robot.payload.unknown_key=1");
  ExpectConfigKeys("refine", {{}}, "refine.unknown_key=1");
  ExpectConfigKeys("refine.robot_noise", {{"refine.robot_noise={translation: 1 mm, rotation: 1 deg}"}},
                   "refine.robot_noise.unknown_key=1");
  ExpectConfigKeys("evaluate", {{}}, "evaluate.unknown_key=1");
  ExpectConfigKeys("evaluate.require[]", {{}}, "evaluate.require=[{within: 1 mm, unknown_key: 1}]");
}

TEST_F(KeyReferenceTest, RigHasTheKeysOfItsReader) {
  const auto known = [&](const std::vector<std::string>& settings) {
    return KeysOfReader([&] { ReadRunConfig(folder_ / "rig.yaml", settings); });
  };
  Names top = known({"unknown_key=1"});
  top.insert("base");
  // The message about one camera's keys, and the arms, are known to the reader as well.
  for (const char* key : {"target", "camera", "setup"}) top.erase(key);
  EXPECT_EQ(top, KeysOfTable("rig", ""));
  EXPECT_EQ(known({"cameras.NAME.unknown_key=1"}), KeysOfTable("rig", "cameras.NAME"));
  EXPECT_EQ(known({"targets.NAME.unknown_key=1"}), KeysOfTable("rig", "targets.NAME"));
  EXPECT_EQ(known({"refine.unknown_key=1"}), KeysOfTable("rig", "refine"));
  EXPECT_EQ(known({"evaluate.unknown_key=1"}), KeysOfTable("rig", "evaluate"));
  EXPECT_EQ(known({"evaluate.require=[{within: 1 mm, unknown_key: 1}]"}), KeysOfTable("rig", "evaluate.require[]"));
  EXPECT_EQ(known({"cameras.NAME.refine.unknown_key=1"}), KeysOfTable("rig", "cameras.NAME.refine"));
  const std::string folder = (folder_ / "").string();
  Names of_arm = known({"robots.NAME.poses=" + folder + "poses.csv", "robots.NAME.model=ur5e",
                        "robots.NAME.joints=" + folder + "joints.csv", "robots.NAME.unknown_key=1"});
  for (const std::string& key : KeysOfTable("rig", "robots.NAME")) EXPECT_TRUE(of_arm.contains(key)) << key;
  Names of_captures = known({"captures.unknown_key=1"});
  for (const std::string& key : KeysOfTable("rig", "captures")) EXPECT_TRUE(of_captures.contains(key)) << key;
}

TEST_F(KeyReferenceTest, RigSceneHasTheKeysOfItsReader) {
  const auto known = [&](const std::vector<std::string>& settings) {
    return KeysOfReader([&] { ReadSceneConfig(folder_ / "rig_scene.yaml", settings); });
  };
  Names top = known({"unknown_key=1"});
  top.insert("base");
  EXPECT_EQ(top, KeysOfTable("rig_scene", ""));
  EXPECT_EQ(known({"cameras.NAME.unknown_key=1"}), KeysOfTable("rig_scene", "cameras.NAME"));
  EXPECT_EQ(known({"targets.NAME.unknown_key=1"}), KeysOfTable("rig_scene", "targets.NAME"));
  EXPECT_EQ(known({"robots.first={}", "robots.NAME.unknown_key=1",
                   "robots.NAME.world_from_base={translation: [1 m, 0 m, 0 m]}", "cameras.NAME.mount=first.base",
                   "targets.NAME.mount=first.gripper"}),
            KeysOfTable("rig_scene", "robots.NAME"));
}

TEST_F(KeyReferenceTest, SceneHasTheKeysOfItsReader) {
  Names top = KeysOfReader([&] { ReadSceneConfig(folder_ / "scene.yaml", {"unknown_key=1"}); });
  top.insert("base");
  EXPECT_EQ(top, KeysOfTable("scene", ""));
  for (const char* mapping : {"motion", "image", "print", "robot_noise"}) ExpectSceneKeys(mapping);
  ExpectSceneKeys("motion.two_step");
  ExpectSceneKeys("robot", {"robot.model=ur5e"});
}

TEST_F(KeyReferenceTest, StudyHasTheKeysOfItsReader) {
  EXPECT_EQ(StudyKeys("unknown_key: 1\n"), KeysOfTable("study", ""));
  EXPECT_EQ(StudyKeys("robot_noise: {translation: 1 mm, rotation: 1 deg, unknown_key: 1}\n"),
            KeysOfTable("study", "robot_noise[]"));
  EXPECT_EQ(StudyKeys("target_shape: {unknown_key: 1}\n"), KeysOfTable("study", "target_shape[]"));
}

TEST_F(KeyReferenceTest, TargetsHaveTheKeysOfTheirReaders) {
  EXPECT_EQ(std::size(kTargets), TargetTypeNames().size());
  for (const auto& [type, keys] : kTargets) {
    const std::string text = "{type: " + type + ", " + keys + ", unknown_key: 1}";
    Names known = KeysOfReader([&] { ParseTarget(text); });
    EXPECT_EQ(known.erase("type"), 1U);
    EXPECT_EQ(known.erase("scale_sigma"), 1U);
    known.erase("target_type");  // The type in Kalibr's files, whose keys are others.
    EXPECT_EQ(known, KeysOfTable("targets", type)) << type;
  }
}

TEST_F(KeyReferenceTest, CameraAndPosesHaveTheKeysOfTheirReaders) {
  const std::string camera =
      "{model: brown4, image_size: [640, 480], fx: 1, fy: 1, cx: 1, cy: 1, distortion: [0, 0, 0, 0], unknown_key: 1}";
  EXPECT_EQ(KeysOfReader([&] { ReadCamera(ParseYaml(camera, "camera")); }), KeysOfTable("camera", ""));
  const std::string format =
      "{columns: [x, y, z, a, b, c], translation: mm, rotation: euler_zyx, angle: deg, unknown_key: 1}";
  EXPECT_EQ(KeysOfReader([&] { ReadPoseFormat(ParseYaml(format, "format")); }), KeysOfTable("poses", ""));
}

// Expects that a value as used is the one that the table states. A quantity may be shown in another unit.
void ExpectSameValue(const YAML::Node& used, const YAML::Node& stated, const std::string& key) {
  ASSERT_EQ(used.IsSequence(), stated.IsSequence()) << key;
  if (stated.IsSequence()) {
    ASSERT_EQ(used.size(), stated.size()) << key;
    for (size_t i = 0; i < stated.size(); ++i) ExpectSameValue(used[i], stated[i], key);
    return;
  }
  const std::vector<std::string> words = Split(stated.Scalar(), ' ');
  double expected = 0;
  if (!ParseDouble(words[0], &expected)) {
    EXPECT_EQ(used.Scalar(), stated.Scalar()) << key;
    return;
  }
  double actual = 0;
  if (words.size() == 1) {
    EXPECT_TRUE(ParseDouble(used.Scalar(), &actual)) << key;
  } else {
    const std::map<std::string, Quantity> kinds = {{"mm", Quantity::kLength},
                                                   {"deg", Quantity::kAngle},
                                                   {"rad", Quantity::kAngle},
                                                   {"px", Quantity::kPixels},
                                                   {"grey", Quantity::kGreyLevels}};
    ASSERT_EQ(kinds.count(words[1]), 1U) << key;
    expected = ParseQuantity(stated.Scalar(), kinds.at(words[1])).value;
    actual = ParseQuantity(used.Scalar(), kinds.at(words[1])).value;
  }
  EXPECT_NEAR(actual, expected, 1e-12) << key;
}

// Compares each default of a document that is a value with that of a file as used, whose keys begin with `prefix` in
// the table, and erases the keys from `left`. Keys that the file does not show are left.
void ExpectDefaults(std::string_view document, const YAML::Node& used, Names* left, const std::string& prefix = "") {
  for (const KeyEntry& entry : KeyEntries()) {
    const std::string key = std::string(document) + " " + entry.key;
    if (entry.document != document || !entry.key.starts_with(prefix) || left->count(key) == 0) continue;
    YAML::Node node;
    node.reset(used);
    for (const std::string& name : Split(entry.key.substr(prefix.size()), '.')) {
      if (node.IsMap()) node.reset(node[name.substr(0, name.find('['))]);
      if (node.IsSequence() && name.ends_with("[]")) node.reset(node[0]);
    }
    if (!node.IsDefined() || node.IsMap() || node.IsNull() || entry.is_described) continue;
    const YAML::Node stated = YAML::Load(entry.fallback);
    // A study lists even one value.
    if (document == "study" && node.IsSequence() && !stated.IsSequence()) node.reset(node[0]);
    ExpectSameValue(node, stated, key);
    left->erase(key);
  }
}

TEST_F(KeyReferenceTest, DefaultsAreThoseOfTheReaders) {
  Names left;
  for (const KeyEntry& entry : KeyEntries()) {
    if (entry.HasDefault()) left.insert(std::string(entry.document) + " " + entry.key);
  }
  const std::string folder = (folder_ / "").string();
  const RunConfig config = ReadShortRunConfig(folder_ / "cell.yaml", {"evaluate.require=[{within: 1 mm}]"});
  ExpectDefaults("config", YAML::Load(config.used), &left);
  for (const std::vector<std::string>& settings :
       {std::vector<std::string>{"captures.pose_format=joints", "captures.robot=" + folder + "arm.urdf",
                                 "captures.poses=" + folder + "angles.csv"},
        {"captures.pose_format="},
        {"captures.joints=" + folder + "joints.csv"}}) {
    ExpectDefaults("config", YAML::Load(ReadShortRunConfig(folder_ / "cell.yaml", settings).used), &left);
  }
  // The config as used states what is required, but not the probability that it omits.
  EXPECT_EQ(config.options.requirements.at(0).confidence, 0.95);
  EXPECT_EQ(left.erase("config evaluate.require[].confidence"), 1U);
  ExpectDefaults("scene", ReadSceneConfig(folder_ / "scene.yaml", {"motion.two_step={}", "robot.model=ur5e"}).used,
                 &left);
  Write("study.yaml", "scenes: {one: scene.yaml}\ntarget_shape: [{}]\n");
  ExpectDefaults("study", YAML::Load(ReadStudyConfig(folder_ / "study.yaml").used), &left);
  const auto expect_target_defaults = [&](const std::string& type, const std::string& keys) {
    MapReader reader(ParseYaml("{type: " + type + ", " + keys + "}", "target"));
    CreateTarget(reader);
    ExpectDefaults("targets", reader.used(), &left, type + ".");
  };
  expect_target_defaults("circle_grid", "rows: 6, columns: 7, spacing: 30 mm");
  for (const auto& [type, keys] : kTargets) expect_target_defaults(type, keys);
  const RunConfig rig = ReadRunConfig(
      folder_ / "rig.yaml", {"captures=", "robots.NAME.poses=" + folder + "poses.csv", "robots.NAME.model=ur5e",
                             "robots.NAME.joints=" + folder + "joints.csv", "evaluate.require=[{within: 1 mm}]"});
  ExpectDefaults("rig", YAML::Load(rig.used), &left);
  EXPECT_EQ(rig.options.requirements.at(0).confidence, 0.95);
  EXPECT_EQ(left.erase("rig evaluate.require[].confidence"), 1U);
  ExpectDefaults("rig_scene", ReadSceneConfig(folder_ / "rig_scene.yaml").used, &left);
  // Words for values that depend on something else.
  Names described;
  for (const KeyEntry& entry : KeyEntries()) {
    if (entry.is_described) described.insert(std::string(entry.document) + " " + entry.key);
  }
  for (const std::string& key : described) EXPECT_EQ(left.erase(key), 1U) << key;
  // The data set that is found is recorded, and a format with the units.
  EXPECT_EQ(left, (Names{"config captures.format", "config captures.units"}));
}

// What is a comment in a new config can be used as it stands there.
TEST_F(KeyReferenceTest, CommentsOfANewConfigCanBeRead) {
  Write("target.yaml", "{type: chessboard, rows: 5, columns: 8, square: 20 mm}");
  Write("camera.yaml", "{model: pinhole, image_size: [640, 480], fx: 600, fy: 600, cx: 320, cy: 240}");
  Write("images/000.png", "x");
  Write("poses.csv", "image,x,y,z,qx,qy,qz,qw\n000.png,0,0,1,0,0,0,1\na.png,0,0,1,0,0,0,1\nb.png,0.1,0,1,0,0,0,1\n");
  std::string text;
  Names names;
  for (const KeyEntry& entry : KeyEntries()) {
    if (entry.document == "config") names.merge(KeysOfTable("config", entry.key.substr(0, entry.key.find('.'))));
  }
  names.merge(KeysOfTable("config", ""));
  int num_keys = 0;
  for (const std::string& line : Split(CommentedConfig({}, {}), '\n')) {
    const size_t begin = line.find("# ");
    const size_t end = line.find(": ", begin + 2);
    const bool is_key = begin != std::string::npos && end != std::string::npos &&
                        names.count(line.substr(begin + 2, end - begin - 2)) > 0;
    num_keys += is_key ? 1 : 0;
    text += (is_key ? line.substr(0, begin) + line.substr(begin + 2) : line) + "\n";
  }
  EXPECT_EQ(num_keys, 15);
  Write("new.yaml", text);
  const RunConfig config = ReadShortRunConfig(folder_ / "new.yaml");
  EXPECT_EQ(config.data.captures.size(), 2U);  // One is excluded.
  EXPECT_EQ(config.output, folder_ / "runs/cell");
}

TEST_F(KeyReferenceTest, OneKeyOrMappingIsPrinted) {
  const KeyDocument& config = *FindEntry(KeyDocuments(), "config");
  EXPECT_THAT(KeysAsText(config, "refine.loss"), testing::StartsWith("refine:\n  loss: none | huber"));
  EXPECT_THAT(KeysAsText(config, "refine"), HasSubstr("robot_noise"));
  EXPECT_THAT(KeysAsText(config, "refine"), testing::Not(HasSubstr("folds")));
  EXPECT_THAT(InputErrorOf([&] { KeysAsText(config, "refine.los"); }), HasSubstr("did you mean 'refine.loss'?"));
  EXPECT_THAT(KeysAsMarkdown(), HasSubstr("| `loss` | none \\| huber"));
}

}  // namespace
}  // namespace heba
