// Pages that open anywhere: one file, no network, light and dark, printable. What they hold is markup made here, and
// data as JSON for the views of the pages' script (tools/pages/web); without the script a page has its words and
// tables.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace heba {

// A whole page. `body` is markup. A wide page takes all of the window.
enum class PageWidth { kText, kWide };
std::string HtmlPage(const std::string& title, const std::string& body, PageWidth width = PageWidth::kText);

// A sentence with a capital at its beginning, unless that is a file's name or a key.
std::string Capitalised(std::string text);

// Markup of a heading, and of a paragraph.
std::string Heading(const std::string& text);
std::string Paragraph(const std::string& text);

// A figure as the views have it.
inline nlohmann::ordered_json OrNull(const std::optional<double>& value) {
  return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json(nullptr);
}

// Data for several views, under a name.
std::string SharedData(const std::string& name, const nlohmann::ordered_json& data);
// What the script draws by its view of this name, from data of its own or from shared data; `caption` says what it
// shows. `picture` is markup of the same chart for a reader without a script (static_chart.h); empty for none.
std::string ViewFigure(const std::string& view, const std::string& caption, const nlohmann::ordered_json& data,
                       const std::string& picture = "");
std::string SharedViewFigure(const std::string& view, const std::string& caption, const std::string& shared_data,
                             const std::string& picture = "");
// Text to be copied as it stands; the script puts a button beside it.
std::string CopyableText(const std::string& text);
// Markup that is hidden until it is asked for; `content` is markup.
std::string Details(const std::string& summary, const std::string& content);

// A cell of a table: text, or a number that it is sorted and aligned by; with `link`, what a click on it opens.
struct PageCell {
  std::string text;
  bool is_number = false;
  std::string link = {};
  bool is_strong = false;
};

// A path beside the page as a link, whatever its characters.
std::string LinkTo(const std::string& path);

// A table whose columns sort at a click on their heads; in a narrow window each row is a block that names its cells.
// Markup. With `opens_captures` a click on the i-th row opens the
// i-th of the captures that SharedData("captures", ...) holds.
std::string HtmlTable(const std::vector<std::string>& head, const std::vector<std::vector<PageCell>>& rows,
                      bool opens_captures = false);

}  // namespace heba
