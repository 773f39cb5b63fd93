// Self-contained HTML pages: one file that needs no network, light and dark, printable. A page consists of markup
// that is generated here and of JSON data for the views of the page script (tools/pages/web), which draws all charts.
// Without the script a page still shows its text and tables, and says that it has no charts.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace heba {

// Returns a whole page. `body` is markup. A wide page takes the full width of the window.
enum class PageWidth { kText, kWide };
std::string HtmlPage(const std::string& title, const std::string& body, PageWidth width = PageWidth::kText);

// Returns the sentence with a capital first letter, unless its first word is a file name or a key.
std::string Capitalised(std::string text);

// Return the markup of a heading and of a paragraph.
std::string Heading(const std::string& text);
std::string Paragraph(const std::string& text);

// Converts an optional number to JSON, with null for a missing one.
inline nlohmann::ordered_json OrNull(const std::optional<double>& value) {
  return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json(nullptr);
}

// Returns the markup that stores data under a name, for use by several views.
std::string SharedData(const std::string& name, const nlohmann::ordered_json& data);
// Return the markup of a figure that the script draws with the given view, from its own data or from shared data.
// `caption` describes the figure. Both are empty if heba was built without the script.
std::string ViewFigure(const std::string& view, const std::string& caption, const nlohmann::ordered_json& data);
std::string SharedViewFigure(const std::string& view, const std::string& caption, const std::string& shared_data);
// Returns the markup of preformatted text; the script adds a button that copies it.
std::string CopyableText(const std::string& text);
// Returns markup that is collapsed until the reader opens it; `content` is markup.
std::string Details(const std::string& summary, const std::string& content);

// A table cell: text, or a number that is aligned right and sorted by value. `link` is the address that a click
// opens.
struct PageCell {
  std::string text;
  bool is_number = false;
  std::string link = {};
  bool is_strong = false;
};

// Returns a relative path as a percent-encoded link.
std::string LinkTo(const std::string& path);

// The image that a click on a row opens: the i-th of the captures in SharedData(data, ...). Without a name, none.
struct OpenedCapture {
  std::string data;
  size_t index = 0;
};

// Returns the markup of a table that is sorted by a click on a column heading; in a narrow window each row is a block
// that names its cells. `opens` has an entry for each row, or is empty.
std::string HtmlTable(const std::vector<std::string>& head, const std::vector<std::vector<PageCell>>& rows,
                      const std::vector<OpenedCapture>& opens = {});

}  // namespace heba
