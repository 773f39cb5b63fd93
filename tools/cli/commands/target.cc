#include <filesystem>
#include <iostream>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/config/yaml_reader.h"
#include "heba/target.h"
#include "targets/render/sheet.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/text/target_symmetry.h"

namespace heba {

int RunCommand_target(const std::vector<std::string>& arguments) {
  if (FLAGS_out.empty()) throw InputError("'heba target' needs --out SHEET.svg, .pdf or .png");
  const std::filesystem::path path = FLAGS_out;
  SheetOptions options;
  options.dpi = FLAGS_dpi;
  const std::string faults = options.Check();
  if (!faults.empty()) throw InputError("--dpi: " + faults);
  MapReader reader(ReadYamlFile(arguments[0]));
  const std::unique_ptr<Target> target = CreateTarget(reader);
  const Sheet sheet = MakeSheet(*target, options);
  std::filesystem::path json = path;
  json.replace_extension(".json");
  WriteSheet(sheet, path);
  WriteFileAtomically(json, SheetJson(sheet, path));
  std::cout << path.string() << ": " << sheet.page_mm.x() << " x " << sheet.page_mm.y() << " mm, "
            << sheet.points.size() << " points; print at 100 % and check the ruler\n"
            << json.string() << ": the positions of the points" << std::endl;
  if (target->Symmetries().size() > 1) {
    std::cerr << "heba: warning: " << arguments[0] << ": " << SymmetryRemark(*target) << "; " << SymmetryCure(*target)
              << std::endl;
  }
  return kDone;
}

}  // namespace heba
