#include "tools/page.h"

#include <cctype>
#include <cstdio>
#include <string_view>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "tools/page_assets.h"

namespace heba {
namespace {

// JSON as it can stand in a script element: whatever a string holds, it cannot end the element.
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
  return "<figure " + attributes + ">" +
         (caption.empty() ? "" : "<figcaption>" + EscapedForMarkup(caption) + "</figcaption>") + content +
         "</figure>\n";
}

}  // namespace

std::string HtmlPage(const std::string& title, const std::string& body) {
  const std::string script(PageScript());
  const std::string allowed = script.empty() ? "'none'" : "'" + std::string(PageScriptHash()) + "'";
  return "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
         "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
         "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; "
         "img-src data:; script-src " +
         allowed + "\">\n<title>" + EscapedForMarkup(title) + "</title>\n<style>" + std::string(PageStyle()) +
         "</style>\n</head>\n<body>\n" + body +
         (script.empty() ? Paragraph("This page has no charts, and its tables do not sort: the heba that made it was "
                                     "built without Node.js.")
                         : "<script>" + script + "</script>") +
         "\n</body>\n</html>\n";
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
                      bool opens_captures) {
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
    table += opens_captures ? "<tr data-capture=\"" + std::to_string(i) + "\">" : "<tr>";
    for (const PageCell& cell : rows[i]) {
      const std::string kind = cell.is_number ? "number" : (cell.text.size() > kLongText ? "text" : "");
      const std::string text = EscapedForMarkup(cell.text);
      table += (kind.empty() ? "<td>" : "<td class=\"" + kind + "\">") +
               (cell.link.empty() ? text : "<a href=\"" + EscapedForMarkup(cell.link) + "\">" + text + "</a>") +
               "</td>";
    }
    table += "</tr>\n";
  }
  return table + "</tbody>\n</table></div>\n";
}

}  // namespace heba
