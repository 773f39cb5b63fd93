// `heba camera`: a camera alone, without a robot.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heba/io/camera_file.h"
#include "tests/pipeline/cli.h"

namespace heba {
namespace {

using Json = nlohmann::json;
namespace fs = std::filesystem;
using testing::HasSubstr;

class CameraCommandTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder() = TestFolder("camera_command");
    ASSERT_EQ(RunHeba({"simulate", std::string(HEBA_SOURCE_DIR) + "/configs/manual/cell.yaml", "--out", Path("cell"),
                       "--quiet"})
                  .status,
              0);
    WriteAll(Path("camera.yaml"), "target: cell/target.yaml\ncaptures: {images: cell/images}\n");
  }
  static fs::path& folder() {
    static fs::path path;
    return path;
  }
  static std::string Path(const std::string& name) { return (folder() / name).string(); }
};

TEST_F(CameraCommandTest, CalibratesFromImagesAlone) {
  const CommandResult run = RunHeba({"camera", Path("camera.yaml"), "--out", Path("out")});
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("the projection is known to "));
  const Json result = Json::parse(ReadAll(Path("out/result.json")));
  EXPECT_EQ(result["schema"], "heba/camera/1");
  EXPECT_EQ(result["lenses"].size(), 8U);
  EXPECT_EQ(result["captures"].size(), 15U);
  const Camera truth = ReadCameraFile(Path("cell/camera.yaml"));
  constexpr double kSigmas = 5;
  EXPECT_NEAR(result["camera"]["fx"].get<double>(), truth.params[0],
              kSigmas * result["camera"]["std"]["fx"].get<double>());
  for (const char* file :
       {"camera.yaml", "camera_info.yaml", "camera.opencv.yaml", "camchain.yaml", "camera.cameramodel"}) {
    const Camera read = ReadCameraFile(Path(std::string("out/") + file));
    EXPECT_NEAR(read.params[0], result["camera"]["fx"].get<double>(), 1e-6) << file;
  }
  EXPECT_THAT(ReadAll(Path("out/report.html")), HasSubstr("Projection uncertainty"));
  // The file, with its sigmas, serves a calibration with a robot.
  const CommandResult with_robot =
      RunHeba({"run", Path("cell/config.yaml"), "--set", "camera.intrinsics=" + Path("out/camera.yaml"), "--out",
               Path("run"), "--quiet"});
  EXPECT_EQ(with_robot.status, 0) << with_robot.err;
}

TEST_F(CameraCommandTest, TheConfigOfARunServes) {
  const CommandResult run =
      RunHeba({"camera", Path("cell/config.yaml"), "--out", Path("of_run"), "--set", "evaluate.folds=0", "--quiet"});
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_EQ(Json::parse(ReadAll(Path("of_run/result.json")))["camera"]["model"], "brown5");
}

TEST_F(CameraCommandTest, RefusesWhatItCannotUse) {
  const auto run = [](const std::vector<std::string>& settings) {
    std::vector<std::string> arguments = {"camera", Path("camera.yaml"), "--out", Path("bad"), "--quiet"};
    for (const std::string& setting : settings) {
      arguments.emplace_back("--set");
      arguments.push_back(setting);
    }
    return RunHeba(arguments);
  };
  EXPECT_THAT(run({"camera.model=brwn5"}).err, HasSubstr("did you mean 'brown5'?"));
  EXPECT_THAT(run({"captures.exclude=[20.png]"}).err, HasSubstr("there is no image '20.png'"));
  EXPECT_THAT(run({"refine.kinematics=auto"}).err, HasSubstr("unknown key 'kinematics'"));
  const CommandResult few = run({"captures.images=[" + Path("cell/images/000.png") + "]"});
  EXPECT_EQ(few.status, 1);
  EXPECT_THAT(few.err, HasSubstr("heba: error: "));
  EXPECT_FALSE(fs::exists(Path("bad")));
}

}  // namespace
}  // namespace heba
