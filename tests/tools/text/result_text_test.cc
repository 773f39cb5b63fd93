#include "tools/text/result_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace heba {
namespace {
using ::testing::ElementsAre;
using ::testing::Pair;

TEST(CsvFieldTest, QuotesWhatWouldEndAField) {
  EXPECT_EQ(CsvField("plain"), "plain");
  EXPECT_EQ(CsvField("a,b"), "\"a,b\"");
  EXPECT_EQ(CsvField("say \"no\""), "\"say \"\"no\"\"\"");
  EXPECT_EQ(CsvField("two\nlines"), "\"two\nlines\"");
}

TEST(CsvFieldTest, MakesTextOfWhatASpreadsheetWouldCalculate) {
  EXPECT_EQ(CsvField("=1+2"), "'=1+2");
  EXPECT_EQ(CsvField("@SUM(A1,A2)"), "\"'@SUM(A1,A2)\"");
}

TEST(GroupedByReasonTest, NamesEachReasonOnceInTheOrderOfTheMethods) {
  EXPECT_THAT(GroupedByReason({{"tsai", "one axis"}, {"shah", "too few"}, {"park", "one axis"}}),
              ElementsAre(Pair("one axis", "tsai, park"), Pair("too few", "shah")));
}

TEST(PoseTextTest, HasTheDigitsThatTheSigmasDeserve) {
  const Rigid3d pose(Eigen::Quaterniond(-0.5, 0.5, 0.5, 0.5), {0.123456789, -0.2, 0});
  const std::string rough = PoseText(pose, 1.0, 0.01);
  EXPECT_THAT(rough, testing::StartsWith("[123.5, -200.0, 0.0] mm, quaternion xyzw [-0.500, "));
  const std::string fine = PoseText(pose, 1e-4, 1e-6);
  EXPECT_THAT(fine, testing::StartsWith("[123.45679, -200.00000, 0.00000] mm"));
}

TEST(PoseTextTest, WIsNotNegative) {
  const Rigid3d pose(Eigen::Quaterniond(-1, 0, 0, 0), Eigen::Vector3d::Zero());
  EXPECT_THAT(PoseText(pose), testing::EndsWith(" 1.000000]"));
}

TEST(FigureTextTest, IsADashWithoutAValue) {
  EXPECT_EQ(FigureText(std::nullopt), "-");
  EXPECT_EQ(FigureText(0.0123456), "0.0123");
}

TEST(VerdictFailureTest, NamesTheWorstFindingAndItsAction) {
  Verdict verdict;
  verdict.grade = Grade::kBad;
  Finding finding;
  finding.text = "the target is 5 % too large";
  finding.action = "measure the print";
  verdict.findings = {finding};
  EXPECT_EQ(VerdictFailure(verdict), "the verdict is bad (--fail-on): the target is 5 % too large; measure the print");
}

}  // namespace
}  // namespace heba
