#include <algorithm>
#include <filesystem>
#include <iostream>
#include <optional>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/config/yaml_reader.h"
#include "heba/io/camera_file.h"
#include "heba/suggested_target.h"
#include "heba/target.h"
#include "targets/render/sheet.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/text/target_symmetry.h"

namespace heba {

namespace {

// Returns the paper that --paper names; nothing without the flag. Throws InputError if there is no such paper.
std::optional<Eigen::Vector2d> PaperAskedFor() {
  if (FLAGS_paper.empty()) return std::nullopt;
  const PaperSize* const paper = FindEntry(kPaperSizes, FLAGS_paper);
  if (paper == nullptr) {
    throw InputError("--paper: " + Quoted(FLAGS_paper) + " is unknown; one of: " + Join(NamesOf(kPaperSizes), ", ") +
                     DidYouMean(FLAGS_paper, NamesOf(kPaperSizes)));
  }
  return Eigen::Vector2d(paper->width_mm, paper->height_mm);
}

double LengthOf(const char* flag, const std::string& text) {
  if (text.empty()) throw InputError("--suggest needs --" + std::string(flag) + ", such as '0.6 m'");
  const ParsedQuantity parsed = ParseQuantity(text, Quantity::kLength);
  if (!parsed.fault.empty()) throw InputError("--" + std::string(flag) + ": " + parsed.fault);
  if (!(parsed.value > 0)) throw InputError("--" + std::string(flag) + ": must be greater than zero");
  return parsed.value;
}

// Prints a target for the paper, the camera and the distance that the flags name, or writes it to --out.
int Suggest() {
  const std::string type = FLAGS_type.empty() ? "coded_board" : FLAGS_type;
  const std::vector<std::string> types = TargetTypeNames();
  if (std::find(types.begin(), types.end(), type) == types.end()) {
    throw InputError("--type: " + Quoted(type) + " is unknown; one of: " + Join(types, ", ") + DidYouMean(type, types));
  }
  TargetPurpose purpose;
  if (const std::optional<Eigen::Vector2d> paper_mm = PaperAskedFor()) purpose.paper_mm = *paper_mm;
  purpose.distance_m = LengthOf("distance", FLAGS_distance);
  if (FLAGS_camera.empty()) throw InputError("--suggest needs --camera CAMERA.yaml");
  purpose.camera = ReadCameraFile(FLAGS_camera);
  if (purpose.camera.height_px == 0) throw InputError(FLAGS_camera + ": does not state the image size");
  const SuggestedTarget target = SuggestTarget(type, purpose);
  if (target.yaml.empty()) {
    throw InputError("--distance: no " + type + " on this paper fits into the image at " + FLAGS_distance);
  }
  std::string text = "# " + Significant(target.size_mm.x(), 4) + " x " + Significant(target.size_mm.y(), 4) +
                     " mm on " + (FLAGS_paper.empty() ? "a4" : FLAGS_paper) + "; at " + FLAGS_distance + " it covers " +
                     Fixed(100 * target.share_of_height, 0) + " % of the image's height.\n# Its features have " +
                     Fixed(target.feature_px, 0) + " px; " + Fixed(target.least_feature_px, 0) +
                     " px are detected reliably" +
                     (target.feature_px < target.least_feature_px
                          ? ", which this paper does not allow: use larger paper, or come nearer"
                          : "") +
                     ".\n" + target.yaml;
  if (FLAGS_out.empty()) {
    std::cout << text;
  } else {
    WriteFileAtomically(FLAGS_out, text);
    std::cout << "written: " << FLAGS_out << "\nnext: heba target " << FLAGS_out << " --paper "
              << (FLAGS_paper.empty() ? "a4" : FLAGS_paper) << " --out sheet.pdf" << std::endl;
  }
  return kDone;
}

void WarnOfTiles(const Sheet& sheet, const std::filesystem::path& path) {
  if (!sheet.has_tiles()) return;
  const PaperSize* const larger = SmallestPaper(sheet);
  std::cerr << "heba: warning: " << path.string() << ": the sheet of " << Significant(sheet.content_mm.x(), 4) << " x "
            << Significant(sheet.content_mm.y(), 4) << " mm does not fit on " << FLAGS_paper << " and is cut into "
            << sheet.num_tiles.prod() << " pages with an overlap to glue; glued pages are hardly flat"
            << (larger == nullptr ? "" : ", one page of " + std::string(larger->name) + " is better") << std::endl;
}

}  // namespace

int RunCommand_target(const std::vector<std::string>& arguments) {
  if (FLAGS_suggest) return Suggest();
  if (arguments.empty()) throw InputError("'heba target' takes TARGET.yaml, or --suggest");
  if (FLAGS_out.empty()) throw InputError("'heba target' needs --out SHEET.svg, .pdf or .png");
  const std::filesystem::path path = FLAGS_out;
  SheetOptions options;
  options.dpi = FLAGS_dpi;
  options.paper_mm = PaperAskedFor();
  const std::string faults = options.Check();
  if (!faults.empty()) throw InputError("--dpi: " + faults);
  MapReader reader(ReadYamlFile(arguments[0]));
  const std::unique_ptr<Target> target = CreateTarget(reader);
  options.config = FlowText(reader.used());
  const Sheet sheet = MakeSheet(*target, options);
  std::filesystem::path json = path;
  json.replace_extension(".json");
  WriteSheet(sheet, path);
  WriteFileAtomically(json, SheetJson(sheet, path));
  std::cout << path.string() << ": " << Significant(sheet.page_mm.x(), 4) << " x " << Significant(sheet.page_mm.y(), 4)
            << " mm, " << sheet.points.size() << " points; print at 100 % and check both rulers\n"
            << json.string() << ": the positions of the points" << std::endl;
  WarnOfTiles(sheet, path);
  if (target->Symmetries().size() > 1) {
    std::cerr << "heba: warning: " << arguments[0] << ": " << SymmetryRemark(*target) << "; " << SymmetryCure(*target)
              << std::endl;
  }
  return kDone;
}

}  // namespace heba
