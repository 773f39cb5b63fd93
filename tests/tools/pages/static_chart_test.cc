#include "tools/pages/static_chart.h"

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace heba {
namespace {
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

std::vector<std::string> LinesWith(const std::string& svg, const std::string& part) {
  std::vector<std::string> lines;
  size_t begin = 0;
  while (begin < svg.size()) {
    const size_t end = std::min(svg.find('\n', begin), svg.size());
    const std::string line = svg.substr(begin, end - begin);
    if (line.find(part) != std::string::npos) lines.push_back(line);
    begin = end + 1;
  }
  return lines;
}

// Returns a chart whose plot is 100 px wide and high, 88 px from the left and 8 px from the top.
StaticChart SquareChart(const ChartAxis& x, const ChartAxis& y) { return {200, 146, x, y, 88}; }

TEST(StaticChartTest, LinesConnectTheirValues) {
  StaticChart chart = SquareChart({"x", 0, 10}, {"y", 0, 1});
  chart.Line({{0, 0}, {5, 1}, {10, 0.5}}, "second", 2);
  chart.Line({{0, 1}, {10, 1}}, "dim", 1, /*is_dashed=*/true);
  EXPECT_THAT(
      LinesWith(chart.Svg(), "<polyline"),
      ElementsAre(AllOf(HasSubstr("points=\"88.0,108.0 138.0,8.0 188.0,58.0\""),
                        HasSubstr("stroke=\"var(--second)\" stroke-width=\"2.0\""), Not(HasSubstr("dasharray"))),
                  AllOf(HasSubstr("stroke=\"var(--dim)\""), HasSubstr("stroke-dasharray=\"6 4\""))));
}

TEST(StaticChartTest, TheVerticalAxisMayRunDownwards) {
  StaticChart chart = SquareChart({"x", 0, 10}, {"y", 4, 0});
  chart.Dot(0, 1, 2, "first");
  EXPECT_THAT(chart.Svg(), HasSubstr("<circle cx=\"88.0\" cy=\"33.0\" r=\"2.0\" fill=\"var(--first)\"/>"));
}

TEST(StaticChartTest, BarsMayBeGivenByAnyTwoCorners) {
  StaticChart chart = SquareChart({"x", 0, 10}, {"y", 0, 10});
  chart.Bar(8, 2, 3, 7, "first");
  EXPECT_THAT(LinesWith(chart.Svg(), "<rect"),
              ElementsAre(AllOf(HasSubstr("x=\"118.0\" y=\"38.0\" width=\"50.0\" height=\"50.0\""),
                                Not(HasSubstr("opacity")))));
}

TEST(StaticChartTest, RowNamesStandInTheLeftMargin) {
  StaticChart chart = SquareChart({"x", 0, 10}, {"", 2, 0, false, false});
  chart.RowName(0.5, "cell <7>");
  EXPECT_THAT(chart.Svg(), HasSubstr("<text x=\"80.0\" y=\"37.0\" text-anchor=\"end\">cell &lt;7&gt;</text>"));
}

TEST(StaticChartTest, AxesHaveTicksAndNames) {
  const std::string svg = SquareChart({"noise, px", 0, 10}, {"error, mm", 0, 4}).Svg();
  EXPECT_THAT(svg, HasSubstr(">noise, px</text>"));
  EXPECT_THAT(svg, HasSubstr(">error, mm</text>"));
  EXPECT_THAT(LinesWith(svg, "y=\"123.0\""), ElementsAre(HasSubstr(">0<"), HasSubstr(">5<"), HasSubstr(">10<")));
  EXPECT_THAT(LinesWith(svg, "x=\"82.0\""),
              ElementsAre(HasSubstr(">0<"), HasSubstr(">1<"), HasSubstr(">2<"), HasSubstr(">3<"), HasSubstr(">4<")));
}

TEST(StaticChartTest, AxesWithoutTicksHaveNoGrid) {
  const std::string svg = SquareChart({"x", 0, 10, false, false}, {"y", 0, 4, false, false}).Svg();
  EXPECT_THAT(LinesWith(svg, "<line"), IsEmpty());
}

TEST(AxisTicksTest, ALinearAxisHasAtMostTheRequestedSteps) {
  for (const double high : {0.013, 1.0, 3.7, 99.0, 12345.0}) {
    const std::vector<double> ticks = AxisTicks({"", 0, high}, 5);
    EXPECT_GE(ticks.size(), 3u) << high;
    EXPECT_LE(ticks.size(), 6u) << high;
    EXPECT_EQ(ticks.front(), 0) << high;
    EXPECT_LE(ticks.back(), high * (1 + 1e-9)) << high;
  }
}

TEST(AxisTicksTest, ZeroIsExact) { EXPECT_THAT(AxisTicks({"", -0.3, 0.3}, 6), testing::Contains(0.0)); }

TEST(AxisTicksTest, ALogarithmicAxisOfManyDecadesHasPowersOfTen) {
  EXPECT_THAT(AxisTicks({"", 0.01, 100, true}, 6),
              testing::Pointwise(testing::DoubleNear(1e-9), {0.01, 0.1, 1.0, 10.0, 100.0}));
  EXPECT_THAT(AxisTicks({"", 0.9, 12, true}, 6), testing::Pointwise(testing::DoubleNear(1e-9), {1.0, 2.0, 5.0, 10.0}));
}

TEST(DumbbellChartTest, JoinsTheTwoValuesOfARow) {
  const std::string svg = DumbbellChart("RMS, px", {{"run 1", 0.1, 0.4}});
  const std::vector<std::string> dots = LinesWith(svg, "<circle");
  EXPECT_THAT(dots, ElementsAre(HasSubstr("var(--second)"), HasSubstr("var(--first)")));
  EXPECT_EQ(LinesWith(svg, "<polyline").size(), 1u);
  EXPECT_THAT(svg, HasSubstr(">run 1</text>"));
  EXPECT_THAT(svg, HasSubstr(">RMS, px</text>"));
}

TEST(DumbbellChartTest, ARowMayHaveOneValue) {
  const std::string svg = DumbbellChart("px", {{"run 1", 0.1, std::nullopt}, {"run 2", std::nullopt, 0.2}});
  EXPECT_THAT(LinesWith(svg, "<circle"), ElementsAre(HasSubstr("var(--first)"), HasSubstr("var(--second)")));
  EXPECT_THAT(LinesWith(svg, "<polyline"), IsEmpty());
}

TEST(DumbbellChartTest, LeavesOutWhatALogarithmicAxisCannotShow) {
  const std::string svg = DumbbellChart("px", {{"zero", 0.0, 0.2},
                                               {"none", std::nullopt, std::nullopt},
                                               {"negative", -1.0, std::nullopt},
                                               {"nan", std::numeric_limits<double>::quiet_NaN(), std::nullopt}});
  EXPECT_EQ(LinesWith(svg, "<circle").size(), 1u);
  EXPECT_THAT(svg, HasSubstr(">zero</text>"));
  for (const char* name : {">none<", ">negative<", ">nan<"}) EXPECT_THAT(svg, Not(HasSubstr(name)));
  EXPECT_EQ(DumbbellChart("px", {{"zero", 0.0, std::nullopt}}), "");
  EXPECT_EQ(DumbbellChart("px", {}), "");
}

TEST(DumbbellChartTest, LongNamesKeepTheirEnd) {
  const std::string svg = DumbbellChart("px", {{std::string(40, 'a') + "_run_7", 0.1, 0.2}});
  EXPECT_THAT(svg, HasSubstr(">.." + std::string(20, 'a') + "_run_7<"));
}

TEST(DumbbellChartTest, LongNamesAreCutBetweenCharacters) {
  std::string umlauts;
  for (int i = 0; i < 26; ++i) umlauts += "\xC3\xA4";
  const std::string svg = DumbbellChart("px", {{"abc" + umlauts, 0.1, 0.2}});
  EXPECT_THAT(svg, HasSubstr(">.." + umlauts + "<"));
  // The left margin is that of 28 letters.
  EXPECT_THAT(svg, HasSubstr("<text x=\"204.0\""));
}

}  // namespace
}  // namespace heba
