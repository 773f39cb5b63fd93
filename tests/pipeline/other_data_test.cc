// Data sets without images: imported ones, given poses of the target, and corners that were detected before.
#include <algorithm>
#include <cmath>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heba/io/camera_file.h"
#include "heba/io/pose_file.h"
#include "tests/pipeline/cli.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;

class OtherDataTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = TestFolder(std::string("other_data_") + testing::UnitTest::GetInstance()->current_test_info()->name());
  }
  void TearDown() override { fs::remove_all(folder_); }

  // Writes poses of the gripper, and of the target in the camera frame, of an exact scene; `gripper_from` selects the
  // gripper pose of each capture.
  void WritePairs(const std::function<size_t(size_t)>& gripper_from) {
    const TestScene scene = MakeTestScene(7);
    std::vector<PoseRow> grippers;
    std::vector<PoseRow> targets;
    for (size_t i = 0; i < scene.pairs.size(); ++i) {
      const std::string name = "s" + std::to_string(i);
      grippers.push_back(
          {name, CaptureRole::kNone, scene.pairs[gripper_from(i)].camera_mount_from_target_mount, 0, {}});
      targets.push_back({name, CaptureRole::kNone, scene.pairs[i].camera_from_target, 0, {}});
    }
    const PoseFormat& ros = *FindPoseFormat("ros");
    WriteAll(folder_ / "poses.csv", PoseFileText(grippers, ros));
    WriteAll(folder_ / "target_poses.csv", PoseFileText(targets, ros));
    WriteAll(
        folder_ / "truth.json",
        "{\"hand_eye\": {\"parent\": \"base\", \"child\": \"camera\", \"translation_m\": [0, 0, 0], "
        "\"quaternion_xyzw\": [0, 0, 0, 1]}, \"camera\": {\"model\": \"pinhole\", \"image_size\": [640, 480], \"fx\": "
        "600, \"fy\": 600, \"cx\": 320, \"cy\": 240, \"distortion\": []}}");
    WriteAll(folder_ / "config.yaml",
             "setup: eye_to_hand\ncaptures: {target_poses: target_poses.csv, poses: poses.csv}\nevaluate: {truth: "
             "truth.json}\n");
  }
  std::string Path(const std::string& name) const { return (folder_ / name).string(); }
  CommandResult Run() { return RunHeba({"run", Path("config.yaml"), "--out", Path("run"), "--quiet"}); }

  fs::path folder_;
};

TEST_F(OtherDataTest, PosesOfTheTargetGiveAHandEyePose) {
  WritePairs([](size_t i) { return i; });
  const CommandResult result = Run();
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_THAT(ReadAll(folder_ / "run" / "result.json"), HasSubstr("bundle adjustment needs images or corners"));
  EXPECT_TRUE(fs::exists(folder_ / "run" / "report.html"));
  // Formats without a camera can be exported; those with a camera are refused with a message.
  EXPECT_EQ(RunHeba({"export", Path("run"), "--to", "urdf", "--method", "chain"}).status, 0);
  for (const std::string form : {"opencv", "camera_info", "kalibr", "mrcal"}) {
    const CommandResult refused = RunHeba({"export", Path("run"), "--to", form, "--method", "chain"});
    EXPECT_NE(refused.status, 0) << form;
    EXPECT_THAT(refused.err, HasSubstr("has no camera")) << form;
  }
  EXPECT_THAT(RunHeba({"locate", Path("run"), "a.png"}).err, HasSubstr("no refined estimate"));
  EXPECT_THAT(RunHeba({"detect", Path("config.yaml")}).err, HasSubstr("no images to search"));
}

// Poses that contradict each other have a result, which is bad, and the reason comes first.
TEST_F(OtherDataTest, UnrelatedPosesAreBad) {
  WritePairs([](size_t i) { return (7 * i + 3) % 15; });
  const CommandResult result = Run();
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_THAT(ReadAll(folder_ / "run" / "result.json"), HasSubstr("poses_unexplained"));
  EXPECT_EQ(RunHeba({"run", Path("config.yaml"), "--out", Path("again"), "--quiet", "--fail-on", "bad"}).status, 1);
  EXPECT_TRUE(fs::exists(folder_ / "run"));
  EXPECT_THAT(RunHeba({"doctor", Path("config.yaml"), "--quiet"}).out, HasSubstr("wrong [poses_unexplained]"));
}

TEST_F(OtherDataTest, ImportKeepsExistingFiles) {
  WritePairs([](size_t i) { return i; });
  for (const char* made : {"set", "mine"}) fs::create_directory(folder_ / made);
  WriteAll(folder_ / "set" / "poses.txt", "1 0 0 0 0 0 0 1\n2 0.1 0 0 0 0 0 1\n");
  WriteAll(folder_ / "set" / "config.yaml", "mine: true\n");
  const std::string source = Path("set/poses.txt");
  for (const std::string& out : {Path("set"), folder_.string()}) {
    const CommandResult result = RunHeba({"import", source, "--out", out});
    EXPECT_EQ(result.status, 2) << out;
    EXPECT_THAT(result.err, HasSubstr("which is imported")) << out;
  }
  WriteAll(folder_ / "mine" / "config.yaml", "mine: true\n");
  EXPECT_EQ(RunHeba({"import", source, "--out", Path("mine")}).status, 2);
  EXPECT_EQ(ReadAll(folder_ / "mine" / "config.yaml"), "mine: true\n");
  EXPECT_EQ(RunHeba({"import", source, "--out", Path("new")}).status, 0);
  EXPECT_EQ(RunHeba({"import", source, "--out", Path("new")}).status, 0) << "what import made, it replaces";
  EXPECT_THAT(ReadAll(folder_ / "new" / "poses.csv"), HasSubstr("0.1,0,0"));
}

TEST_F(OtherDataTest, ChecksCamerasOfDataSets) {
  WriteAll(folder_ / "cal_data.yaml", "data:\n  - {image: 0.png, pose: 0.yaml}\n");
  WriteAll(folder_ / "0.yaml", "{x: 0, y: 0, z: 0, qx: 0, qy: 0, qz: 0, qw: 1}\n");
  WriteAll(folder_ / "config.yaml", "static_camera: true\nintrinsics: {fx: 0, fy: 1, cx: 2, cy: 3}\n");
  const CommandResult result = RunHeba({"import", folder_.string(), "--out", Path("../never_made")});
  EXPECT_EQ(result.status, 2);
  EXPECT_THAT(result.err, HasSubstr("fx and fy must be positive"));
}

// Writes detected corners of a chessboard, each displaced by `spoil` (view, pixel).
using Spoil = std::function<Eigen::Vector2d(size_t, const Eigen::Vector2d&)>;
void WriteCorners(const fs::path& folder, const Spoil& spoil) {
  TestSceneOptions options;
  options.noise_px = 0.1;
  const TestScene scene = MakeTestScene(11, options);
  nlohmann::json detections;
  std::vector<PoseRow> rows;
  for (size_t i = 0; i < scene.views.size(); ++i) {
    const View& view = scene.views[i];
    nlohmann::json pixels;
    for (Eigen::Index k = 0; k < view.observations.pixels.cols(); ++k) {
      const Eigen::Vector2d pixel = spoil(i, view.observations.pixels.col(k));
      pixels.push_back({pixel.x(), pixel.y()});
    }
    detections["captures"].push_back({{"image", view.name},
                                      {"image_size", {scene.camera.width_px, scene.camera.height_px}},
                                      {"ids", view.observations.ids},
                                      {"pixels", pixels},
                                      {"reason", ""}});
    rows.push_back({view.name, CaptureRole::kNone, view.camera_mount_from_target_mount, 0, {}});
  }
  WriteAll(folder / "detections.json", detections.dump());
  WriteAll(folder / "poses.csv", PoseFileText(rows, *FindPoseFormat("ros")));
  WriteAll(folder / "camera.yaml", CameraToYaml(scene.camera));
  WriteAll(folder / "config.yaml",
           "setup: eye_to_hand\ntarget: {type: chessboard, rows: 6, columns: 8, square: 30 mm}\ncamera: {intrinsics: "
           "camera.yaml}\ncaptures: {detections: detections.json, poses: poses.csv}\n");
}

TEST_F(OtherDataTest, RunsBundleAdjustmentFromCornersAlone) {
  WriteCorners(folder_, [](size_t, const Eigen::Vector2d& pixel) { return pixel; });
  const CommandResult result = Run();
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_THAT(ReadAll(folder_ / "run" / "result.json"), HasSubstr("\"method\": \"bundle\""));
  // The detections that a run writes can be its input again.
  const std::string again = ReadAll(folder_ / "run" / "detections.json");
  WriteAll(folder_ / "detections.json", again);
  EXPECT_EQ(RunHeba({"run", Path("config.yaml"), "--out", Path("again"), "--quiet"}).status, 0);
  const CommandResult doctor = RunHeba({"doctor", Path("config.yaml"), "--quiet"});
  EXPECT_THAT(doctor.out, HasSubstr("nothing is wrong"));
  EXPECT_THAT(doctor.out, testing::Not(HasSubstr("[lens]")));
}

TEST_F(OtherDataTest, DoctorReportsUnmodelledDistortion) {
  // The displacement has an amplitude of half a pixel and oscillates across the image.
  WriteCorners(folder_, [](size_t, const Eigen::Vector2d& pixel) -> Eigen::Vector2d {
    return pixel + Eigen::Vector2d(0, 0.5 * std::sin(pixel.x() / 60));
  });
  EXPECT_THAT(RunHeba({"doctor", Path("config.yaml"), "--quiet"}).out, HasSubstr("remark [lens]"));
}

}  // namespace
}  // namespace heba
