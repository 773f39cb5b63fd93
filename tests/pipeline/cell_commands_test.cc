// The commands of the program with rigs.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "tests/pipeline/cli.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using Json = nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

constexpr int kNumCaptures = 12;
constexpr int kNumPoints = 35;  // Each target has as many.

// A cell with two fixed cameras and one on the gripper, a target on the gripper and one that stands beside the arm, and
// the run of it.
class CellCommandsTest : public testing::Test {
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
fs::path* CellCommandsTest::folder_ = nullptr;

TEST_F(CellCommandsTest, DetectSearchesEveryImageForEveryTarget) {
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
      EXPECT_TRUE(fs::exists(Path("detected/overlays/" + name + "/" + image))) << name << " " << image;
    }
    for (const char* const target : {"plate", "wall"}) {
      const std::string file = "detections/" + name + "." + target + ".json";
      EXPECT_EQ(ReadAll(Path("detected/" + file)), ReadAll(Path("run/" + file)));
    }
  }
}

// Returns the number after `before` in a text, from the position of `from` on.
double NumberAfter(const std::string& text, const std::string& from, const std::string& before) {
  const size_t begin = text.find(before, text.find(from));
  EXPECT_NE(begin, std::string::npos) << from << before;
  return begin == std::string::npos ? std::nan("") : std::stod(text.substr(begin + before.size()));
}

// The errors of the arm are not residuals of the images: what remains after its corrections is the noise of the pixels.
TEST_F(CellCommandsTest, ReportComparesTheNoiseWithWhatTheCorrectionsLeave) {
  const std::string page = ReadAll(Path("run/report.html"));
  const Json cameras = Json::parse(ReadAll(Path("run/result.json")))["cameras"];
  for (const char* const name : {"left", "right", "wrist"}) {
    const std::string heading = std::string("<h2>Camera ") + name + "</h2>";
    const double corrected_px = NumberAfter(page, heading, "The RMS of the residuals is ");
    const double reported_px = NumberAfter(page, heading, "after the corrections of the arms, and ");
    const double noise_px = NumberAfter(page, heading, "the pixel noise is ");
    EXPECT_NEAR(corrected_px / (std::sqrt(2.0) * noise_px), 1, 0.3) << name;
    EXPECT_GT(reported_px, 5 * corrected_px) << name;
  }
}

// The influence of a capture is stated for each camera that uses its image.
TEST_F(CellCommandsTest, StatesTheInfluenceOfEachCapture) {
  const Json result = Json::parse(ReadAll(Path("run/result.json")));
  int num_used = 0;
  for (const Json& image : result["captures"]) {
    EXPECT_EQ(image["move_without"].is_object(), image["used"].get<bool>()) << image;
    if (!image["used"].get<bool>()) continue;
    ++num_used;
    EXPECT_GE(image["move_without"]["chance"].get<double>(), 0);
    EXPECT_LE(image["move_without"]["chance"].get<double>(), 1);
  }
  EXPECT_GT(num_used, 20);
  EXPECT_THAT(ReadAll(Path("run/report.html")), HasSubstr("result changes without it, mm"));
}

TEST_F(CellCommandsTest, ReportHasTheNextStepsAndTheCorrelation) {
  const std::string page = ReadAll(Path("run/report.html"));
  EXPECT_THAT(page, HasSubstr("Next steps"));
  EXPECT_THAT(page, HasSubstr("heba export " + Path("run") + " --to ros2"));
  EXPECT_THAT(page, HasSubstr("heba locate " + Path("run") + " left=IMAGE right=IMAGE wrist=IMAGE --pose NUMBERS"));
  EXPECT_THAT(page, HasSubstr("Parameter correlation"));
  EXPECT_THAT(page, HasSubstr("cameras.left.pose"));
}

// The report of a rig has what that of a single camera has: the figures in tiles, the poses in notations to copy, the
// ellipses, and a table whose rows open the images.
TEST_F(CellCommandsTest, ReportHasWhatThatOfASingleCameraHas) {
  const std::string page = ReadAll(Path("run/report.html"));
  const Json result = Json::parse(ReadAll(Path("run/result.json")));
  double worst_mm = 0;
  for (const Json& errors : result["errors"]) {
    worst_mm = std::max(worst_mm, errors["holdout_target_mm"].get<double>());
  }
  EXPECT_NEAR(NumberAfter(page, "hold-out error at the target, ", "<dd>") / worst_mm, 1, 0.01);
  EXPECT_THAT(page, HasSubstr("<h3><code>gripper_from_wrist</code></h3>"));
  EXPECT_EQ(Count(page, "data-view=\"ellipses\""), 3);
  EXPECT_THAT(page, HasSubstr("<tr data-from=\"captures_2\" data-capture=\"1\">"));
  EXPECT_THAT(page, HasSubstr("<button>robot correction, mm</button>"));
}

TEST_F(CellCommandsTest, ReportHasTheIntrinsicsAndAllTrueErrors) {
  const std::string page = ReadAll(Path("run/report.html"));
  const Json result = Json::parse(ReadAll(Path("run/result.json")));
  const Json truth = Json::parse(ReadAll(Path("cell/truth.json")));
  const auto error_mm = [&](const char* kind, const char* name) {
    double square_m2 = 0;
    for (size_t i = 0; i < 3; ++i) {
      const auto of = [&](const Json& json) { return json[kind][name]["pose"]["translation_m"][i].get<double>(); };
      square_m2 += std::pow(of(result) - of(truth), 2);
    }
    return 1000 * std::sqrt(square_m2);
  };
  EXPECT_NEAR(NumberAfter(page, ">camera wrist in gripper</td>", "\"true error, mm\">") / error_mm("cameras", "wrist"),
              1, 0.01);
  EXPECT_NEAR(NumberAfter(page, ">target wall in world</td>", "\"true error, mm\">") / error_mm("targets", "wall"), 1,
              0.01);
  EXPECT_THAT(page, HasSubstr("<h3>left: brown5, 640 x 480 px</h3>"));
  // Each column has a heading.
  EXPECT_THAT(page, HasSubstr("<button>status</button>"));
}

TEST_F(CellCommandsTest, SimulateRefusesARedundantArm) {
  const CommandResult simulated = RunHeba(
      {"simulate", Path("scene.yaml"), "--out", Path("redundant"), "--quiet", "--set", "robot.model=franka_fr3"});
  EXPECT_EQ(simulated.status, 2);
  EXPECT_THAT(simulated.err, HasSubstr("robot.model: a redundant arm reaches a pose in infinitely many ways"));
}

// An arm that has errors of its own: they are estimated, or the reason why not is stated.
TEST_F(CellCommandsTest, RunStatesTheErrorsOfAnArm) {
  WriteAll(*folder_ / "arm.yaml",
           "base: scene.yaml\nrobot: {model: ur10e, offsets: 0.1 deg, lengths: 1 mm, angles: 0.1 deg, configurations: "
           "one, record_joints: true}\nrobot_noise: {translation: 0.02 mm, rotation: 0.004 deg}\n");
  ASSERT_EQ(RunHeba({"simulate", Path("arm.yaml"), "--out", Path("arm"), "--quiet"}).status, 0);
  const CommandResult run =
      RunHeba({"run", Path("arm/config.yaml"), "--out", Path("arm_run"), "--set", "evaluate.folds=0"});
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_EQ(Count(run.out, "\narm robot: the kinematics of the arm ur10e were estimated ("), 1) << run.out;
  const std::string page = ReadAll(*folder_ / "arm_run/report.html");
  const std::string section = page.substr(page.find("<h2>Kinematics of arm robot</h2>"));
  EXPECT_THAT(section.substr(0, 1000), HasSubstr("The kinematics of the arm ur10e were estimated ("));
  EXPECT_THAT(section, AllOf(HasSubstr("data-view=\"arm-corrections\""), HasSubstr("correction / sigma"),
                             HasSubstr("joint1.offset (the poses of what is fixed in the base)")));
  const CommandResult none = RunHeba({"run", Path("arm/config.yaml"), "--set", "refine.kinematics=none", "--set",
                                      "evaluate.folds=0", "--out", Path("arm_none")});
  EXPECT_EQ(
      Count(none.out, "\narm robot: the kinematics of the arm ur10e were not estimated: refine.kinematics is none"), 1)
      << none.out << none.err;
}

TEST_F(CellCommandsTest, TablesOfABatchCountCapturesAndNameTheIntrinsics) {
  WriteAll(Path("cell/second.yaml"), "base: config.yaml\nname: second\n");
  const CommandResult batch =
      RunHeba({"run", Path("cell/config.yaml"), Path("cell/second.yaml"), "--out", Path("batch"), "--set",
               "evaluate.folds=0", "--set", "refine.robot_noise=white"});
  ASSERT_EQ(batch.status, 0) << batch.err;
  EXPECT_THAT(batch.out, testing::ContainsRegex("second +rig, 3 cameras +12/12 "));
  const CommandResult alone = RunHeba({"run", Path("cell/config.yaml"), "--out", Path("alone"), "--set",
                                       "evaluate.folds=0", "--set", "refine.robot_noise=white"});
  ASSERT_EQ(alone.status, 0) << alone.err;
  const Json params = Json::parse(ReadAll(Path("alone/result.json")))["cameras"]["right"]["camera"];
  EXPECT_NEAR(NumberAfter(alone.out, "camera right in world", "intrinsics brown5: fx "), params["fx"].get<double>(),
              0.01);
  const CommandResult held = RunHeba({"run", Path("cell/config.yaml"), "--out", Path("held"), "--set",
                                      "refine.intrinsics=[]", "--set", "evaluate.folds=0"});
  ASSERT_EQ(held.status, 0) << held.err;
  EXPECT_THAT(held.out, HasSubstr("intrinsics brown5: fx 600.0000, fy 600.0000, cx 320.0000, cy 240.0000 px (held)"));
}

// A study that varies nothing has a chart, and its table has the bounds and is not folded.
TEST_F(CellCommandsTest, StudyOfOneConditionHasAChartAndTheBounds) {
  WriteAll(Path("study.yaml"), "trials: 2\nscenes: {cell: scene.yaml}\nshape_model: none\n");
  const CommandResult study = RunHeba({"study", Path("study.yaml"), "--out", Path("study"), "--quiet"});
  ASSERT_EQ(study.status, 0) << study.err;
  const std::string page = ReadAll(Path("study/study.html"));
  EXPECT_THAT(page, HasSubstr("<h2>Errors and bounds</h2>"));
  EXPECT_THAT(page, HasSubstr(">camera wrist in gripper<"));
  EXPECT_THAT(page, HasSubstr("data-head=\"method\">bound</td>"));
  EXPECT_THAT(page, HasSubstr("data-head=\"trials\">2</td>"));
  EXPECT_THAT(page, testing::Not(HasSubstr("<details>")));
}

TEST_F(CellCommandsTest, DetectEstimatesACameraThatIsNotGiven) {
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

TEST_F(CellCommandsTest, DetectRefusesACameraOfAnotherSizeAndWritesNothing) {
  std::string camera = ReadAll(Path("cell/left.yaml"));
  const size_t size = camera.find("640");
  ASSERT_NE(size, std::string::npos);
  WriteAll(Path("cell/other_size.yaml"), camera.replace(size, 3, "641"));
  const CommandResult refused =
      RunHeba({"detect", Path("cell/config.yaml"), "--set", "cameras.left.intrinsics=" + Path("cell/other_size.yaml"),
               "--out", Path("refused"), "--quiet"});
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err,
              AllOf(StartsWith("heba: error: "), HasSubstr("641 x 480"), HasSubstr("left/000.png is 640 x 480")));
  EXPECT_FALSE(fs::exists(Path("refused")));
}

// The points of all images come from the folder of an earlier run.
TEST_F(CellCommandsTest, RunTakesTheDetectionsOfARun) {
  std::string config;
  for (const std::string& line : Split(ReadAll(Path("cell/config.yaml")), '\n')) {
    if (line.find("images:") == std::string::npos) config += line + "\n";
  }
  WriteAll(Path("cell/given.yaml"), config);
  const std::vector<std::string> command = {
      "run", Path("cell/given.yaml"), "--set", "captures.detections=" + Path("run/detections"), "--quiet", "--out"};
  const auto with = [&](std::vector<std::string> more) {
    std::vector<std::string> whole = command;
    whole.insert(whole.end(), more.begin(), more.end());
    return RunHeba(whole);
  };
  const CommandResult given = with({Path("given"), "--set", "evaluate.folds=0"});
  ASSERT_EQ(given.status, 0) << given.err;
  const Json of_images = Json::parse(ReadAll(Path("run/result.json")));
  const Json of_points = Json::parse(ReadAll(Path("given/result.json")));
  for (const char* camera : {"left", "right", "wrist"}) {
    for (size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(of_points["cameras"][camera]["pose"]["translation_m"][i],
                  of_images["cameras"][camera]["pose"]["translation_m"][i].get<double>(), 1e-3);
    }
  }
  fs::create_directories(Path("given_wrong"));
  fs::copy(Path("run/detections/left.plate.json"), Path("given_wrong/left.plat.json"));
  const CommandResult unknown = with({Path("none"), "--set", "captures.detections=" + Path("given_wrong")});
  EXPECT_EQ(unknown.status, 2);
  EXPECT_THAT(unknown.err, HasSubstr("captures.detections has no file right.TARGET.json"));
  const CommandResult both =
      RunHeba({"run", Path("cell/config.yaml"), "--set", "captures.detections=" + Path("run/detections"), "--out",
               Path("none"), "--quiet"});
  EXPECT_EQ(both.status, 2);
  EXPECT_THAT(both.err, HasSubstr("cameras.left.images"));
  // The doctor, which a bad run asks, needs no images either; a detection of images does.
  const std::vector<std::string> set = {"--set", "captures.detections=" + Path("run/detections")};
  const CommandResult examined = RunHeba({"doctor", Path("cell/given.yaml"), set[0], set[1], "--quiet"});
  EXPECT_EQ(examined.status, 0) << examined.out << examined.err;
  const CommandResult inverted = with({Path("inverted"), "--set", "captures.poses_are=gripper_from_base"});
  EXPECT_THAT(inverted.out + inverted.err, Not(HasSubstr("cannot be read")));
  const CommandResult searched = RunHeba({"detect", Path("cell/given.yaml"), set[0], set[1], "--quiet"});
  EXPECT_EQ(searched.status, 2);
  EXPECT_THAT(searched.err, HasSubstr("captures.detections"));
  // Files of one target of two.
  fs::create_directories(Path("one_target"));
  for (const char* name : {"left.plate.json", "right.plate.json", "wrist.wall.json"}) {
    fs::copy(Path(std::string("run/detections/") + name), Path(std::string("one_target/") + name));
  }
  const CommandResult part = with({Path("part"), "--set", "captures.detections=" + Path("one_target")});
  EXPECT_NE(part.status, 2) << part.err;
}

TEST_F(CellCommandsTest, RunRefusesTheImagesOfOneCameraForTwo) {
  const CommandResult refused =
      RunHeba({"run", Path("cell/config.yaml"), "--set", "cameras.left.images=" + Path("cell/right"), "--out",
               Path("same"), "--quiet"});
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, HasSubstr("cameras left and right have the same images in "));
  EXPECT_FALSE(fs::exists(Path("same")));
}

// The wrist has no constant pose in the base, so that its URDF is another one.
TEST_F(CellCommandsTest, ExportWritesAUrdfForEachRoot) {
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

// The frames of the only camera have the names that are asked for; those of several are called by the cameras.
TEST_F(CellCommandsTest, ExportOfOneCameraNamesItsFrames) {
  WriteAll(Path("cell/one.yaml"), "base: config.yaml\ncameras: {right: , wrist: }\ntargets: {wall: }\n");
  const CommandResult run =
      RunHeba({"run", Path("cell/one.yaml"), "--out", Path("one"), "--quiet", "--set", "evaluate.folds=0"});
  ASSERT_EQ(run.status, 0) << run.err;
  const auto exported = [](const char* folder, const std::string& format, const std::vector<std::string>& flags) {
    std::vector<std::string> words = {"export", Path(folder), "--to", format};
    words.insert(words.end(), flags.begin(), flags.end());
    return RunHeba(words);
  };
  EXPECT_THAT(exported("one", "urdf", {}).out, HasSubstr("<joint name=\"base_link_to_left_optical_frame\""));
  const CommandResult named =
      exported("one", "urdf", {"--method", "bundle", "--parent", "cell", "--child", "eye", "--child-is", "body"});
  EXPECT_THAT(named.out, HasSubstr("<joint name=\"cell_to_eye\"")) << named.err;
  EXPECT_THAT(exported("one", "urdf", {"--method", "park"}).err, HasSubstr("no estimate of 'park'; it has: bundle"));
  EXPECT_THAT(exported("run", "urdf", {"--parent", "cell"}).err, HasSubstr("--parent: is for results of one camera"));
  EXPECT_THAT(exported("run", "urdf", {"--units", "mm"}).err, HasSubstr("--units: format urdf has a fixed unit"));
  EXPECT_THAT(exported("run", "matrix", {"--units", "mm"}).err, testing::IsEmpty());
}

// Captures that the config leaves out have entries too.
TEST_F(CellCommandsTest, TheResultListsWhatWasLeftOut) {
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

TEST_F(CellCommandsTest, CompareMatchesCamerasAndTargetsByName) {
  const CommandResult fewer =
      RunHeba({"run", Path("cell/config.yaml"), "--set", "name=fewer", "--set", "captures.exclude=[001.png]", "--set",
               "evaluate.folds=0", "--out", Path("fewer"), "--quiet"});
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

TEST_F(CellCommandsTest, CompareTakesTheRunOfOneCameraByItsName) {
  const CommandResult compared = RunHeba({"compare", Path("run"), RunOfLeft("left"), "--out", Path("beside")});
  ASSERT_EQ(compared.status, 0) << compared.err;
  EXPECT_THAT(ReadAll(Path("beside/pairs.csv")), HasSubstr("\nconfig,left,camera,world,left,"));
  const CommandResult refused = RunHeba({"compare", Path("run"), RunOfLeft("unknown"), "--out", Path("mixed")});
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, StartsWith("heba: error: unknown: is the run of one camera; a rig beside it needs"));
  EXPECT_FALSE(fs::exists(Path("mixed")));
}

// A batch of rigs, whose images are changed by a test, with one cache of detections.
class CellBatchTest : public CellCommandsTest {
 protected:
  CellBatchTest() {
    fs::remove_all(Path("batch"));
    fs::create_directories(Path("batch"));
    fs::copy(Path("cell"), Path("batch/cell"), fs::copy_options::recursive);
    const std::string base = "base: cell/config.yaml\nevaluate: {folds: 0}\nrefine: {robot_noise: white";
    WriteAll(Path("batch/free.yaml"), base + "}\n");
    WriteAll(Path("batch/held.yaml"), base + ", intrinsics: []}\n");
  }

  static CommandResult RunBatch(const std::string& out, const std::vector<std::string>& more = {},
                                const std::vector<std::string>& configs = {"free", "held"}) {
    std::vector<std::string> arguments = {"run", "--out", Path("batch/" + out), "--jobs", "2"};
    for (const std::string& config : configs) arguments.push_back(Path("batch/" + config + ".yaml"));
    arguments.insert(arguments.end(), more.begin(), more.end());
    return RunHeba(arguments, "HEBA_CACHE=" + Path("cache"));
  }
  static std::string Stamp(const std::string& run) {
    const fs::path file = Path("batch/" + run + "/result.json");
    return fs::exists(file) ? std::to_string(fs::last_write_time(file).time_since_epoch().count()) : "none";
  }
};

TEST_F(CellBatchTest, ShardsTogetherGiveTheSameBytes) {
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

TEST_F(CellBatchTest, ResumeRunsOnlyWhatChanged) {
  ASSERT_EQ(RunBatch("out").status, 0);
  const std::string free = Stamp("out/free");
  std::string held = Stamp("out/held");
  ASSERT_EQ(RunBatch("out", {"--resume"}).status, 0);
  EXPECT_EQ(Stamp("out/free"), free);
  EXPECT_EQ(Stamp("out/held"), held);
  WriteAll(Path("batch/free.yaml"), ReadAll(Path("batch/free.yaml")) + "captures: {exclude: [003.png]}\n");
  ASSERT_EQ(RunBatch("out", {"--resume"}).status, 0);
  EXPECT_NE(Stamp("out/free"), free);
  EXPECT_EQ(Stamp("out/held"), held);
  // A single run resumes by itself.
  ASSERT_EQ(RunBatch("out/held", {"--resume"}, {"held"}).status, 0);
  EXPECT_EQ(Stamp("out/held"), held);
  const auto expect_again = [&](const char* what) {
    const CommandResult again = RunBatch("out/held", {"--resume"}, {"held"});
    EXPECT_EQ(again.status, 0) << again.err;
    EXPECT_NE(Stamp("out/held"), held) << what;
    held = Stamp("out/held");
  };
  // The second camera sees a capture again.
  fs::copy_file(Path("batch/cell/right/001.png"), Path("batch/cell/right/000.png"),
                fs::copy_options::overwrite_existing);
  expect_again("an image");
  WriteAll(Path("batch/cell/right.yaml"), ReadAll(Path("batch/cell/right.yaml")) + "\n");
  expect_again("a camera");
  WriteAll(Path("batch/cell/truth.json"), ReadAll(Path("batch/cell/truth.json")) + "\n");
  expect_again("the truth");
  WriteAll(Path("batch/out/held/result.json"), "");
  held = Stamp("out/held");
  expect_again("a damaged result");
}

// A finished rig is named by its folder or by its result.json.
TEST_F(CellCommandsTest, TheIntrinsicsOfOneCameraCanBeHeld) {
  const CommandResult run =
      RunHeba({"run", Path("cell/config.yaml"), "--out", Path("held"), "--quiet", "--set",
               "cameras.left.refine.intrinsics=[]", "--set", "evaluate.folds=0", "--set", "refine.robot_noise=white"});
  ASSERT_EQ(run.status, 0) << run.err;
  const Json result = Json::parse(ReadAll(Path("held/result.json")));
  const auto is_estimated = [&](const std::string& camera) {
    const auto& order = result["covariance"]["order"];
    return std::count(order.begin(), order.end(), "cameras." + camera + ".camera.fx") > 0;
  };
  EXPECT_FALSE(is_estimated("left"));
  EXPECT_TRUE(is_estimated("right"));
  EXPECT_THAT(ReadAll(Path("held/config.yaml")), HasSubstr("refine:\n      intrinsics:\n        []\n"));
  // The config as used gives the same result.
  const CommandResult again = RunHeba({"run", Path("held/config.yaml"), "--out", Path("held_again"), "--quiet"});
  ASSERT_EQ(again.status, 0) << again.err;
  EXPECT_EQ(Json::parse(ReadAll(Path("held_again/result.json")))["cameras"], result["cameras"]);
  const CommandResult wrong = RunHeba(
      {"run", Path("cell/config.yaml"), "--out", Path("none"), "--quiet", "--set", "cameras.left.refine.intrinsic=[]"});
  EXPECT_EQ(wrong.status, 2);
  EXPECT_THAT(wrong.err, HasSubstr("did you mean 'intrinsics'"));
}

// Each camera has its weakest direction among the findings; a poor arm makes some of them doubtful, with the captures
// that would help.
TEST_F(CellCommandsTest, ResultsNameTheWeakDirectionOfEachCamera) {
  const Json result = Json::parse(ReadAll(Path("run/result.json")));
  std::vector<std::string> texts;
  for (const Json& finding : result["verdict"]["findings"]) {
    if (finding["code"] == "weak_direction") texts.push_back(finding["text"]);
  }
  EXPECT_THAT(texts, testing::UnorderedElementsAre(StartsWith("camera left: the camera's"),
                                                   StartsWith("camera right: the camera's"),
                                                   StartsWith("camera wrist: the camera's")));
  const CommandResult simulated = RunHeba({"simulate", Path("scene.yaml"), "--out", Path("poor"), "--quiet", "--set",
                                           "robot_noise={translation: 2 mm, rotation: 0.4 deg}"});
  ASSERT_EQ(simulated.status, 0) << simulated.err;
  const CommandResult run = RunHeba({"run", Path("poor/config.yaml"), "--out", Path("poor_run"), "--set",
                                     "evaluate.folds=0", "--set", "refine.robot_noise=white"});
  ASSERT_EQ(run.status, 0) << run.err;
  const std::string words = Unbroken(run.out);
  EXPECT_THAT(words, AllOf(HasSubstr("is determined to only "), HasSubstr("-> from capture "),
                           HasSubstr(" would reduce the sigma of the camera's "), HasSubstr("in both, ")));
  EXPECT_NE(ReadAll(Path("poor_run/report.html")).find("would reduce the sigma of "), std::string::npos);
}

TEST_F(CellCommandsTest, LocateTakesTheFileOfTheResult) {
  const std::string image = "wrist=" + Path("cell/wrist/000.png");
  const std::string row = ReadAll(Path("cell/poses.csv"));
  const std::string first = row.substr(row.find("000.png,") + 8);
  const std::string pose = "--pose=" + first.substr(0, first.find('\n'));
  const CommandResult of_folder = RunHeba({"locate", Path("run"), image, pose});
  EXPECT_EQ(of_folder.status, 0) << of_folder.err;
  EXPECT_THAT(of_folder.out, StartsWith("target plate in world, by wrist: "));
  EXPECT_THAT(of_folder.out, HasSubstr(" of 35 points, rms "));
  const CommandResult of_file = RunHeba({"locate", Path("run/result.json"), image, pose});
  EXPECT_EQ(of_file.status, 0) << of_file.err;
  EXPECT_EQ(of_file.out, of_folder.out);
  EXPECT_THAT(RunHeba({"locate", Path("run"), image}).err,
              HasSubstr("--pose: camera wrist is carried by the arm robot"));
}

// Returns the poses of a capture, as the flag --pose takes them.
std::string PoseOfCapture(const std::string& poses, const std::string& image) {
  const std::string numbers = poses.substr(poses.find("\n" + image + ",") + image.size() + 2);
  return numbers.substr(0, numbers.find('\n'));
}

// The fixed cameras see the plate in these captures.
std::pair<std::string, std::string> CapturesOfBoth(const std::string& run) {
  std::vector<std::string> names;
  std::map<std::string, int> num_seen;
  const Json result = Json::parse(ReadAll(run + "/result.json"));
  for (const Json& entry : result["captures"]) {
    const bool is_seen = entry["camera"] != "wrist" && entry["points"] == kNumPoints;
    if (is_seen && ++num_seen[entry["capture"]] == 2) names.push_back(entry["capture"]);
  }
  CHECK_GE(names.size(), 2U);
  return {names.front(), names.back()};
}

// Images of two captures do not show the plate at one pose: no pose is stated, and the camera is named if there are
// three.
TEST_F(CellCommandsTest, LocateRefusesImagesThatContradictEachOther) {
  const auto [first, other] = CapturesOfBoth(Path("run"));
  const auto image = [](const std::string& camera, const std::string& name) {
    return camera + "=" + Path("cell/" + camera + "/" + name);
  };
  const CommandResult together =
      RunHeba({"locate", Path("run"), image("left", first), image("right", first), "--json"});
  EXPECT_EQ(together.status, 0) << together.err;
  const Json plate = Json::parse(together.out)["targets"][0];
  EXPECT_TRUE(plate["located"]);
  EXPECT_GT(plate["chance"].get<double>(), 1e-3);
  EXPECT_EQ(plate["chosen"], 0);
  EXPECT_EQ(plate["poses"][0]["pose"], plate["pose"]);
  EXPECT_TRUE(plate["poses"][0]["postures"].empty());
  EXPECT_EQ(plate["points"], 2 * kNumPoints);
  // The sigmas along the world's axes are those of the text.
  const Json& in_world = plate["poses"][0]["sigma_in_world"];
  std::string sigmas;
  for (const Json& sigma : in_world["total_mm"]) sigmas += (sigmas.empty() ? "" : ", ") + Significant(sigma, 2);
  EXPECT_THAT(Unbroken(RunHeba({"locate", Path("run"), image("left", first), image("right", first)}).out),
              HasSubstr("one sigma of its centre, along the world's x, y, z: " + sigmas + " mm (calibration "));
  // The rotation is the same one, whose axes do not change the size of its covariance.
  double in_target_deg2 = 0;
  double in_world_deg2 = 0;
  for (size_t axis = 0; axis < 3; ++axis) {
    in_target_deg2 += std::pow(plate["sigma"]["total"]["deg"][axis].get<double>(), 2);
    in_world_deg2 += std::pow(in_world["total_deg"][axis].get<double>(), 2);
  }
  EXPECT_NEAR(in_world_deg2, in_target_deg2, 1e-9 * in_target_deg2);

  const CommandResult of_two = RunHeba({"locate", Path("run"), image("left", first), image("right", other), "--json"});
  EXPECT_EQ(of_two.status, 1);
  EXPECT_THAT(of_two.err,
              StartsWith("heba: error: target plate: the cameras left, right contradict each other: they see the "));
  EXPECT_EQ(std::count(of_two.err.begin(), of_two.err.end(), '\n'), 1) << of_two.err;
  const Json refused = Json::parse(of_two.out)["targets"][0];
  EXPECT_FALSE(refused["located"]);
  EXPECT_THAT(refused["reason"].get<std::string>(), HasSubstr("contradict each other"));
  for (const char* const figure : {"pose", "sigma", "rms_px", "chance", "chosen"}) {
    EXPECT_TRUE(refused[figure].is_null()) << figure;
  }
  EXPECT_THAT(RunHeba({"locate", Path("run"), image("left", first), image("right", other)}).out,
              Not(HasSubstr("target plate in world")));

  const std::string pose = "--pose=" + PoseOfCapture(ReadAll(Path("cell/poses.csv")), first);
  const CommandResult of_three = RunHeba(
      {"locate", Path("run"), image("left", first), image("right", other), image("wrist", first), pose, "--json"});
  EXPECT_EQ(of_three.status, 1);
  EXPECT_THAT(of_three.err, HasSubstr("target plate: camera right contradicts the others, which see the target "));
}

// Every flag and argument that would be ignored, and every pixel that is none, is refused in one line.
TEST_F(CellCommandsTest, LocateRefusesWhatItWouldIgnore) {
  const std::string pixels = "left=300,200;right=310,210";
  const std::string left = "left=" + Path("cell/left/000.png");
  const std::string right = "right=" + Path("cell/right/000.png");
  const std::string pose = "0.5,0,0.5,0,0,0,1";
  struct Call {
    std::vector<std::string> words;
    std::string fault;
  };
  const Call calls[] = {
      {{"--pixels", pixels, "--plane", "rubbish"}, "--plane: "},
      {{"--pixels", pixels, "--robot", "nonsense"}, "--robot: 'nonsense' is unknown"},
      {{"--pixels", pixels, "--robot", "ur5"}, "--robot: the point of several pixels has no orientation"},
      {{"--pixels", pixels, "--joints", "1,2"}, "--joints: "},
      {{"--pixels", pixels, "--near", "x"}, "--near: "},
      {{"--pixels", pixels, "--pose", pose}, "--pose: the arm robot carries none of the cameras"},
      {{left, "--pixels", pixels}, "--pixels: needs no image"},
      {{"--pixels", "left=640.5,200;right=310,210"}, "--pixels: 640.500,200.000 is outside the image of camera left"},
      {{"--pixels", "left=300,200;left=310,210"}, "--pixels: camera left is named twice"},
      {{"--pixels", "left=nan,200;right=310,210"}, "--pixels: 'nan,200' is not a pixel"},
      {{"--pixels", "left=300,200"}, "--pixels: a point needs its pixels in at least two cameras"},
      {{left, "--near", pose}, "--near: no target has a symmetry"},
      {{left, "--plane", "0,0,1,1 mm"}, "--plane: "},
      {{left, "--pose", pose}, "--pose: the arm robot carries none of the cameras"},
      {{left, right, "--pose", "robot=" + pose + ";robot=" + pose}, "--pose: the arm robot is named twice"}};
  for (const Call& call : calls) {
    std::vector<std::string> words = {"locate", Path("run")};
    words.insert(words.end(), call.words.begin(), call.words.end());
    const CommandResult located = RunHeba(words);
    EXPECT_EQ(located.status, 2) << call.fault;
    EXPECT_THAT(located.err, StartsWith("heba: error: " + call.fault));
    EXPECT_EQ(std::count(located.err.begin(), located.err.end(), '\n'), 1) << located.err;
    EXPECT_EQ(located.out, "");
  }
}

// Pixels whose rays do not meet have a warning, in JSON as well.
TEST_F(CellCommandsTest, LocateWarnsOfPixelsThatShowNoCommonPoint) {
  const auto locate = [](const std::string& pixels) {
    return RunHeba({"locate", Path("run"), "--pixels", pixels, "--json"});
  };
  // The pixels of the origin of the plate in both cameras, and others.
  const auto first = CapturesOfBoth(Path("run")).first;
  std::string meeting;
  for (const std::string camera : {"left", "right"}) {
    const Json detections = Json::parse(ReadAll(Path("run/detections/" + camera + ".plate.json")));
    for (const Json& image : detections["captures"]) {
      if (image["image"] != first) continue;
      const Json& pixel = image["pixels"][0];
      meeting += (meeting.empty() ? "" : ";") + camera + "=" + pixel[0].dump() + "," + pixel[1].dump();
    }
  }
  const CommandResult right = locate(meeting);
  EXPECT_EQ(right.err, "") << meeting;
  EXPECT_EQ(Json::parse(right.out)["point"]["warning"], "");
  const CommandResult wrong = locate("left=300,200;right=310,400");
  EXPECT_THAT(wrong.err, StartsWith("heba: warning: the rays of the pixels do not meet"));
  EXPECT_THAT(Json::parse(wrong.out)["point"]["warning"].get<std::string>(), StartsWith("the rays of the pixels"));

  // On a plane through the point, each pixel shows it by itself.
  const Json at_m = Json::parse(right.out)["point"]["in_world_m"];
  const std::string plane = "0,0,1," + Json(1000 * at_m[2].get<double>()).dump() + " mm";
  const CommandResult on_plane = RunHeba({"locate", Path("run"), "--pixels", meeting, "--plane", plane, "--json"});
  ASSERT_EQ(on_plane.status, 0) << on_plane.err;
  const Json points = Json::parse(on_plane.out)["points"];
  ASSERT_EQ(points.size(), 2U);
  constexpr double kNearM = 5e-4;
  for (const Json& point : points) {
    for (size_t axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(point["in_world_m"][axis].get<double>(), at_m[axis].get<double>(), kNearM) << point["camera"];
    }
  }
  EXPECT_EQ(points[0]["camera"], "left");
  EXPECT_GT(points[0]["sigma"]["total_mm"][0].get<double>(), 0);
  EXPECT_TRUE(points[0]["postures"].empty());
  // An arm's flange can point at the plane there.
  const CommandResult reached =
      RunHeba({"locate", Path("run"), "--pixels", meeting, "--plane", plane, "--json", "--robot", "ur10e"});
  ASSERT_EQ(reached.status, 0) << reached.err;
  EXPECT_EQ(Json::parse(reached.out)["points"][0]["postures"]["robot"]["arm"], "ur10e");
  // A plane behind the cameras has no point.
  const CommandResult behind = RunHeba({"locate", Path("run"), "--pixels", meeting, "--plane", "0,0,1,30 m"});
  EXPECT_EQ(behind.status, 1);
  EXPECT_THAT(behind.err, HasSubstr(" of camera left: its ray does not meet the plane"));
}

}  // namespace
}  // namespace heba
