#include "tools/pages/page.h"

#include <cmath>
#include <string>
#include <tuple>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tools/pages/page_assets.h"

namespace heba {
namespace {

using testing::HasSubstr;
using testing::Not;

bool has_script = true;

// Texts that would do harm as markup or in a script, or that are not UTF-8.
struct HostileText {
  const char* name;
  std::string text;
};
void PrintTo(const HostileText& hostile, std::ostream* stream) { *stream << hostile.name; }
const HostileText kScriptEnd = {"script_end", "</script><img src=x onerror=alert(1)>"};
const std::vector<HostileText> kHostileTexts = {{"comment", "<!--<script>"},
                                                kScriptEnd,
                                                {"quotes", "\"' onload='x' \""},
                                                {"entities", "&lt;b&gt;"},
                                                {"not_utf8", "\xff\xfe <b>"}};

}  // namespace

std::string_view PageStyle() { return "body{}"; }
std::string_view PageScript() { return has_script ? "run();" : ""; }
std::string_view PageScriptHash() { return has_script ? "sha256-abc=" : ""; }

namespace {

int CountOf(const std::string& part, const std::string& text) {
  int count = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

class PageTest : public testing::TestWithParam<bool> {
 protected:
  PageTest() { has_script = GetParam(); }
};
INSTANTIATE_TEST_SUITE_P(, PageTest, testing::Bool(),
                         [](const auto& test) { return test.param ? "WithScript" : "Plain"; });

TEST_P(PageTest, ContainsOnlyTheScriptThatItAllows) {
  const std::string page = HtmlPage("a <title>", "<p>body</p>");
  EXPECT_THAT(page, HasSubstr("<title>a &lt;title&gt;</title>"));
  EXPECT_THAT(page, HasSubstr("default-src 'none'"));
  EXPECT_THAT(page, Not(HasSubstr("://")));
  EXPECT_THAT(page, Not(HasSubstr("unsafe-eval")));
}

TEST_P(PageTest, HasNoChartsWithoutTheScriptAndSaysSo) {
  const std::string page = HtmlPage("t", ViewFigure("lines", "caption", {{"x", 1}}) + SharedData("d", {{"y", 2}}) +
                                             SharedViewFigure("pairs", "", "d"));
  if (GetParam()) {
    EXPECT_THAT(page, HasSubstr("script-src 'sha256-abc='"));
    EXPECT_THAT(page, HasSubstr("<script>run();</script>"));
    EXPECT_THAT(page, HasSubstr("<figure data-view=\"lines\"><figcaption>caption</figcaption>"));
    EXPECT_THAT(page, HasSubstr("data-from=\"d\""));
  } else {
    EXPECT_THAT(page, HasSubstr("script-src 'none'"));
    EXPECT_THAT(page, Not(HasSubstr("<script")));
    EXPECT_THAT(page, Not(HasSubstr("<figure")));
    EXPECT_THAT(page, HasSubstr("built without Node.js"));
  }
}

// A reader whose script does not run is told so, once.
TEST_P(PageTest, SaysThatChartsNeedTheScript) {
  const std::string page =
      HtmlPage("t", ViewFigure("lines", "caption", {{"x", 1}}) + SharedViewFigure("pairs", "", "d"));
  EXPECT_EQ(CountOf("<noscript><p>The charts of this page need JavaScript.</p>", page), GetParam() ? 1 : 0);
}

class HostileTextTest : public testing::TestWithParam<std::tuple<bool, HostileText>> {
 protected:
  HostileTextTest() { has_script = std::get<bool>(GetParam()); }
};

TEST_P(HostileTextTest, IsEscaped) {
  const std::string& text = std::get<HostileText>(GetParam()).text;
  const nlohmann::ordered_json data = {{"name", text}, {text, 1}};
  for (const std::string& markup : {ViewFigure("v", text, data), SharedData("d", data),
                                    HtmlTable({text}, {{{text}}}, {{text, 0}}), Heading(text), Paragraph(text)}) {
    // The only tags are those that these functions write.
    for (const char* tag : {"<!--", "<script>", "<img", "<b>"}) EXPECT_THAT(markup, Not(HasSubstr(tag)));
    const bool is_script = has_script && markup.find("application/json") != std::string::npos;
    EXPECT_EQ(CountOf("</script", markup), is_script ? 1 : 0) << markup;
  }
}

INSTANTIATE_TEST_SUITE_P(, HostileTextTest, testing::Combine(testing::Bool(), testing::ValuesIn(kHostileTexts)),
                         [](const auto& test) {
                           return std::string(std::get<bool>(test.param) ? "WithScript_" : "Plain_") +
                                  std::get<HostileText>(test.param).name;
                         });

TEST_P(PageTest, EmbeddedTextIsUnchangedWhenItIsParsedAgain) {
  if (!GetParam()) return;
  const std::string embedded = SharedData("d", {{"name", kScriptEnd.text}});
  const size_t begin = embedded.find('>') + 1;
  const auto read = nlohmann::json::parse(embedded.substr(begin, embedded.rfind("</script>") - begin));
  EXPECT_EQ(read["name"], kScriptEnd.text);
}

TEST_P(PageTest, NonFiniteNumbersAreNull) {
  if (!GetParam()) return;
  EXPECT_THAT(SharedData("d", {{"x", std::nan("")}}), HasSubstr("{\"x\":null}"));
  EXPECT_EQ(OrNull(std::nullopt), nullptr);
}

TEST(PageTableTest, CellsLinkToAnyName) {
  const std::string table =
      HtmlTable({"run", "mm", "<i>"}, {{{"a <b>", false, LinkTo("a <b>: c/report.html")}, {"1", true}, {""}}});
  // Each cell names its column, for narrow windows.
  EXPECT_THAT(table, HasSubstr("<td class=\"number\" data-head=\"mm\">1</td><td data-empty></td>"));
  EXPECT_THAT(table, HasSubstr("<a href=\"a%20%3Cb%3E%3A%20c/report.html\">a &lt;b&gt;</a>"));
}

TEST(PageTableDeathTest, EveryColumnHasAHeading) {
  EXPECT_DEATH(HtmlTable({"run"}, {{{"a"}, {"b"}}}), "every column has a heading");
}

}  // namespace
}  // namespace heba
