// Runs of a recorded stream of a robot's poses and one of a camera's, each with a clock of its own.
#include <fstream>
#include <sstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/pipeline/cli.h"
#include "tests/support/data_sets.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using Json = nlohmann::json;
using testing::HasSubstr;

class StreamTest : public testing::Test {
 protected:
  void SetUp() override {
    HEBA_SKIP_WITHOUT(DataDir() / "ehec_streams");
    folder_ = TestFolder("stream");
  }
  // Writes a copy of a file of poses whose clock is ahead by this time.
  fs::path Shifted(const std::string& file, double ahead_s) const {
    std::ifstream in(DataDir() / "ehec_streams" / file);
    const fs::path path = folder_ / file;
    std::ofstream out(path);
    out.precision(17);
    for (std::string line; std::getline(in, line);) {
      const size_t comma = line.find(',');
      out << std::stod(line.substr(0, comma)) + ahead_s << line.substr(comma) << "\n";
    }
    return path;
  }
  CommandResult Run(const std::string& robot, const fs::path& camera) const {
    const std::string form =
        "pose_format: {columns: [time, x, y, z, qx, qy, qz, qw], translation: m, rotation: quaternion_xyzw}";
    std::ofstream(folder_ / "config.yaml")
        << "setup: eye_in_hand\ncaptures:\n  target_poses: {file: " << camera.string() << ", " << form
        << ", poses_are: target_from_camera}\n  stream: " << (DataDir() / "ehec_streams" / robot).string() << "\n  "
        << form << "\n";
    return RunHeba({"run", (folder_ / "config.yaml").string(), "--out", (folder_ / "run").string()});
  }
  double OffsetS() const { return Json::parse(ReadAll(folder_ / "run" / "result.json"))["time_offset"]["value_s"]; }

  fs::path folder_;
};

using StreamNightly = StreamTest;

TEST_F(StreamNightly, OffsetFollowsTheClockOfTheCamera) {
  const CommandResult run = Run("real_robot.csv", Shifted("real_target_in_camera.csv", 0));
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("the robot's clock is"));
  const double offset_s = OffsetS();
  // An independent correlation of the angular speeds has found 15 ms.
  EXPECT_NEAR(offset_s, -0.015, 0.005);
  EXPECT_EQ(RunHeba({"doctor", (folder_ / "config.yaml").string()}).status, 0);
  for (const double ahead_s : {-0.7, 0.4}) {
    ASSERT_EQ(Run("real_robot.csv", Shifted("real_target_in_camera.csv", ahead_s)).status, 0);
    EXPECT_NEAR(OffsetS(), offset_s - ahead_s, 0.001) << ahead_s;
    EXPECT_EQ(RunHeba({"doctor", (folder_ / "config.yaml").string()}).status, 0);
  }
}

TEST_F(StreamTest, OffsetOfASimulatedRobotIsSmall) {
  const CommandResult run = Run("sim_hand.csv", Shifted("sim_camera.csv", 0));
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_NEAR(OffsetS(), 0.0007, 0.0008);
}

}  // namespace
}  // namespace heba
