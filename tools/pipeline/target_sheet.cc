#include "tools/pipeline/target_sheet.h"

#include <cmath>
#include <memory>
#include <optional>
#include <system_error>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/config/yaml_reader.h"
#include "heba/target.h"
#include "targets/render/sheet_file.h"
#include "targets/render/target_text.h"
#include "tools/config/file_kind.h"
#include "tools/text/target_symmetry.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

void CheckOutputs(const fs::path& target, const fs::path& sheet, const fs::path& points) {
  std::error_code not_there;
  for (const fs::path& output : {sheet, points}) {
    if (fs::equivalent(target, output, not_there)) {
      throw InputError(sheet.string() + ": " + output.string() +
                       " would replace the file of the target; choose another name");
    }
  }
  if (fs::exists(points, not_there) && !IsSheetJson(ReadTextFile(points))) {
    throw InputError(sheet.string() + ": " + points.string() +
                     " would be replaced, which does not describe a sheet; choose another name");
  }
}

// Warns that the sheet is spread over several pages.
std::string PagesWarning(const Target& target, const Sheet& sheet) {
  const std::optional<Paper> larger = SmallestPaper(target, sheet.options);
  const Paper& paper = *sheet.options.paper;
  return "the sheet of " + ShownSizeMm(sheet.size_mm) + " does not fit on " + std::string(paper.name) + " (" +
         ShownSizeMm(paper.SizeMm(false)) + "): it is spread over " + std::to_string(sheet.pages.size()) +
         " pages, and a target that is glued together is not as flat and exact as one page; " +
         (larger ? "it fits on " + std::string(larger->name) : "no paper is large enough") +
         ", and 'heba target --suggest' proposes a target for a paper";
}

}  // namespace

std::string ShownSizeMm(const Eigen::Vector2d& size_mm) {
  const auto shown = [](double mm) { return RoundTrip(std::round(10 * mm) / 10); };
  return shown(size_mm.x()) + " x " + shown(size_mm.y()) + " mm";
}

TargetSheet WriteTargetSheet(const std::string& target_text, SheetOptions options, const fs::path& path) {
  // The keys of a target may take the place of its file.
  const bool has_keys = target_text.find('{') != std::string::npos;
  const std::string name = has_keys ? "target" : target_text;
  if (!has_keys) RefuseFolder(name, FileKind::kTarget);
  const ConfigValue value = has_keys ? ParseYaml(target_text, name) : ReadYamlFile(name);
  RefuseOtherKind(value, name, FileKind::kTarget);
  MapReader reader(value);
  const std::unique_ptr<Target> target = CreateTarget(reader);
  options.title = TargetTitle(*target, reader.used());
  options.config = TargetConfigLine(reader.used());
  TargetSheet written{MakeSheet(*target, options), path, {}};
  written.points_file.replace_extension(".json");
  CheckOutputs(target_text, path, written.points_file);
  WriteSheet(written.sheet, path);
  WriteFileAtomically(written.points_file, SheetJson(written.sheet, path));
  if (written.sheet.pages.size() > 1) written.warnings.push_back(name + ": " + PagesWarning(*target, written.sheet));
  if (target->Symmetries().size() > 1) {
    written.warnings.push_back(name + ": " + SymmetryRemark(*target) + "; " + SymmetryCure(*target));
  }
  return written;
}

}  // namespace heba
