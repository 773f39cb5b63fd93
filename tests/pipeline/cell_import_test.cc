// Rigs from the data sets of other projects, through the program.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/io/pose_file.h"
#include "tests/pipeline/cli.h"
#include "tests/support/data_sets.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;

// Makes the folder of a METRIC data set from two recorded cameras, with links to their images.
void WriteMetricSet(const fs::path& folder) {
  for (const int number : {1, 2}) {
    const std::string digit = std::to_string(number);
    const fs::path recorded = DataDir() / ("metric_workcell_camera" + digit);
    const fs::path camera = folder / ("camera" + digit);
    fs::create_directories(camera / "pose");
    fs::create_directories(folder / "GT");
    fs::create_directory_symlink(fs::canonical(recorded / "images"), camera / "image");
    fs::copy_file(recorded / "original/intrinsic_pars_file.yaml", camera / "intrinsic_pars_file.yaml");
    fs::copy_file(recorded / "original/CalibrationInfo.yaml", folder / "CalibrationInfo.yaml",
                  fs::copy_options::overwrite_existing);
    const std::string truth = "gt_cam" + digit + ".csv";
    fs::copy_file(recorded / "original" / truth, folder / "GT" / truth);
    PoseFormat matrix = *FindPoseFormat("matrix");
    for (const PoseRow& row : ReadPoseFile(recorded / "poses.csv", *FindPoseFormat("ros"))) {
      std::string text;
      for (const double value : NumbersFromPose(matrix, row.pose)) text += RoundTrip(value) + "\n";
      WriteAll(camera / "pose" / (fs::path(row.image).stem().string() + ".csv"), text);
    }
  }
}

TEST(CellImportNightly, CalibratesTheMetricDataSet) {
  for (const char* name : {"metric_workcell_camera1", "metric_workcell_camera2"}) HEBA_SKIP_WITHOUT(DataDir() / name);
  const fs::path folder = TestFolder("rig_import");
  WriteMetricSet(folder / "set");
  const std::string out = (folder / "imported").string();
  const CommandResult imported = RunHeba({"import", (folder / "set").string(), "--out", out});
  ASSERT_EQ(imported.status, 0) << imported.err;
  // 63 and 121 images, 44 of which have the same numbers.
  EXPECT_THAT(imported.out, HasSubstr("2 cameras, 140 captures, read as mchec"));
  const CommandResult run =
      RunHeba({"run", out + "/config.yaml", "--out", (folder / "run").string(), "--quiet", "--set",
               "refine.intrinsics=[]", "--set", "evaluate.folds=0", "--set", "refine.robot_noise=white"});
  ASSERT_EQ(run.status, 0) << run.err;
  const nlohmann::json result = nlohmann::json::parse(ReadAll(folder / "run/result.json"));
  for (const char* camera : {"camera1", "camera2"}) {
    // Another program's estimate from one camera alone is 1.1 mm from the truth (README of the data).
    const nlohmann::json& truth = result["errors"][camera]["truth"];
    EXPECT_LT(truth["mm"].get<double>(), 1.0) << camera;
    // With the principal point as the file states it, the rotation is wrong by 0.06 deg.
    EXPECT_LT(truth["deg"].get<double>(), 0.03) << camera;
  }
}

TEST(CellImportTest, KeepsTheImportedFiles) {
  const fs::path folder = TestFolder("rig_import_kept");
  WriteAll(
      folder / "camchain.yaml",
      "cam0: {camera_model: pinhole, intrinsics: [700, 701, 640, 360], distortion_model: none, distortion_coeffs: "
      "[], resolution: [1280, 720]}\ncam1: {camera_model: pinhole, intrinsics: [700, 701, 640, 360], "
      "distortion_model: none, distortion_coeffs: [], resolution: [1280, 720], T_cn_cnm1: [[1, 0, 0, -0.1], [0, 1, "
      "0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}\n");
  const std::string chain = (folder / "camchain.yaml").string();
  const CommandResult refused = RunHeba({"import", chain, "--out", folder.string()});
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, HasSubstr("which is imported"));
  const std::string out = (folder / "out").string();
  EXPECT_EQ(RunHeba({"import", chain, "--out", out}).status, 0);
  EXPECT_EQ(RunHeba({"import", chain, "--out", out}).status, 0) << "what import made, it replaces";
  EXPECT_THAT(ReadAll(folder / "out/config.yaml"), HasSubstr("intrinsics: cam1.yaml"));
  const CommandResult run = RunHeba({"run", out + "/config.yaml"});
  EXPECT_EQ(run.status, 2);
  EXPECT_THAT(run.err, HasSubstr("'captures' is missing"));
}

}  // namespace
}  // namespace heba
