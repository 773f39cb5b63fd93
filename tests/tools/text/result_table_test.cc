#include "tools/text/result_table.h"

#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace heba {
namespace {
using ::testing::HasSubstr;
using ::testing::Not;

Estimate EstimateOf(const std::string& method, double rms_px) {
  Estimate estimate;
  estimate.method = method;
  estimate.kind = EstimateKind::kClosedForm;
  estimate.ok = true;
  estimate.errors.reprojection_rms_px = rms_px;
  estimate.errors.holdout_rms_px = 1.1 * rms_px;
  return estimate;
}

RunResult ResultOf(std::vector<Estimate> estimates) {
  RunResult result = ShortResult(Setup::kEyeToHand, "chessboard", 48);
  result.name = "cell";
  result.estimates = std::move(estimates);
  return WithFinalEstimate(std::move(result));
}

std::vector<std::string> LinesOf(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

TEST(ResultTableTest, HasALineForEachMethodWithAResult) {
  const std::string table = ResultTable(ResultOf({EstimateOf("tsai", 0.5), EstimateOf("park", 0.25)}), Colour::kPlain);
  EXPECT_THAT(table, HasSubstr("\ntsai           0.500"));
  EXPECT_THAT(table, HasSubstr("\npark           0.250"));
}

// Neighbouring figures never run together, however small or large they are.
TEST(ResultTableTest, FiguresHaveABlankBetweenThem) {
  for (const double rms_px : {1e-9, 0.000123456, 0.99999, 12345.678, 9.9e9}) {
    const std::string table = ResultTable(ResultOf({EstimateOf("daniilidis", rms_px)}), Colour::kPlain);
    std::string row;
    for (const std::string& line : LinesOf(table)) {
      if (line.starts_with("daniilidis")) row = line;
    }
    std::istringstream words(row);
    std::vector<std::string> cells;
    for (std::string word; words >> word;) cells.push_back(word);
    ASSERT_EQ(cells.size(), 7U) << row;
    EXPECT_NEAR(std::stod(cells[1]) / rms_px, 1, 0.06) << row;
    EXPECT_NEAR(std::stod(cells[2]) / (1.1 * rms_px), 1, 0.06) << row;
  }
}

TEST(ResultTableTest, MethodsWithoutAResultSayWhyOnceForAReason) {
  Estimate tsai = EstimateOf("tsai", 0.5);
  tsai.ok = false;
  tsai.reason = Failure("one axis only");
  Estimate park = tsai;
  park.method = "park";
  const std::string table = ResultTable(ResultOf({tsai, park, EstimateOf("shah", 1)}), Colour::kPlain);
  EXPECT_THAT(table, HasSubstr("\ntsai, park: no result, one axis only\n"));
}

// A method for a motion of its own does not seem to have failed unless it was asked for.
TEST(ResultTableTest, MethodsForAnotherMotionAreListedIfAskedFor) {
  Estimate two_step = EstimateOf("two_step", 0.5);
  two_step.ok = false;
  two_step.reason = Failure("no capture has the role home");
  const RunResult result = ResultOf({two_step, EstimateOf("shah", 1)});
  EXPECT_THAT(ResultTable(result, Colour::kPlain), Not(HasSubstr("two_step")));
  EXPECT_THAT(ResultTable(result, Colour::kPlain, {"two_step", "shah"}),
              HasSubstr("\ntwo_step: no result, no capture has the role home\n"));
}

TEST(ResultTableTest, TrueErrorsAreThereOnlyWithATruth) {
  Estimate estimate = EstimateOf("shah", 1);
  EXPECT_THAT(ResultTable(ResultOf({estimate}), Colour::kPlain), Not(HasSubstr("true err")));
  estimate.errors.truth = TruthErrors{};
  EXPECT_THAT(ResultTable(ResultOf({estimate}), Colour::kPlain), HasSubstr("true err"));
}

TEST(ResultTableTest, PlainTextHasNoEscapeSequences) {
  const RunResult result = ResultOf({EstimateOf("shah", 1)});
  EXPECT_THAT(ResultTable(result, Colour::kPlain), Not(HasSubstr("\x1b")));
  EXPECT_THAT(ResultTable(result, Colour::kAnsi), HasSubstr("\x1b[1mshah"));
}

// A rig with a camera on the base of its only arm, and a target on the gripper.
RunResult CellOf(const std::string& camera) {
  RunResult result;
  result.name = "cell";
  result.rig.robots = {"robot"};
  result.rig.cameras.push_back({camera, {0, Mount::Part::kBase}, {"pinhole", 640, 480, {600, 600, 320, 240}}});
  result.rig.targets.push_back({"plate", {0, Mount::Part::kGripper}, {}});
  Solution& solution = result.solution;
  solution.poses = {{Rigid3d()}, {Rigid3d()}, {Rigid3d()}};
  solution.cameras = {result.rig.cameras.front().camera};
  solution.shapes.resize(1);
  solution.pixel_sigmas_px = {0.05};
  solution.robot_noise = {RobotNoise{1e-4, 1e-3, 2e-3}};
  solution.smooth_noise = {RobotNoise{3e-4, 1e-3}};
  solution.covariance.layout = UnknownsOf(result.rig);
  const Eigen::Index size = solution.covariance.layout.size();
  solution.covariance.matrix = 1e-6 * Eigen::MatrixXd::Identity(size, size);
  result.errors = {{0.2, 0.3, 0.4, 0.05}};
  return result;
}

TEST(ResultTableTest, OfACellHasALineForEachCamera) {
  const std::string table = ResultTable(CellOf("top"), Colour::kPlain);
  EXPECT_THAT(table, HasSubstr("cell: 1 camera, 1 target, 1 arm\n"));
  EXPECT_THAT(table, HasSubstr("\ntop                 0/0      0.200     0.300     0.400   0.050   0.0500\n"));
  EXPECT_THAT(table, HasSubstr("\ncamera top in base\n  [0.0, 0.0, 0.0] mm"));
  EXPECT_THAT(table, Not(HasSubstr("true err")));
}

// The noise of an arm is described as that of the robot of a single camera.
TEST(ResultTableTest, OfACellDescribesTheNoiseOfTheJointsAndSmoothErrors) {
  EXPECT_THAT(ResultTable(CellOf("top"), Colour::kPlain),
              HasSubstr("\narm robot: noise 0.10 mm and 0.057 deg, each joint 0.11 deg, smooth errors 0.30 mm and "
                        "0.057 deg\n"));
}

}  // namespace
}  // namespace heba
