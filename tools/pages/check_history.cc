#include "tools/pages/check_history.h"

#include <algorithm>
#include <cmath>
#include <system_error>
#include <vector>

#include <nlohmann/json.hpp>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "tools/files/check_file.h"
#include "tools/pages/page.h"
#include "tools/pages/report_record.h"
#include "tools/text/check_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

using Json = nlohmann::ordered_json;

constexpr const char* kSchema = "heba/check_history/1";

Json ReadHistory(const fs::path& file) {
  std::error_code error;
  if (!fs::exists(file, error)) return Json{{"schema", kSchema}, {"checks", Json::array()}};
  Json history = Json::parse(ReadTextFile(file), nullptr, /*allow_exceptions=*/false);
  if (!history.is_object() || history.value("schema", "") != kSchema || !history["checks"].is_array()) {
    throw InputError(file.string() + ": is not a history of checks");
  }
  return history;
}

// The length of the most likely change of a pose in a check, and the smallest that would have been seen, mm; zero if
// the entry has none.
struct ChangeMm {
  double found = 0;
  double seen = 0;
};
ChangeMm ChangeOf(const Json& entry) {
  if (!entry.is_object() || !entry.contains("changes")) return {};
  for (const Json& change : entry["changes"]) {
    if (!change.contains("translation_mm") || !change.contains("smallest_seen")) continue;
    ChangeMm result;
    for (const Json& mm : change["translation_mm"]) {
      if (mm.is_number()) result.found = std::hypot(result.found, mm.get<double>());
    }
    const Json& seen = change["smallest_seen"];
    if (seen.contains("translation_mm") && seen["translation_mm"].is_number()) {
      result.seen = seen["translation_mm"].get<double>();
    }
    return result;
  }
  return {};
}

// Returns a chart of the changes: a dot for each check, and a tick at the smallest change that would have been seen.
std::string Chart(const Json& checks) {
  constexpr double kWidth = 720;
  constexpr double kHeight = 180;
  double largest = 0;
  for (const Json& entry : checks) largest = std::max({largest, ChangeOf(entry).found, ChangeOf(entry).seen});
  if (largest <= 0) return "";
  const auto y = [&](double mm) { return Fixed(kHeight - 10 - (kHeight - 30) * mm / largest, 1); };
  std::string svg =
      "<svg viewBox=\"0 0 720 180\" role=\"img\" aria-label=\"changes over the checks\" "
      "style=\"max-width:720px;width:100%;height:auto\">";
  svg += "<text x=\"4\" y=\"14\" font-size=\"12\" fill=\"currentColor\">" + Significant(largest, 2) + " mm</text>";
  const double step = kWidth / static_cast<double>(checks.size() + 1);
  for (size_t i = 0; i < checks.size(); ++i) {
    const ChangeMm change = ChangeOf(checks[i]);
    const double x = step * static_cast<double>(i + 1);
    const bool has_moved = checks[i].value("decision", "") == "moved";
    svg += "<line x1=\"" + Fixed(x - 6, 1) + "\" x2=\"" + Fixed(x + 6, 1) + "\" y1=\"" + y(change.seen) + "\" y2=\"" +
           y(change.seen) + "\" stroke=\"currentColor\"/>";
    svg += "<circle cx=\"" + Fixed(x, 1) + "\" cy=\"" + y(change.found) + "\" r=\"4\" fill=\"" +
           (has_moved ? "rgb(200,60,40)" : "rgb(13,148,136)") + "\"/>";
  }
  return svg + "</svg>";
}

std::string TextOf(const Json& entry, const char* key) {
  if (!entry.is_object() || !entry.contains(key)) return "-";
  const Json& value = entry[key];
  if (value.is_string()) return value.get<std::string>();
  if (value.is_number_integer()) return std::to_string(value.get<int>());
  return value.is_number() ? Significant(value.get<double>(), 2) : "-";
}

std::string Page(const std::string& run, const Json& checks) {
  std::vector<std::vector<PageCell>> rows;
  for (auto entry = checks.rbegin(); entry != checks.rend(); ++entry) {
    const ChangeMm change = ChangeOf(*entry);
    rows.push_back({{TextOf(*entry, "time")},
                    {TextOf(*entry, "decision")},
                    {TextOf(*entry, "body")},
                    {Significant(change.found, 2), true},
                    {Significant(change.seen, 2), true},
                    {TextOf(*entry, "p_value"), true},
                    {TextOf(*entry, "images"), true}});
  }
  return HtmlPage(
      "Checks of " + run,
      "<h1>Checks of " + EscapedForMarkup(run) + "</h1>\n" +
          Paragraph("The change of the most likely part in each check (dot), and the smallest change that would "
                    "have been seen in 95 % (line).") +
          Chart(checks) +
          HtmlTable({"time", "decision", "what", "change, mm", "smallest seen, mm", "p", "images"}, rows));
}

}  // namespace

void AddToHistory(const fs::path& folder, const std::string& run, const Problem& rig, const SessionCheck& check) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw InputError("--history: " + folder.string() + ": " + error.message());
  const fs::path file = folder / "history.json";
  Json history = ReadHistory(file);
  Json entry = Json::parse(CheckToJson(rig, check));
  entry["time"] = TimeNow();
  entry["run"] = run;
  history["checks"].push_back(std::move(entry));
  WriteFileAtomically(file, history.dump(1) + "\n");
  WriteFileAtomically(folder / "history.html", Page(run, history["checks"]));
}

}  // namespace heba
