#include "tools/page.h"

namespace heba {
namespace {

constexpr const char* kStyle = R"(
:root { color-scheme: light dark; --ink: #1b1f24; --paper: #ffffff; --line: #d0d7de; --soft: #f3f5f7; --dim: #57606a; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6edf3; --paper: #0f1318; --line: #30363d; --soft: #181d24; --dim: #9aa4af; }
}
@media print { :root { --ink: #000; --paper: #fff; --line: #bbb; --soft: #fff; --dim: #444; } }
body { margin: 0 auto; padding: 1.5rem; max-width: 75rem; font: 15px/1.5 system-ui, sans-serif; color: var(--ink);
       background: var(--paper); }
h1 { font-size: 1.5rem; margin: 0 0 0.5rem; }
p { margin: 0.4rem 0 1rem; color: var(--dim); }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 0.87rem; font-variant-numeric: tabular-nums; }
th, td { padding: 0.25rem 0.7rem; border-bottom: 1px solid var(--line); text-align: left; white-space: nowrap; }
th { position: sticky; top: 0; background: var(--soft); cursor: pointer; user-select: none; }
th button { all: unset; cursor: pointer; }
th button:focus-visible { outline: 2px solid currentColor; }
th[aria-sort=ascending] button::after { content: " \2191"; }
th[aria-sort=descending] button::after { content: " \2193"; }
td.number { text-align: right; }
tbody tr:hover { background: var(--soft); }
h2 { font-size: 1.15rem; margin: 2rem 0 0.3rem; }
code { font-size: 0.9em; }
svg { display: block; width: 100%; height: auto; font: 12px system-ui, sans-serif; }
svg text { fill: var(--dim); }
.charts { display: flex; flex-wrap: wrap; gap: 1rem; }
.charts svg { flex: 1 1 13rem; }
.grid { stroke: var(--line); }
.frame { fill: none; stroke: var(--line); }
.first { fill: #7aa6da; }
.second { fill: #d2762d; }
.arrow { stroke: #d2762d; stroke-width: 0.8; }
.dot { fill: #4c86c6; }
.ellipse { fill: #7aa6da44; stroke: #4c86c6; stroke-width: 1.5; }
.positive { fill: #d2762d; }
.negative { fill: #4c86c6; }
.verdict { color: var(--ink); font-size: 1.1rem; padding: 0.5rem 0.9rem; border-left: 0.4rem solid #2e8b57; background: var(--soft); }
.verdict.doubtful { border-color: #d29922; }
.verdict.bad { border-color: #d1242f; }
li.doubtful::marker { color: #d29922; content: "? "; }
li.bad::marker { color: #d1242f; content: "! "; }
li.good::marker { color: #2e8b57; content: "+ "; }
)";

// Rows by the clicked column: numbers as numbers, what is empty last.
constexpr const char* kSorting = R"(
for (const head of document.querySelectorAll('th')) {
  head.addEventListener('click', () => {
    const body = head.closest('table').tBodies[0];
    const column = head.cellIndex;
    const up = head.getAttribute('aria-sort') !== 'ascending';
    for (const other of head.parentNode.cells) other.removeAttribute('aria-sort');
    head.setAttribute('aria-sort', up ? 'ascending' : 'descending');
    const key = (row) => row.cells[column].textContent;
    const isEmpty = (text) => text === '' || text === '-';
    const order = (a, b) => {
      const x = key(a), y = key(b);
      if (isEmpty(x) || isEmpty(y)) return isEmpty(x) - isEmpty(y);
      const numeric = row => row.cells[column].className === 'number';
      const difference = numeric(a) && numeric(b) ? Number(x) - Number(y) : x.localeCompare(y, 'en', {numeric: true});
      return up ? difference : -difference;
    };
    for (const row of [...body.rows].sort(order)) body.append(row);
  });
}
)";

}  // namespace

std::string Escaped(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      case '\'':
        escaped += "&#39;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

std::string HtmlPage(const std::string& title, const std::string& body) {
  return "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
         "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
         "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; "
         "script-src 'unsafe-inline'; img-src data:\">\n<title>" +
         Escaped(title) + "</title>\n<style>" + kStyle + "</style>\n</head>\n<body>\n" + body + "\n<script>" +
         kSorting + "</script>\n</body>\n</html>\n";
}

std::string HtmlTable(const std::vector<std::string>& head, const std::vector<std::vector<PageCell>>& rows) {
  std::string table = "<div class=\"wide\"><table>\n<thead><tr>";
  for (const std::string& title : head) table += "<th scope=\"col\"><button>" + Escaped(title) + "</button></th>";
  table += "</tr></thead>\n<tbody>\n";
  for (const std::vector<PageCell>& row : rows) {
    table += "<tr>";
    for (const PageCell& cell : row) {
      table += (cell.is_number ? "<td class=\"number\">" : "<td>") + Escaped(cell.text) + "</td>";
    }
    table += "</tr>\n";
  }
  return table + "</tbody>\n</table></div>\n";
}

}  // namespace heba
