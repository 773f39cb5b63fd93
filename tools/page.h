// Pages that open anywhere: one file, no network, light and dark, printable.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace heba {

// Text as it can stand in markup, within attributes too: nothing of it is markup.
std::string Escaped(std::string_view text);

// A whole page. `body` is markup.
std::string HtmlPage(const std::string& title, const std::string& body);

// A cell of a table: text, or a number that it is sorted and aligned by.
struct PageCell {
  std::string text;
  bool is_number = false;
};

// A table whose columns sort at a click on their heads. Markup.
std::string HtmlTable(const std::vector<std::string>& head, const std::vector<std::vector<PageCell>>& rows);

}  // namespace heba
