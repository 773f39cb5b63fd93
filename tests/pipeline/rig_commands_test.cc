// The commands of the program with rigs.
#include <cmath>
#include <filesystem>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heba/base/text.h"
#include "tests/pipeline/cli.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using Json = nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

constexpr int kNumCaptures = 12;
constexpr int kNumPoints = 35;  // Of each target.

// A cell with two fixed cameras and one on the gripper, a target on the gripper and one that stands beside the arm, and
// the run of it.
class RigCommandsTest : public testing::Test {
 protected:
  // Returns how often `part` occurs in a text.
  static int Count(const std::string& text, const std::string& part) {
    int count = 0;
    for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
    return count;
  }
  static void SetUpTestSuite() {
    folder_ = new fs::path(TestFolder("rig_commands"));
    WriteAll(
        *folder_ / "scene.yaml",
        "cameras:\n"
        "  left:\n    mount: world\n"
        "    pose: {translation: [500 mm, 600 mm, 700 mm], rpy: [-110 deg, 0 deg, 175 deg]}\n"
        "    camera: &camera {model: brown5, image_size: [640, 480], fx: 600, fy: 600, cx: 320, cy: 240, distortion: "
        "[-0.08, 0.05, 0, 0, 0]}\n"
        "  right:\n    mount: world\n"
        "    pose: {translation: [700 mm, 550 mm, 600 mm], rpy: [-105 deg, 0 deg, 165 deg]}\n    camera: *camera\n"
        "  wrist:\n    mount: gripper\n"
        "    pose: {translation: [60 mm, 0 mm, 40 mm], rpy: [5 deg, -5 deg, 90 deg]}\n    camera: *camera\n"
        "targets:\n"
        "  plate:\n    mount: gripper\n    pose: {translation: [0 mm, -50 mm, 80 mm], rpy: [90 deg, 0 deg, 0 deg]}\n"
        "    target: {type: charuco, rows: 6, columns: 8, square: 22 mm, marker: 16 mm, dictionary: DICT_4X4_250}\n"
        "  wall:\n    mount: world\n    pose: {translation: [900 mm, -400 mm, 200 mm], rpy: [180 deg, 0 deg, 0 deg]}\n"
        "    target: {type: charuco, rows: 6, columns: 8, square: 30 mm, marker: 22 mm, dictionary: DICT_4X4_250, "
        "first_marker: 100}\n"
        "motion: {captures: 12, distance: 600 mm, tilt: 30 deg}\nimage: {noise: 2 grey}\n"
        "robot_noise: {translation: 0.1 mm, rotation: 0.02 deg}\nseed: 2\n");
    const CommandResult simulated = RunHeba({"simulate", Path("scene.yaml"), "--out", Path("cell"), "--quiet"});
    ASSERT_EQ(simulated.status, 0) << simulated.err;
    const CommandResult run = RunHeba({"run", Path("cell/config.yaml"), "--out", Path("run"), "--quiet"});
    ASSERT_EQ(run.status, 0) << run.err;
  }
  static void TearDownTestSuite() { delete folder_; }
  static std::string Path(const std::string& name) { return (*folder_ / name).string(); }

  // Writes the config of the fixed camera `left` alone, under a name, runs it and returns the folder.
  static std::string RunOfLeft(const std::string& name) {
    WriteAll(Path(name + ".yaml"),
             "name: " + name +
                 "\nsetup: eye_to_hand\ntarget: cell/plate.target.yaml\ncamera: {intrinsics: cell/left.yaml}\n"
                 "captures: {images: cell/left, poses: cell/poses.csv, pose_format: ros}\n");
    const CommandResult run = RunHeba({"run", Path(name + ".yaml"), "--out", Path(name), "--quiet"});
    EXPECT_EQ(run.status, 0) << run.err;
    return Path(name);
  }

  static fs::path* folder_;
};
fs::path* RigCommandsTest::folder_ = nullptr;

TEST_F(RigCommandsTest, DetectSearchesEveryImageForEveryTarget) {
  const std::vector<std::string> arguments = {"detect", Path("cell/config.yaml"), "--out", Path("detected")};
  const CommandResult text = RunHeba(arguments);
  ASSERT_EQ(text.status, 0) << text.err;
  std::vector<std::string> with_json = arguments;
  with_json.emplace_back("--json");
  const CommandResult printed = RunHeba(with_json);
  ASSERT_EQ(printed.status, 0) << printed.err;
  const Json json = Json::parse(printed.out);
  EXPECT_EQ(json["schema"], "heba/detection_summary/1");
  EXPECT_EQ(json["captures"], 3 * kNumCaptures);
  EXPECT_TRUE(json["target_points"].is_null());
  EXPECT_TRUE(json["residuals"].is_null());
  ASSERT_EQ(json["cameras"].size(), 3U);
  // An entry for each target in each image; the text has a line for each.
  ASSERT_EQ(json["images"].size(), 3U * kNumCaptures * 2U);
  std::map<std::string, int> num_seen;
  for (const Json& image : json["images"]) {
    const std::string camera = image["camera"];
    const std::string target = image["target"];
    const int num_points = image["points"];
    EXPECT_EQ(image["target_points"], kNumPoints);
    EXPECT_EQ(image["detected"], num_points > 0);
    EXPECT_EQ(image["rms_px"].is_null(), num_points < 4);
    EXPECT_EQ(image["reason"] == "", num_points == kNumPoints);
    const std::string rms = image["rms_px"].is_null() ? "" : ", " + Significant(image["rms_px"], 3) + " px rms";
    EXPECT_THAT(text.out, HasSubstr(image["image"].get<std::string>() + ": " + target + " " +
                                    std::to_string(num_points) + " of 35 points" + rms));
    num_seen[camera + "." + target] += num_points > 0 ? 1 : 0;
  }
  // The cameras beside the arm see its plate, not the wall; the camera on the gripper sees both.
  EXPECT_GT(num_seen["left.plate"], 0);
  EXPECT_EQ(num_seen["left.wall"], 0);
  EXPECT_GT(num_seen["wrist.plate"], 0);
  EXPECT_GT(num_seen["wrist.wall"], 0);
  for (const Json& camera : json["cameras"]) {
    const std::string name = camera["camera"];
    EXPECT_EQ(camera["residuals"]["relative_to"], "given_camera");
    EXPECT_THAT(text.out, HasSubstr("camera " + name + ": a target was detected in " +
                                    std::to_string(camera["seen"].get<int>()) + " of 12 images"));
    for (int i = 0; i < kNumCaptures; ++i) {
      const std::string image = (i < 10 ? "00" : "0") + std::to_string(i) + ".png";
      EXPECT_TRUE(fs::exists(Path("detected/overlays/" + name + "/" + image + ".png"))) << name << " " << image;
    }
    for (const char* const target : {"plate", "wall"}) {
      const std::string file = "detections/" + name + "." + target + ".json";
      EXPECT_EQ(ReadAll(Path("detected/" + file)), ReadAll(Path("run/" + file)));
    }
  }
}

TEST_F(RigCommandsTest, DetectEstimatesACameraThatIsNotGiven) {
  const std::string config = ReadAll(Path("cell/config.yaml"));
  const size_t given = config.find("    intrinsics: wrist.yaml\n");
  ASSERT_NE(given, std::string::npos);
  WriteAll(Path("cell/not_given.yaml"), config.substr(0, given) + config.substr(config.find('\n', given) + 1));
  const CommandResult printed =
      RunHeba({"detect", Path("cell/not_given.yaml"), "--out", Path("estimated"), "--quiet", "--json"});
  ASSERT_EQ(printed.status, 0) << printed.err;
  const Json cameras = Json::parse(printed.out)["cameras"];
  EXPECT_EQ(cameras[0]["residuals"]["relative_to"], "given_camera");
  EXPECT_EQ(cameras[2]["residuals"]["relative_to"], "estimated_camera");
  EXPECT_EQ(cameras[2]["residuals"]["camera_model"], "brown5");
}

TEST_F(RigCommandsTest, DetectRefusesACameraOfAnotherSizeAndWritesNothing) {
  std::string camera = ReadAll(Path("cell/left.yaml"));
  const size_t size = camera.find("640");
  ASSERT_NE(size, std::string::npos);
  WriteAll(Path("cell/other_size.yaml"), camera.replace(size, 3, "641"));
  const CommandResult refused =
      RunHeba({"detect", Path("cell/config.yaml"), "--set", "cameras.left.intrinsics=" + Path("cell/other_size.yaml"),
               "--out", Path("refused"), "--quiet"});
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, AllOf(StartsWith("heba: error: "), HasSubstr("641 x 480"), HasSubstr("camera left")));
  EXPECT_FALSE(fs::exists(Path("refused")));
}

// The wrist has no constant pose in the base, so that its URDF is another one.
TEST_F(RigCommandsTest, ExportWritesAUrdfForEachRoot) {
  const CommandResult exported = RunHeba({"export", Path("run"), "--to", "urdf", "--out", Path("urdf")});
  ASSERT_EQ(exported.status, 0) << exported.err;
  for (const char* const file : {"left.camera.urdf", "cameras.base_link.urdf", "cameras.tool0.urdf"}) {
    const std::string text = ReadAll(Path(std::string("urdf/") + file));
    EXPECT_THAT(exported.out, HasSubstr(Path(std::string("urdf/") + file) + "\n"));
    EXPECT_THAT(text, HasSubstr("<robot name=\"config\">"));
    EXPECT_EQ(Count(text, "<link ") - Count(text, "<joint "), 1) << "links without a parent in " << file;
  }
  EXPECT_THAT(exported.out, HasSubstr("not cameras.urdf: a URDF has one root link"));
  EXPECT_FALSE(fs::exists(Path("urdf/cameras.urdf")));
  const std::string fragment = ReadAll(Path("urdf/cameras.urdf.xacro"));
  EXPECT_EQ(Count(fragment, "<link "), 3);
  EXPECT_EQ(Count(fragment, "<joint "), 3);
  const CommandResult printed = RunHeba({"export", Path("run"), "--to", "urdf"});
  EXPECT_EQ(printed.status, 0) << printed.err;
  EXPECT_EQ(printed.out, fragment);
}

// What the config leaves out has entries too.
TEST_F(RigCommandsTest, TheResultListsWhatWasLeftOut) {
  const CommandResult run = RunHeba({"run", Path("cell/config.yaml"), "--set", "captures.exclude=[001.png]", "--set",
                                     "evaluate.folds=0", "--out", Path("left_out")});
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_THAT(run.err, HasSubstr("config: 001.png: left out by captures.exclude"));
  std::vector<std::string> cameras;
  const Json result = Json::parse(ReadAll(Path("left_out/result.json")));
  for (const Json& entry : result["captures"]) {
    if (entry["capture"] != "001.png") continue;
    cameras.push_back(entry["camera"]);
    EXPECT_FALSE(entry["used"]);
    EXPECT_EQ(entry["reason"], "left out by captures.exclude");
  }
  EXPECT_THAT(cameras, testing::ElementsAre("left", "right", "wrist"));
  EXPECT_THAT(ReadAll(Path("left_out/report.html")), HasSubstr("left out by captures.exclude"));
}

TEST_F(RigCommandsTest, CompareMatchesCamerasAndTargetsByName) {
  const CommandResult fewer = RunHeba({"run", Path("cell/config.yaml"), "--set", "name=fewer", "--set",
                                       "captures.exclude=[001.png]", "--out", Path("fewer"), "--quiet"});
  ASSERT_EQ(fewer.status, 0) << fewer.err;
  const CommandResult compared = RunHeba({"compare", Path("run"), Path("fewer"), "--out", Path("comparison")});
  ASSERT_EQ(compared.status, 0) << compared.err;
  EXPECT_THAT(compared.out, HasSubstr("\nconfig and fewer\n"));
  const std::string pairs = ReadAll(Path("comparison/pairs.csv"));
  for (const char* const pose : {"camera,world,left", "camera,world,right", "camera,gripper,wrist",
                                 "camera_in_camera,left,right", "target,gripper,plate", "target,world,wall"}) {
    EXPECT_THAT(pairs, HasSubstr(std::string("\nconfig,fewer,") + pose + ","));
  }
  // The difference is that of the poses in both files.
  const auto pose_of = [](const std::string& run) {
    return Json::parse(ReadAll(Path(run + "/result.json")))["cameras"]["left"]["pose"]["translation_m"];
  };
  const Json first = pose_of("run");
  const Json second = pose_of("fewer");
  double square_m2 = 0;
  for (size_t i = 0; i < 3; ++i) square_m2 += std::pow(first[i].get<double>() - second[i].get<double>(), 2);
  const std::string line = pairs.substr(pairs.find("config,fewer,camera,world,left,"));
  EXPECT_NEAR(std::stod(Split(line, ',')[5]), 1000 * std::sqrt(square_m2), 1e-6);
  EXPECT_THAT(ReadAll(Path("comparison/compare.csv")), HasSubstr("\nfewer,wrist,"));
  EXPECT_TRUE(fs::exists(Path("comparison/compare.html")));
}

TEST_F(RigCommandsTest, CompareTakesTheRunOfOneCameraByItsName) {
  const CommandResult compared = RunHeba({"compare", Path("run"), RunOfLeft("left"), "--out", Path("beside")});
  ASSERT_EQ(compared.status, 0) << compared.err;
  EXPECT_THAT(ReadAll(Path("beside/pairs.csv")), HasSubstr("\nconfig,left,camera,world,left,"));
  const CommandResult refused = RunHeba({"compare", Path("run"), RunOfLeft("unknown"), "--out", Path("mixed")});
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, StartsWith("heba: error: unknown: is the run of one camera; a rig beside it needs"));
  EXPECT_FALSE(fs::exists(Path("mixed")));
}

// A batch of rigs, whose images are changed by a test, with one cache of detections.
class RigBatchTest : public RigCommandsTest {
 protected:
  RigBatchTest() {
    fs::remove_all(Path("batch"));
    fs::create_directories(Path("batch"));
    fs::copy(Path("cell"), Path("batch/cell"), fs::copy_options::recursive);
    WriteAll(Path("batch/free.yaml"), "base: cell/config.yaml\nevaluate: {folds: 2}\n");
    WriteAll(Path("batch/held.yaml"), "base: cell/config.yaml\nrefine: {intrinsics: []}\nevaluate: {folds: 2}\n");
  }

  static CommandResult RunBatch(const std::string& out, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = {
        "run", Path("batch/free.yaml"), Path("batch/held.yaml"), "--out", Path("batch/" + out), "--jobs", "2"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return RunHeba(arguments, "HEBA_CACHE=" + Path("cache"));
  }
  static std::string Stamp(const std::string& run) {
    const fs::path file = Path("batch/" + run + "/result.json");
    return fs::exists(file) ? std::to_string(fs::last_write_time(file).time_since_epoch().count()) : "none";
  }
};

TEST_F(RigBatchTest, ShardsTogetherGiveTheSameBytes) {
  const CommandResult whole = RunBatch("whole");
  ASSERT_EQ(whole.status, 0) << whole.err;
  const std::string csv = ReadAll(Path("batch/whole/summary.csv"));
  for (const char* const row : {"free,true,", "held,true,"}) {
    for (const char* const camera : {",left,refined,", ",right,refined,", ",wrist,refined,"}) {
      EXPECT_THAT(csv, testing::ContainsRegex("\n" + std::string(row) + "[^\n]*" + camera));
    }
  }
  for (const char* const shard : {"1/2", "0/2"}) {
    ASSERT_EQ(RunBatch("parts", {"--shard", shard}).status, 0) << shard;
    EXPECT_FALSE(fs::exists(Path("batch/parts/summary.csv")));
  }
  const std::string free = Stamp("parts/free");
  const CommandResult merged = RunBatch("parts", {"--resume"});
  ASSERT_EQ(merged.status, 0) << merged.err;
  EXPECT_THAT(merged.err, AllOf(HasSubstr("free: unchanged"), HasSubstr("held: unchanged")));
  EXPECT_EQ(Stamp("parts/free"), free);
  EXPECT_EQ(ReadAll(Path("batch/parts/summary.csv")), csv);
}

TEST_F(RigBatchTest, ResumeRunsOnlyWhatChanged) {
  ASSERT_EQ(RunBatch("out").status, 0);
  std::string free = Stamp("out/free");
  std::string held = Stamp("out/held");
  const auto expect_again = [&](bool is_free, bool is_held, const char* what) {
    const CommandResult again = RunBatch("out", {"--resume"});
    EXPECT_EQ(again.status, 0) << again.err;
    EXPECT_EQ(Stamp("out/free") != free, is_free) << what;
    EXPECT_EQ(Stamp("out/held") != held, is_held) << what;
    free = Stamp("out/free");
    held = Stamp("out/held");
  };
  expect_again(false, false, "nothing");
  WriteAll(Path("batch/free.yaml"), "base: cell/config.yaml\nevaluate: {folds: 3}\n");
  expect_again(true, false, "a config");
  // The second camera sees a capture again.
  fs::copy_file(Path("batch/cell/right/001.png"), Path("batch/cell/right/000.png"),
                fs::copy_options::overwrite_existing);
  expect_again(true, true, "an image");
  WriteAll(Path("batch/cell/right.yaml"), ReadAll(Path("batch/cell/right.yaml")) + "\n");
  expect_again(true, true, "a camera");
  WriteAll(Path("batch/cell/truth.json"), ReadAll(Path("batch/cell/truth.json")) + "\n");
  expect_again(true, true, "the truth");
  WriteAll(Path("batch/out/held/result.json"), "");
  held = Stamp("out/held");
  expect_again(false, true, "a damaged result");
}

// A finished rig is named by its folder or by its result.json.
TEST_F(RigCommandsTest, LocateTakesTheFileOfTheResult) {
  const std::string image = "wrist=" + Path("cell/wrist/000.png");
  const std::string row = ReadAll(Path("cell/poses.csv"));
  const std::string first = row.substr(row.find("000.png,") + 8);
  const std::string pose = "--pose=" + first.substr(0, first.find('\n'));
  const CommandResult of_folder = RunHeba({"locate", Path("run"), image, pose});
  EXPECT_EQ(of_folder.status, 0) << of_folder.err;
  EXPECT_THAT(of_folder.out, StartsWith("target plate in world, by wrist\n"));
  const CommandResult of_file = RunHeba({"locate", Path("run/result.json"), image, pose});
  EXPECT_EQ(of_file.status, 0) << of_file.err;
  EXPECT_EQ(of_file.out, of_folder.out);
  EXPECT_THAT(RunHeba({"locate", Path("run"), image}).err,
              HasSubstr("--pose: camera wrist is carried by the arm robot"));
}

}  // namespace
}  // namespace heba
