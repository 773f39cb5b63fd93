#include "tools/pages/summary.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/text.h"

namespace heba {
namespace {
using ::testing::HasSubstr;
using ::testing::StartsWith;

RunResult SingleResult() {
  RunResult result = ShortResult(Setup::kEyeToHand, "chessboard", 48);
  Estimate closed;
  closed.method = "park";
  closed.ok = true;
  closed.errors.holdout_rms_px = 0.5;
  Estimate failed;
  failed.method = "tsai";
  failed.reason = Failure("one axis only");
  failed.errors.holdout_rms_px = 7;
  Estimate refined;
  refined.method = kBundleMethod;
  refined.kind = EstimateKind::kRefined;
  refined.ok = true;
  refined.errors.holdout_rms_px = 0.25;
  refined.solution.emplace();
  refined.solution->covariance.layout = HandEyePoses();
  refined.solution->covariance.matrix = 1e-6 * Eigen::MatrixXd::Identity(12, 12);
  result.estimates = {closed, failed, refined};
  return result;
}

RunResult TwoCameras() {
  RunResult result;
  result.rig.robots = {"robot"};
  result.target_types = {"charuco", "tag"};
  for (const char* const name : {"left", "right"}) {
    ProblemCamera& camera = result.rig.cameras.emplace_back();
    camera.name = name;
    camera.camera = {"pinhole", 640, 480, {600, 600, 320, 240}};
  }
  result.errors.resize(2);
  result.errors[0].holdout_rms_px = 0.3;
  result.errors[1].holdout_rms_px = 0.4;
  result.solution.covariance.layout = UnknownsOf(result.rig);
  result.solution.covariance.matrix = 1e-6 * Eigen::MatrixXd::Identity(12, 12);
  result.images = {{"001", "left", "", true, "", {}},
                   {"001", "right", "", true, "", {}},
                   {"002", "left", "", true, "", {}},
                   {"002", "right", "", false, "", {}},
                   {"003", "left", "", false, "", {}}};
  return result;
}

std::vector<BatchRun> Runs() {
  return {{"alone", SingleResult(), ""}, {"rig", TwoCameras(), ""}, {"bad", {}, "no images"}};
}

TEST(SummaryTest, TheFileHasALineForEachMethodAndCamera) {
  const std::string csv = SummaryCsv(Runs());
  EXPECT_THAT(csv, HasSubstr("\nalone,true,,eye_to_hand,chessboard,48,0,0,park,closed_form,true,good,,0.5,"));
  EXPECT_THAT(csv,
              HasSubstr("\nalone,true,one axis only,eye_to_hand,chessboard,48,0,0,tsai,closed_form,false,good,,,"));
  EXPECT_THAT(csv, HasSubstr("\nrig,true,,base,charuco tag,,3,2,left,refined,true,good,,0.3,"));
  EXPECT_THAT(csv, HasSubstr("\nrig,true,,base,charuco tag,,2,1,right,refined,true,good,,0.4,"));
  EXPECT_THAT(csv, HasSubstr("\nbad,false,no images,,,"));
  const std::vector<std::string> lines = Split(csv, '\n');
  for (size_t i = 0; i + 1 < lines.size(); ++i) {
    EXPECT_EQ(Split(lines[i], ',').size(), Split(lines.front(), ',').size()) << lines[i];
  }
}

TEST(SummaryTest, TheTerminalShowsTheWorstCameraOfACell) {
  const std::string table = SummaryTable(Runs());
  EXPECT_THAT(table, StartsWith("run                      target or rig  captures       hold-out px  sigma mm\n"
                                "                                                   closed  refined\n"));
  EXPECT_THAT(table, HasSubstr("\nalone                    chessboard          0/0    0.500    0.250      1.73\n"));
  EXPECT_THAT(table, HasSubstr("\nrig                      rig, 2 cameras      2/3        -    0.400      1.73\n"));
  EXPECT_THAT(table, HasSubstr("\nbad                      failed: no images\n"));
}

// The chart of hold-out errors has a row for each run with a result.
TEST(SummaryTest, ThePageChartsSingleCamerasAndRigs) {
  const std::string page = SummaryPage("batch", Runs());
  EXPECT_THAT(page, HasSubstr("{\"label\":\"alone\",\"values\":[0.25,0.5]},{\"label\":\"rig\",\"values\":[0.4,null]}"));
  EXPECT_THAT(page, HasSubstr("2 of 3 images"));
  EXPECT_THAT(page, HasSubstr("1 of them failed"));
}

}  // namespace
}  // namespace heba
