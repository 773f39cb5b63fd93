// `heba tcp`: the tip of a tool from touches of one point.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/pipeline/cli.h"

namespace heba {
namespace {

using testing::HasSubstr;

// Quarter turns about the axes of the base, with the tip at (0, 0, 100 mm) of the gripper at (500, 0, 0) mm.
constexpr const char* kTouches =
    "x,y,z,rx,ry,rz\n"
    "500,0,-100,0,0,0\n"
    "500,100,0,90,0,0\n"
    "400,0,0,0,90,0\n"
    "500,-100,0,-90,0,0\n";
constexpr const char* kFormat =
    "{columns: [x, y, z, rx, ry, rz], translation: mm, rotation: extrinsic_xyz, angle: deg}";

TEST(TcpCommandTest, FindsTheTip) {
  const std::filesystem::path folder = TestFolder("tcp_command");
  WriteAll(folder / "touches.csv", kTouches);
  const CommandResult tip = RunHeba({"tcp", (folder / "touches.csv").string(), "--pose_format", kFormat});
  EXPECT_EQ(tip.status, 0) << tip.err;
  EXPECT_THAT(tip.out, HasSubstr("tool: {translation: ["));
  const CommandResult json = RunHeba({"tcp", (folder / "touches.csv").string(), "--pose_format", kFormat, "--json"});
  const nlohmann::json result = nlohmann::json::parse(json.out);
  EXPECT_NEAR(result["tip_in_gripper_m"][0].get<double>(), 0, 1e-9);
  EXPECT_NEAR(result["tip_in_gripper_m"][2].get<double>(), 0.1, 1e-9);
  EXPECT_NEAR(result["touched_in_base_m"][0].get<double>(), 0.5, 1e-9);
}

TEST(TcpCommandTest, SaysWhatIsMissing) {
  const std::filesystem::path folder = TestFolder("tcp_command_few");
  WriteAll(folder / "few.csv", "x,y,z,rx,ry,rz\n500,0,-100,0,0,0\n500,0,-100,0,0,45\n500,0,-100,0,0,90\n");
  const CommandResult tip = RunHeba({"tcp", (folder / "few.csv").string(), "--pose_format", kFormat});
  EXPECT_EQ(tip.status, 1);
  EXPECT_THAT(tip.err, HasSubstr("the poses differ by rotations about one axis only"));
  EXPECT_EQ(RunHeba({"tcp", (folder / "none.csv").string()}).status, 2);
}

}  // namespace
}  // namespace heba
