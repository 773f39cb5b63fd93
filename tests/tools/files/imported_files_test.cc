// The files that `heba import` writes for a rig, read by the readers of a run.
#include "tools/files/imported_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/files.h"
#include "heba/io/result_file.h"
#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"
#include "tools/config/run_config.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

void Write(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  WriteFileAtomically(path, text);
}

void WriteFiles(const ImportedFiles& made, const fs::path& output) {
  for (const auto& [name, text] : made.files) Write(output / name, text);
  Write(output / "config.yaml", made.config);
}

// Three captures of two cameras; each lacks an image in one. `names` are the names of the second camera's images.
ImportedCell CellIn(const fs::path& folder, const std::vector<std::string>& names) {
  ImportedCell rig;
  rig.format = "mchec";
  rig.setup = Setup::kEyeToHand;
  rig.target_name = "chessboard";
  rig.target = "type: chessboard\nrows: 4\ncolumns: 3\nsquare: 0.05 m\n";
  rig.cameras = {{"near", Camera{"pinhole", 640, 480, {600, 601, 319.5, 239.5}}, folder / "near",
                  Rigid3d(ExpRotation({0.1, 0.2, 0.3}), {1, 2, 3})},
                 {"far", std::nullopt, folder / "far", Rigid3d(ExpRotation({-2, 0.2, 0.3}), {-1, 0.5, 3})}};
  rig.captures = {{Rigid3d(ExpRotation({0.5, 0, 0}), {0.1, 0, 0}), {"1.png", ""}},
                  {Rigid3d(ExpRotation({0, 0.5, 0}), {0.2, 0, 0}), {"2.png", names[0]}},
                  {Rigid3d(ExpRotation({0, 0, 0.5}), {0.3, 0, 0}), {"", names[1]}}};
  for (const ImportedCellCapture& capture : rig.captures) {
    for (size_t c = 0; c < 2; ++c) {
      if (!capture.images[c].empty()) Write(rig.cameras[c].images / capture.images[c], "x");
    }
  }
  return rig;
}

void ExpectRead(const TempFolder& folder, const ImportedCell& rig) {
  const fs::path output = folder / "a/b";
  WriteFiles(FilesOf(rig, output), output);
  const RunConfig config = ReadRunConfig(output / "config.yaml");
  const Problem& read = config.data.rig;
  ASSERT_EQ(read.cameras.size(), 2U);
  ASSERT_EQ(read.targets.size(), 1U);
  EXPECT_EQ(read.cameras[0].mount, (Mount{0, Mount::Part::kBase}));
  EXPECT_EQ(read.targets[0].mount, (Mount{0, Mount::Part::kGripper}));
  EXPECT_EQ(read.cameras[0].camera.params, rig.cameras[0].camera->params);
  EXPECT_EQ(config.data.has_camera, (std::vector<bool>{true, false}));
  ASSERT_EQ(config.data.captures.size(), rig.captures.size());
  for (size_t i = 0; i < rig.captures.size(); ++i) {
    const Recording& capture = config.data.captures[i];
    EXPECT_LT(DistanceM(capture.base_from_gripper[0], rig.captures[i].base_from_gripper), 1e-12);
    EXPECT_LT(AngleRad(capture.base_from_gripper[0], rig.captures[i].base_from_gripper), 1e-7);
    for (size_t c = 0; c < 2; ++c) EXPECT_EQ(capture.images[c].filename(), rig.captures[i].images[c]);
  }
  ASSERT_TRUE(config.truth.has_value());
  const CellTruth truth = ReadCellTruth(*config.truth, read);
  for (size_t c = 0; c < 2; ++c) {
    EXPECT_LT(DistanceM(truth.mount_from_camera[c], *rig.cameras[c].mount_from_camera), 1e-12);
    EXPECT_LT(AngleRad(truth.mount_from_camera[c], *rig.cameras[c].mount_from_camera), 1e-7);
  }
}

TEST(ImportedCellFilesTest, AreReadByARun) {
  const TempFolder folder;
  ExpectRead(folder, CellIn(folder.path(), {"2.png", "3.png"}));
}

TEST(ImportedCellFilesTest, HaveAColumnForEachCameraIfTheNamesOfItsImagesDiffer) {
  const TempFolder folder;
  ExpectRead(folder, CellIn(folder.path(), {"right 2.jpg", "right, 3.jpg"}));
}

TEST(ImportedCellFilesTest, HaveNoTruthUnlessItIsKnownOfAllCameras) {
  const TempFolder folder;
  ImportedCell rig = CellIn(folder.path(), {"2.png", "3.png"});
  rig.cameras[1].mount_from_camera.reset();
  WriteFiles(FilesOf(rig, folder / "out"), folder / "out");
  EXPECT_FALSE(ReadRunConfig(folder / "out/config.yaml").truth.has_value());
}

// A set of cameras alone is to be completed: a run names the first key that is missing, and none that is not.
TEST(ImportedCellFilesTest, OfCamerasAloneLackWhatTheUserAdds) {
  const TempFolder folder;
  ImportedCell rig = CellIn(folder.path(), {"2.png", "3.png"});
  rig.setup.reset();
  rig.captures.clear();
  rig.target.clear();
  rig.cameras[0].images.clear();
  WriteFiles(FilesOf(rig, folder / "out"), folder / "out");
  const fs::path config = folder / "out/config.yaml";
  std::vector<std::string> settings;
  const std::pair<std::string, std::string> steps[] = {
      {"'captures' is missing", "captures.poses=" + folder.path().string() + "/poses.csv"},
      {"'mount' is missing", "cameras.near.mount=gripper"},
      {"'images' is missing", "cameras.near.images=" + folder.path().string() + "/near"},
      {"'mount' is missing", "cameras.far.mount=gripper"},
      {"'targets' is missing", ""}};
  Write(folder / "poses.csv", "image,x,y,z,qx,qy,qz,qw\n1.png,0,0,0,0,0,0,1\n2.png,0,0,0,0,0,0,1\n");
  for (const auto& [missing, setting] : steps) {
    EXPECT_THAT(InputErrorOf([&] { ReadRunConfig(config, settings); }), testing::HasSubstr(missing));
    settings.push_back(setting);
  }
}

}  // namespace
}  // namespace heba
