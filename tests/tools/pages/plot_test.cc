#include "tools/pages/plot.h"

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
using ::testing::StartsWith;

// Returns the lines of an SVG that contain `part`.
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

// Returns the number after `name="` in a line.
double Attribute(const std::string& line, const std::string& name) {
  const std::string key = " " + name + "=\"";
  const size_t at = line.find(key);
  EXPECT_NE(at, std::string::npos) << name << " in " << line;
  return at == std::string::npos ? 0 : std::stod(line.substr(at + key.size()));
}

Plot OneLine(const std::vector<std::pair<double, double>>& points) {
  Plot plot;
  plot.title = "error";
  plot.x_label = "noise, px";
  plot.y_label = "mm";
  plot.lines = {{"park", points}};
  return plot;
}

// The plot is 530 px wide from x = 70 and 365 px high from y = 40, with a margin of 5 % at each end of the data.
TEST(LogLogSvgTest, PointsAreEvenlySpacedPerDecade) {
  const std::string svg = LogLogSvg(OneLine({{0.1, 1}, {1, 10}, {10, 100}}));
  EXPECT_THAT(LinesWith(svg, "<circle"),
              ElementsAre(HasSubstr("cx=\"94.1\" cy=\"388.4\""), HasSubstr("cx=\"335.0\" cy=\"222.5\""),
                          HasSubstr("cx=\"575.9\" cy=\"56.6\"")));
  EXPECT_THAT(LinesWith(svg, "<polyline"), ElementsAre(HasSubstr("points=\"94.1,388.4 335.0,222.5 575.9,56.6\"")));
}

TEST(LogLogSvgTest, AxesAndLineAreNamed) {
  const std::string svg = LogLogSvg(OneLine({{0.1, 1}, {1, 10}}));
  EXPECT_THAT(svg, AllOf(StartsWith("<svg xmlns="), HasSubstr(">error</text>"), HasSubstr(">noise, px</text>"),
                         HasSubstr(">mm</text>"), HasSubstr(">park</text>")));
}

TEST(LogLogSvgTest, TicksAreAtOneTwoAndFiveOfEachDecade) {
  const std::string svg = LogLogSvg(OneLine({{0.1, 1}, {1, 10}}));
  for (const char* tick : {">0.10<", ">0.20<", ">0.50<", ">1.0<", ">2.0<", ">5.0<", ">10<"}) {
    EXPECT_THAT(svg, HasSubstr(tick));
  }
}

TEST(LogLogSvgTest, ManyDecadesHaveTicksAtPowersOfTenOnly) {
  const std::vector<std::string> ticks = LinesWith(LogLogSvg(OneLine({{1, 1}, {1e5, 2}})), "text-anchor=\"middle\"");
  // The last ones are the names of the axes.
  EXPECT_THAT(ticks, ElementsAre(HasSubstr(">1.0<"), HasSubstr(">10<"), HasSubstr(">100<"), HasSubstr(">1000<"),
                                 HasSubstr(">10000<"), HasSubstr(">1.0e+05<"), HasSubstr("noise"), HasSubstr(">mm<")));
}

TEST(LogLogSvgTest, PointsWithoutALogarithmAreLeftOut) {
  const std::string svg = LogLogSvg(OneLine({{0.1, 0}, {0.2, 1}, {-1, 2}, {1, 10}}));
  EXPECT_EQ(LinesWith(svg, "<circle").size(), 2u);
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  EXPECT_THAT(svg, Not(HasSubstr("inf")));
}

TEST(LogLogSvgTest, SaysThatThereIsNothingToDraw) {
  for (const Plot& plot : {Plot{"title", "x", "y", {}}, OneLine({{0, 1}, {1, -1}})}) {
    const std::string svg = LogLogSvg(plot);
    EXPECT_THAT(svg, HasSubstr("nothing to draw"));
    EXPECT_THAT(LinesWith(svg, "<polyline"), IsEmpty());
    EXPECT_THAT(svg, testing::EndsWith("</svg>\n"));
  }
}

TEST(LogLogSvgTest, APointAloneIsInTheMiddle) {
  EXPECT_THAT(LinesWith(LogLogSvg(OneLine({{3, 7}})), "<circle"), ElementsAre(HasSubstr("cx=\"335.0\" cy=\"222.5\"")));
}

TEST(LogLogSvgTest, ReferencesAreDashedAndLinesHaveColoursOfTheirOwn) {
  Plot plot = OneLine({{1, 1}, {2, 2}});
  plot.lines.push_back({"bound", {{1, 0.5}, {2, 1}}, /*is_reference=*/true});
  plot.lines.push_back({"bundle", {{1, 0.6}, {2, 1.1}}, false, /*is_emphasised=*/true});
  const std::string svg = LogLogSvg(plot);
  EXPECT_THAT(LinesWith(svg, "<polyline"),
              ElementsAre(AllOf(HasSubstr("stroke=\"#0072b2\""), HasSubstr("stroke-width=\"1.5\"")),
                          AllOf(HasSubstr("class=\"reference\""), HasSubstr("stroke-width=\"1.5\"")),
                          AllOf(HasSubstr("stroke=\"#d55e00\""), HasSubstr("stroke-width=\"3\""))));
  // A reference has no dots.
  EXPECT_EQ(LinesWith(svg, "<circle").size(), 4u);
}

// Names of lines that end at one height are moved apart, and stay within the chart.
TEST(LogLogSvgTest, NamesDoNotOverlap) {
  Plot plot = OneLine({{1, 100}, {2, 100}});
  for (const char* name : {"tsai", "shah", "li", "bundle"}) plot.lines.push_back({name, {{1, 1}, {2, 1}}});
  std::vector<double> ys;
  for (const std::string& line : LinesWith(LogLogSvg(plot), "style=\"fill:")) ys.push_back(Attribute(line, "y"));
  ASSERT_EQ(ys.size(), 5u);
  for (size_t i = 1; i < ys.size(); ++i) EXPECT_GE(ys[i] - ys[i - 1], 14 - 1e-9);
  EXPECT_LE(ys.back(), 40 + 365 + 4);
}

TEST(LogLogSvgTest, EscapesAllNames) {
  Plot plot = OneLine({{1, 1}});
  plot.title = plot.x_label = plot.y_label = plot.lines[0].name = "<script>&\"";
  const std::string svg = LogLogSvg(plot);
  EXPECT_THAT(svg, Not(HasSubstr("<script>")));
  EXPECT_EQ(LinesWith(svg, ">&lt;script&gt;&amp;&quot;</text>").size(), 4u);
}

}  // namespace
}  // namespace heba
