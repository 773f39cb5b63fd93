// The JSON of `heba locate`, `heba detect` and `heba doctor` states what their texts state.
#include <cmath>
#include <regex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/robot/arm_postures.h"
#include "heba/robot/arm_table.h"
#include "heba/robot/urdf_arm.h"
#include "tests/pipeline/cli.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using Json = nlohmann::json;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

using Numbers = std::vector<double>;

std::string Listed(const Numbers& numbers) {
  std::vector<std::string> texts;
  for (const double number : numbers) texts.push_back(Significant(number, 2));
  return Join(texts, ", ");
}

// One calibration with a chessboard of 5 x 7 inner corners, which looks the same after a rotation by 180 deg.
class JsonOutputTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new fs::path(TestFolder("json_output"));
    WriteAll(
        *folder_ / "scene.yaml",
        "setup: eye_to_hand\ntarget: {type: chessboard, rows: 5, columns: 7, square: 24 mm}\n"
        "camera: {model: brown5, image_size: [640, 480], fx: 700, fy: 700, cx: 320, cy: 240, distortion: [-0.1, "
        "0.08, 0, 0, 0]}\n"
        "hand_eye: {translation: [820 mm, -140 mm, 610 mm], rpy: [-118 deg, 4 deg, 62 deg]}\n"
        "board: {translation: [-70 mm, -60 mm, 95 mm], rpy: [3 deg, -2 deg, 15 deg]}\n"
        "motion: {captures: 8, distance: 450 mm, depth: 0.25, tilt: 30 deg, spin: 60 deg, spread: 0.3}\nseed: 5\n");
    const CommandResult simulated = RunHeba({"simulate", Path("scene.yaml"), "--out", Path("data"), "--quiet"});
    ASSERT_EQ(simulated.status, 0) << simulated.err;
    WriteAll(Path("data/config.yaml"), ReadAll(Path("data/config.yaml")) + "refine: {intrinsics: []}\n");
    const CommandResult run =
        RunHeba({"run", Path("data/config.yaml"), "--out", Path("run"), "--quiet", "--set", "evaluate.folds=0"});
    ASSERT_EQ(run.status, 0) << run.err;
    for (const fs::directory_entry& entry : fs::directory_iterator(*folder_ / "data" / "images")) {
      if (image_.empty() || entry.path().string() < image_) image_ = entry.path().string();
    }
  }
  static void TearDownTestSuite() { delete folder_; }
  static std::string Path(const std::string& name) { return (*folder_ / name).string(); }

  // Runs a command with --json and without, and checks that the exit statuses agree.
  static std::pair<Json, std::string> Both(std::vector<std::string> arguments) {
    const CommandResult text = RunHeba(arguments);
    arguments.emplace_back("--json");
    const CommandResult json = RunHeba(arguments);
    EXPECT_EQ(json.status, text.status) << json.err;
    EXPECT_EQ(json.err, text.err);
    EXPECT_TRUE(Json::accept(json.out)) << json.out;
    return {Json::parse(json.out, nullptr, false), Unbroken(text.out)};
  }

  static fs::path* folder_;
  static std::string image_;
};
fs::path* JsonOutputTest::folder_ = nullptr;
std::string JsonOutputTest::image_;

TEST_F(JsonOutputTest, LocateListsAllPosesThatFit) {
  const auto [json, text] = Both({"locate", Path("run"), image_, "--robot", "ur10e"});
  EXPECT_EQ(json["schema"], "heba/locations/1");
  EXPECT_EQ(json["setup"], "eye_to_hand");
  EXPECT_TRUE(json["camera_mount"].is_null());
  const Json estimates = Json::parse(ReadAll(Path("run/result.json")))["estimates"];
  EXPECT_GT(json["covariance_dof"].get<double>(), 0);
  EXPECT_EQ(json["covariance_dof"], estimates.back()["solve"]["covariance_dof"]);
  ASSERT_EQ(json["images"].size(), 1U);
  const Json& image = json["images"][0];
  EXPECT_EQ(image["image"], image_);
  EXPECT_FALSE(image["located"].get<bool>());
  EXPECT_TRUE(image["chosen"].is_null());
  EXPECT_THAT(image["reason"].get<std::string>(), HasSubstr("so 2 poses fit an image equally well; --near x,y,z,"));
  EXPECT_EQ(image["points"], 35);
  EXPECT_EQ(image["target_points"], 35);
  EXPECT_THAT(text, HasSubstr("rms " + Significant(image["rms_px"], 2) + " px"));
  ASSERT_EQ(image["poses"].size(), 2U);
  for (const Json& pose : image["poses"]) {
    const Json& base_from_target = pose["base_from_target"];
    EXPECT_EQ(base_from_target["parent"], "base");
    EXPECT_EQ(base_from_target["child"], "target");
    const Numbers t = base_from_target["translation_m"];
    const Numbers q = base_from_target["quaternion_xyzw"];
    EXPECT_NEAR(std::hypot(q[0], q[1], std::hypot(q[2], q[3])), 1, 1e-12);
    // The matrix is that of the quaternion.
    EXPECT_NEAR(base_from_target["matrix"][0][0], 1 - 2 * (q[1] * q[1] + q[2] * q[2]), 1e-12);
    EXPECT_EQ(base_from_target["matrix"][2][3], t[2]);
    EXPECT_EQ(base_from_target["matrix"][3].get<Numbers>(), (Numbers{0, 0, 0, 1}));
    // The text rounds to 0.001 mm at least.
    EXPECT_THAT(text, HasSubstr("base_from_target [" + Fixed(1000 * t[0], 3)));
    const Json& postures = pose["postures"];
    EXPECT_EQ(postures["arm"], "ur10e");
    EXPECT_EQ(postures["joints"].size(), 6U);
    EXPECT_EQ(postures["joints"][0]["unit"], "deg");
    if (postures["postures"].empty()) {
      EXPECT_THAT(text, HasSubstr("ur10e: " + postures["reason"].get<std::string>()));
    } else {
      EXPECT_THAT(text, HasSubstr(Fixed(postures["postures"][0]["joints"][1], 3)));
    }
  }
}

TEST_F(JsonOutputTest, LocateFindsJointsOfArmsThatReachWithinTheirLimits) {
  int num_postures = 0;
  for (const char* const name : {"ur10e", "kuka_kr10_r1100", "kuka_iiwa14"}) {
    const Arm& arm = *FindArm(name);
    const Json json = Both({"locate", Path("run"), image_, "--robot", name}).first;
    for (const Json& pose : json["images"][0]["poses"]) {
      const Numbers t = pose["base_from_target"]["translation_m"];
      const Numbers q = pose["base_from_target"]["quaternion_xyzw"];
      const Rigid3d base_from_target(Eigen::Quaterniond(q[3], q[0], q[1], q[2]), Eigen::Vector3d(t[0], t[1], t[2]));
      const Json& found = pose["postures"];
      EXPECT_EQ(found["joints"].size(), arm.joints.size());
      EXPECT_EQ(found["postures"].empty(), !found["reason"].get<std::string>().empty());
      for (const Json& posture : found["postures"]) {
        const Numbers deg = posture["joints"];
        Eigen::VectorXd joints(arm.num_joints());
        for (size_t j = 0; j < deg.size(); ++j) joints[static_cast<Eigen::Index>(j)] = DegToRad(deg[j]);
        EXPECT_LT(LocalCoordinates(base_from_target, BaseFromTip(arm, joints)).norm(), 1e-6) << name;
        EXPECT_EQ(WithinLimits(arm, joints), joints) << name;
        ++num_postures;
      }
    }
  }
  EXPECT_GT(num_postures, 0);
}

// An arm with three slides and three joints that turn reaches every pose within its range.
TEST_F(JsonOutputTest, LocateFindsTheJointsOfAUrdf) {
  std::string urdf = "<robot name=\"gantry\"><link name=\"link0\"/>\n";
  const std::string axes[] = {"1 0 0", "0 1 0", "0 0 1"};
  for (int j = 0; j < 6; ++j) {
    const std::string n = std::to_string(j + 1);
    urdf += "<link name=\"link" + n + "\"/><joint name=\"j" + n + "\" type=\"" + (j < 3 ? "prismatic" : "revolute") +
            "\"><parent link=\"link" + std::to_string(j) + "\"/><child link=\"link" + n + "\"/><axis xyz=\"" +
            axes[j % 3] + "\"/><limit lower=\"-3\" upper=\"3\" effort=\"1\" velocity=\"1\"/></joint>\n";
  }
  WriteAll(Path("gantry.urdf"), urdf + "</robot>\n");
  const Arm arm = ReadUrdfArm(Path("gantry.urdf")).arm;
  const auto [json, text] = Both({"locate", Path("run"), image_, "--robot", Path("gantry.urdf")});
  EXPECT_THAT(text, HasSubstr("the tip's frame with the target's; j1, j2, j3, j4, j5, j6 in deg or m:"));
  for (const Json& pose : json["images"][0]["poses"]) {
    const Numbers t = pose["base_from_target"]["translation_m"];
    ASSERT_FALSE(pose["postures"]["postures"].empty());
    for (const Json& posture : pose["postures"]["postures"]) {
      const Numbers found = posture["joints"];
      for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(found[i], t[i], 1e-6);
    }
  }
}

TEST_F(JsonOutputTest, LocateStatesSigmasAndTheirParts) {
  const auto [undecided, all] = Both({"locate", Path("run"), image_});
  const Json& second = undecided["images"][0]["poses"][1]["base_from_target"];
  const Numbers t = second["translation_m"];
  const Numbers q = second["quaternion_xyzw"];
  std::vector<std::string> near;
  for (const double number : {t[0], t[1], t[2], q[0], q[1], q[2], q[3]}) near.push_back(RoundTrip(number));
  const auto [json, text] = Both({"locate", Path("run"), image_, "--near", Join(near, ",")});
  const Json& image = json["images"][0];
  EXPECT_TRUE(image["located"].get<bool>());
  EXPECT_EQ(image["chosen"], 1);
  EXPECT_NEAR(image["poses"][1]["near_deg"], 0, 1e-5);
  EXPECT_NEAR(image["poses"][0]["near_deg"], 180, 2);
  const Json& sigma = image["poses"][1]["sigma"];
  EXPECT_THAT(text, HasSubstr(Listed(sigma["total_mm"]) + " mm (calibration " + Listed(sigma["calibration_mm"]) +
                              "; image " + Listed(sigma["image_mm"])));
  EXPECT_THAT(text, HasSubstr("one sigma of its rotation about the same axes: " + Listed(sigma["total_deg"]) + " deg"));
  EXPECT_TRUE(image["poses"][1]["postures"].is_null());
  for (const std::string unit : {"_mm", "_deg"}) {
    for (size_t i = 0; i < 3; ++i) {
      double variance = 0;
      for (const std::string part : {"calibration", "image", "robot"}) {
        variance += std::pow(sigma[part + unit][i].get<double>(), 2);
      }
      EXPECT_NEAR(sigma["total" + unit][i], std::sqrt(variance), 1e-9 * std::sqrt(variance));
      EXPECT_GT(sigma["total" + unit][i], 0);
    }
  }
}

TEST_F(JsonOutputTest, LocateStatesPixels) {
  const auto [json, text] = Both({"locate", Path("run"), image_, "--pixels", "300,200; 320,240"});
  const Json& image = json["images"][0];
  EXPECT_TRUE(image["located"].get<bool>());
  EXPECT_TRUE(image["poses"].empty());
  ASSERT_EQ(image["pixels"].size(), 2U);
  const Json& pixel = image["pixels"][1];
  EXPECT_EQ(pixel["pixel"].get<Numbers>(), (Numbers{320, 240}));
  const Numbers in_base_m = pixel["in_base_m"];
  EXPECT_THAT(text, HasSubstr("pixel 320.000, 240.000: [" + Fixed(1000 * in_base_m[0], 3)));
  EXPECT_THAT(text, HasSubstr("one sigma " + Listed(pixel["sigma"]["total_mm"]) + " mm"));
}

TEST_F(JsonOutputTest, ImagesWithoutATargetHaveAReason) {
  WriteAll(*folder_ / "black.pgm", "P5\n640 480\n255\n" + std::string(640 * 480, '\x10'));
  const auto [json, text] = Both({"locate", Path("run"), Path("black.pgm")});
  EXPECT_EQ(text, "");
  const Json& image = json["images"][0];
  EXPECT_FALSE(image["located"].get<bool>());
  EXPECT_NE(image["reason"], "");
  EXPECT_TRUE(image["rms_px"].is_null());
}

// The other images are located all the same.
TEST_F(JsonOutputTest, ImagesThatCannotBeReadHaveAReason) {
  WriteAll(*folder_ / "small.pgm", "P5\n64 48\n255\n" + std::string(64 * 48, '\x10'));
  const std::vector<std::string> call = {"locate", Path("run"), Path("none.png"), Path("small.pgm"),
                                         image_,   "--pixels",  "320,240"};
  const auto [json, text] = Both(call);
  EXPECT_EQ(RunHeba(call).status, 2);
  EXPECT_THAT(RunHeba(call).err,
              AllOf(HasSubstr("none.png: there is no such file"), HasSubstr("small.pgm: is 64 x 48 px")));
  ASSERT_EQ(json["images"].size(), 3U);
  EXPECT_THAT(json["images"][0]["reason"].get<std::string>(), StartsWith("there is no such file"));
  EXPECT_THAT(json["images"][1]["reason"].get<std::string>(), StartsWith("is 64 x 48 px"));
  EXPECT_FALSE(json["images"][0]["located"].get<bool>());
  EXPECT_TRUE(json["images"][2]["located"].get<bool>());
  EXPECT_THAT(text, HasSubstr("pixel 320.000, 240.000: ["));
}

TEST_F(JsonOutputTest, DetectCountsPoints) {
  const auto [json, text] = Both({"detect", Path("data/config.yaml"), "--out", Path("detections"), "--quiet"});
  EXPECT_EQ(text, "");  // --quiet omits the text, but not the document that --json asks for.
  EXPECT_EQ(json["schema"], "heba/detection_summary/1");
  EXPECT_EQ(json["captures"], 8);
  EXPECT_EQ(json["seen"], 8);
  EXPECT_EQ(json["points"], 8 * 35);
  EXPECT_EQ(json["residuals"]["relative_to"], "given_camera");
  EXPECT_EQ(json["images"].size(), 8U);
  const CommandResult loud = RunHeba({"detect", Path("data/config.yaml"), "--out", Path("detections")});
  EXPECT_EQ(json["target_points"], 35);
  for (const Json& image : json["images"]) {
    EXPECT_TRUE(image["camera"].is_null());  // Cameras and targets of a rig have names.
    EXPECT_TRUE(image["target"].is_null());
    EXPECT_TRUE(image["detected"].get<bool>());
    EXPECT_THAT(loud.out, HasSubstr(image["image"].get<std::string>() + ": 35 of 35 points, " +
                                    Significant(image["rms_px"], 3) + " px rms"));
  }
}

// The settings of a fault, given by --set, cure it.
TEST_F(JsonOutputTest, DoctorStatesTheSettingsThatCure) {
  const std::vector<std::string> wrong = {"doctor", Path("data/config.yaml"), "--quiet", "--set",
                                          "captures.pose_format={columns: [x, y, z, qx, qy, qz, qw], translation: mm, "
                                          "rotation: quaternion_xyzw}"};
  const auto [json, text] = Both(wrong);
  EXPECT_EQ(json["schema"], "heba/diagnosis/1");
  EXPECT_EQ(json["captures"], 8);
  EXPECT_EQ(json["seen"], 8);
  EXPECT_EQ(json["wrong"], 1);
  const Json& symptom = json["symptoms"][0];
  EXPECT_EQ(symptom["grade"], "wrong");
  EXPECT_EQ(symptom["code"], "pose_units");
  EXPECT_THAT(text, HasSubstr("wrong [pose_units]: "));
  EXPECT_THAT(text, HasSubstr(symptom["action"].get<std::string>()));
  ASSERT_EQ(symptom["settings"].size(), 1U);
  const std::string key = symptom["settings"][0]["key"];
  const std::string value = symptom["settings"][0]["value"];
  EXPECT_EQ(key, "captures.pose_format");
  const CommandResult cured =
      RunHeba({"doctor", Path("data/config.yaml"), "--quiet", "--json", "--set", key + "=" + value});
  EXPECT_EQ(Json::parse(cured.out)["wrong"], 0) << cured.out;
}

}  // namespace
}  // namespace heba
