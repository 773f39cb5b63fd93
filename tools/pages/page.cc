#include "tools/pages/page.h"

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <string_view>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "tools/pages/page_assets.h"

namespace heba {
namespace {

// Returns JSON that is safe inside a script element: no string in it can end the element.
std::string EmbeddedJson(const nlohmann::ordered_json& data) {
  std::string text;
  for (const char c : data.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace)) {
    switch (c) {
      case '<':
        text += "\\u003c";
        break;
      case '>':
        text += "\\u003e";
        break;
      case '&':
        text += "\\u0026";
        break;
      default:
        text += c;
    }
  }
  return text;
}

std::string Figure(const std::string& attributes, const std::string& caption, const std::string& content) {
  if (PageScript().empty()) return "";
  const std::string head = caption.empty() ? "" : "<figcaption>" + EscapedForMarkup(caption) + "</figcaption>";
  return "<figure " + attributes + ">" + head + content + "</figure>\n";
}

}  // namespace

std::string HtmlPage(const std::string& title, const std::string& body, PageWidth width) {
  const std::string script(PageScript());
  const std::string allowed = script.empty() ? "'none'" : "'" + std::string(PageScriptHash()) + "'";
  return "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
         "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
         "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; "
         "img-src data:; script-src " +
         allowed + "\">\n<title>" + EscapedForMarkup(title) + "</title>\n<style>" + std::string(PageStyle()) +
         "</style>\n</head>\n<body" + (width == PageWidth::kWide ? " class=\"whole\"" : "") + ">\n" +
         (script.empty() ? "" : "<noscript>" + Paragraph("The charts of this page need JavaScript.") + "</noscript>") +
         body +
         (script.empty()
              ? Paragraph("This page has no charts and its tables cannot be sorted, because heba was built without "
                          "Node.js.")
              : "<script>" + script + "</script>") +
         "\n</body>\n</html>\n";
}

std::string Capitalised(std::string text) {
  // File names and keys stay unchanged.
  const size_t word_end = std::min(text.find(' '), text.size());
  const bool is_word = std::all_of(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(word_end),
                                   [](char c) { return (c >= 'a' && c <= 'z') || c == '\'' || c == ','; });
  if (is_word && !text.empty()) text[0] = static_cast<char>(text[0] - 'a' + 'A');
  return text;
}

std::string Heading(const std::string& text) { return "<h2>" + EscapedForMarkup(text) + "</h2>\n"; }
std::string Paragraph(const std::string& text) { return "<p>" + EscapedForMarkup(text) + "</p>\n"; }

std::string SharedData(const std::string& name, const nlohmann::ordered_json& data) {
  if (PageScript().empty()) return "";
  return "<script type=\"application/json\" id=\"" + EscapedForMarkup(name) + "\">" + EmbeddedJson(data) +
         "</script>\n";
}

std::string ViewFigure(const std::string& view, const std::string& caption, const nlohmann::ordered_json& data) {
  return Figure("data-view=\"" + EscapedForMarkup(view) + "\"", caption,
                "<script type=\"application/json\">" + EmbeddedJson(data) + "</script>");
}

std::string SharedViewFigure(const std::string& view, const std::string& caption, const std::string& shared_data) {
  return Figure("data-view=\"" + EscapedForMarkup(view) + "\" data-from=\"" + EscapedForMarkup(shared_data) + "\"",
                caption, "");
}

std::string CopyableText(const std::string& text) {
  // The text is split at line ends because EscapedForMarkup would replace them by blanks.
  std::vector<std::string> lines;
  for (const std::string& line : Split(text, '\n')) lines.push_back(EscapedForMarkup(line));
  return "<pre class=\"copyable\">" + Join(lines, "\n") + "</pre>\n";
}

std::string Details(const std::string& summary, const std::string& content) {
  return "<details><summary>" + EscapedForMarkup(summary) + "</summary>\n" + content + "</details>\n";
}

std::string LinkTo(const std::string& path) {
  std::string link;
  for (const char c : path) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte) != 0 || std::string_view("-._~/").find(c) != std::string_view::npos) {
      link += c;
      continue;
    }
    char code[4];
    std::snprintf(code, sizeof(code), "%%%02X", byte);
    link += code;
  }
  return link;
}

std::string HtmlTable(const std::vector<std::string>& head, const std::vector<std::vector<PageCell>>& rows,
                      const std::vector<OpenedCapture>& opens) {
  constexpr size_t kLongText = 40;
  std::string table = "<div class=\"wide\"><table>\n<thead><tr>";
  for (size_t column = 0; column < head.size(); ++column) {
    const bool is_number = !rows.empty() && column < rows.front().size() && rows.front()[column].is_number;
    table += std::string("<th scope=\"col\"") + (is_number ? " class=\"number\"" : "") + "><button>" +
             EscapedForMarkup(head[column]) + "</button></th>";
  }
  table += "</tr></thead>\n<tbody>\n";
  for (size_t i = 0; i < rows.size(); ++i) {
    CHECK_EQ(rows[i].size(), head.size()) << "every column has a heading";
    const bool opens_capture = !opens.empty() && !opens[i].data.empty();
    table += opens_capture ? "<tr data-from=\"" + EscapedForMarkup(opens[i].data) + "\" data-capture=\"" +
                                 std::to_string(opens[i].index) + "\">"
                           : "<tr>";
    for (size_t column = 0; column < rows[i].size(); ++column) {
      const PageCell& cell = rows[i][column];
      const std::string kind = cell.is_number ? "number" : (cell.text.size() > kLongText ? "text" : "");
      std::string text = EscapedForMarkup(cell.text);
      if (cell.is_strong) text = "<strong>" + text + "</strong>";
      table +=
          "<td" + (kind.empty() ? "" : " class=\"" + kind + "\"") +
          (head[column].empty() || cell.text.empty() ? "" : " data-head=\"" + EscapedForMarkup(head[column]) + "\"") +
          (cell.text.empty() ? " data-empty>" : ">") +
          (cell.link.empty() ? text : "<a href=\"" + EscapedForMarkup(cell.link) + "\">" + text + "</a>") + "</td>";
    }
    table += "</tr>\n";
  }
  return table + "</tbody>\n</table></div>\n";
}

}  // namespace heba
