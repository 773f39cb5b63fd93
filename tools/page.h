// Pages that open anywhere: one file, no network, light and dark, printable. What they hold is markup made here, and
// data as JSON for the views of the pages' script (tools/report); without the script a page has its words and tables.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace heba {

// A whole page. `body` is markup.
std::string HtmlPage(const std::string& title, const std::string& body);

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
// shows. Empty without the script.
std::string ViewFigure(const std::string& view, const std::string& caption, const nlohmann::ordered_json& data);
std::string SharedViewFigure(const std::string& view, const std::string& caption, const std::string& shared_data);

// A cell of a table: text, or a number that it is sorted and aligned by; with `link`, what a click on it opens.
struct PageCell {
  std::string text;
  bool is_number = false;
  std::string link = {};
};

// A path beside the page as a link, whatever its characters.
std::string LinkTo(const std::string& path);

// A table whose columns sort at a click on their heads. Markup. With `opens_captures` a click on the i-th row opens the
// i-th of the captures that SharedData("captures", ...) holds.
std::string HtmlTable(const std::vector<std::string>& head, const std::vector<std::vector<PageCell>>& rows,
                      bool opens_captures = false);

}  // namespace heba
