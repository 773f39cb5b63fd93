// `heba watch`: captures that come one after the other.
#include <chrono>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/text.h"
#include "tests/pipeline/cli.h"

namespace heba {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// A cell with a requirement that few captures do not meet; poses and images come one after the other, an image in two
// parts.
TEST(WatchCommandTest, EndsWhenTheRequiredAccuracyIsReached) {
  const fs::path folder = TestFolder("watch_command");
  const auto path = [&](const std::string& name) { return (folder / name).string(); };
  ASSERT_EQ(
      RunHeba({"simulate", std::string(HEBA_SOURCE_DIR) + "/configs/manual/cell.yaml", "--out", path("all"), "--quiet"})
          .status,
      0);
  fs::create_directories(folder / "images");
  for (const char* file : {"target.yaml", "camera.yaml"}) fs::copy_file(folder / "all" / file, folder / file);
  WriteAll(path("config.yaml"),
           "setup: eye_to_hand\ntarget: target.yaml\ncamera: {model: brown5, intrinsics: camera.yaml}\n"
           "captures: {images: images, poses: poses.csv}\nrobot: {scale_sigma: 0}\n"
           "evaluate: {folds: 0, require: [{within: 0.5 mm}]}\n");
  CommandResult watch;
  std::thread watching([&] { watch = RunHeba({"watch", path("config.yaml"), "--out", path("run")}); });
  const std::vector<std::string> rows = Split(ReadAll(path("all/poses.csv")), '\n');
  std::string poses = rows[0] + "\n";
  const auto is_done = [&] { return fs::exists(folder / "run.watch.html") && watch.status >= 0; };
  for (size_t i = 1; i < rows.size() && !rows[i].empty() && !is_done(); ++i) {
    const std::string name = Split(rows[i], ',')[0];
    const std::string image = ReadAll(path("all/images/" + name));
    WriteAll(path("images/" + name), image.substr(0, image.size() / 2));
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
    WriteAll(path("images/" + name), image);
    poses += rows[i] + "\n";
    WriteAll(path("poses.csv"), poses);
    // From the third capture on, which is the first with a result, each is looked at before the next one comes.
    const auto is_looked_at = [&] {
      const bool has_page = fs::exists(folder / "run.watch.html");
      return i < 3 || (has_page && ReadAll(path("run.watch.html")).find(name) != std::string::npos);
    };
    const auto begin = std::chrono::steady_clock::now();
    do {
      std::this_thread::sleep_for(std::chrono::milliseconds(300));
    } while (!is_looked_at() && std::chrono::steady_clock::now() - begin < std::chrono::seconds(20));
  }
  watching.join();
  EXPECT_EQ(watch.status, 0) << watch.err;
  EXPECT_THAT(watch.out, HasSubstr("000.png: 24 of 24 points"));
  EXPECT_THAT(watch.out, HasSubstr(" captures: "));
  EXPECT_THAT(watch.out, HasSubstr("covered: x "));
  EXPECT_THAT(watch.out, HasSubstr(", skew "));
  // Before all captures are calibrated again, the new one is compared with those before.
  EXPECT_THAT(watch.out, HasSubstr(" with the captures before; with "));
  EXPECT_THAT(watch.out, HasSubstr("the required accuracy is reached"));
  EXPECT_TRUE(fs::exists(folder / "run" / "result.json"));
  EXPECT_THAT(ReadAll(path("run.watch.html")), HasSubstr("http-equiv=\"refresh\""));
}

// Two cameras, whose captures are there from the start.
TEST(WatchCommandNightly, LooksAtTheImagesOfEveryCamera) {
  const fs::path folder = TestFolder("watch_command_cameras");
  const std::string all = (folder / "all").string();
  ASSERT_EQ(RunHeba({"simulate", std::string(HEBA_SOURCE_DIR) + "/configs/rig/scene.yaml", "--out", all, "--quiet",
                     "--set", "motion.captures=12"})
                .status,
            0);
  const CommandResult watch = RunHeba({"watch", all + "/config.yaml", "--out", (folder / "run").string(), "--set",
                                       "evaluate.folds=0", "--set", "evaluate.require=[{within: 50 mm}]"});
  EXPECT_EQ(watch.status, 0) << watch.err;
  EXPECT_THAT(watch.out, HasSubstr("left/000.png: target plate "));
  EXPECT_THAT(watch.out, HasSubstr("target wall "));
  EXPECT_THAT(watch.out, HasSubstr("wrist covered: x "));
  EXPECT_THAT(watch.out, HasSubstr("the required accuracy is reached"));
}

TEST(WatchCommandTest, RefusesAWrongConfig) {
  const fs::path folder = TestFolder("watch_command_wrong");
  WriteAll(folder / "config.yaml", "setup: eye_to_hnd\ncaptures: {images: images, poses: poses.csv}\n");
  WriteAll(folder / "poses.csv", "image,x,y,z,qx,qy,qz,qw\n0.png,0,0,0,0,0,0,1\n");
  fs::create_directories(folder / "images");
  WriteAll(folder / "images" / "0.png", "");
  const CommandResult watch = RunHeba({"watch", (folder / "config.yaml").string()});
  EXPECT_EQ(watch.status, 2);
  EXPECT_THAT(watch.err, HasSubstr("eye_to_hnd"));
  EXPECT_EQ(RunHeba({"watch", (folder / "none.yaml").string()}).status, 2);
}

}  // namespace
}  // namespace heba
