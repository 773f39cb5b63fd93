#include <cmath>
#include <filesystem>
#include <iostream>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/data/scale_sigmas.h"
#include "heba/io/camera_file.h"
#include "targets/render/papers.h"
#include "targets/render/suggestion.h"
#include "tools/cli/command.h"
#include "tools/cli/command_table.h"
#include "tools/cli/flags.h"
#include "tools/pipeline/target_sheet.h"
#include "tools/text/console.h"

namespace heba {
namespace {

const Paper& ParsePaper() {
  const Paper* const paper = FindEntry(Papers(), FLAGS_paper);
  if (paper == nullptr) {
    throw InputError("--paper needs one of " + Join(NamesOf(Papers()), ", ") + ", not " + Quoted(FLAGS_paper) +
                     DidYouMean(FLAGS_paper, NamesOf(Papers())));
  }
  return *paper;
}

// Returns the faults of Check(), one per line, as one line.
std::string OnOneLine(const std::string& faults) { return Join(Split(faults, '\n'), "; "); }

double ParseDistanceM() {
  const ParsedQuantity distance = ParseQuantity(FLAGS_distance, Quantity::kLength);
  if (!distance.fault.empty()) throw InputError("--distance: " + Quoted(FLAGS_distance) + " " + distance.fault);
  return distance.value;
}

// Returns the suggestion as a target's file, with what was found in its comments.
std::string SuggestionFile(const Suggestion& suggestion, const SuggestionOptions& options) {
  const auto percent = [](double share) { return Fixed(100 * share, 0) + " %"; };
  std::string text = "# Proposed by heba target --suggest --paper " + std::string(options.paper.name) +
                     " --distance '" + FLAGS_distance + "' --camera " + Quoted(FLAGS_camera) + " --target-type " +
                     options.type + "\n";
  text += "# " + ShownSizeMm(suggestion.drawing_mm) + " with its border, on " + std::string(options.paper.name) +
          " of " + ShownSizeMm(suggestion.page_mm) + "\n";
  text += "# At " + RoundTrip(std::round(1000 * options.distance_m)) + " mm " + suggestion.feature + " has " +
          Significant(suggestion.feature_px, 3) + " px; the target takes " + percent(suggestion.height_share) +
          " of the image's height and " + percent(suggestion.width_share) + " of its width\n";
  text += "# In a simulated image (tilt " + RoundTrip(kTrialTiltDeg) + " deg, blur " + RoundTrip(kTrialBlurPx) +
          " px, noise " + RoundTrip(kTrialNoiseGrey) + " grey) " + std::to_string(suggestion.num_found) + " of " +
          std::to_string(suggestion.num_points) + " points are found; its pose has a sigma of at most " +
          Significant(1000 * suggestion.sigma.position_m, 2) + " mm and " +
          Significant(RadToDeg(suggestion.sigma.rotation_rad), 2) + " deg, from the noise of the image alone\n";
  return text + suggestion.config + "scale_sigma: " + Significant(100 * kSheetScaleSigma, 2) +
         " %  # of a sheet printed true to scale; 0.1 % once it is measured over its whole length\n";
}

int Suggest() {
  for (const auto& [name, value] :
       {std::pair("paper", FLAGS_paper), std::pair("distance", FLAGS_distance), std::pair("camera", FLAGS_camera)}) {
    if (value.empty()) {
      throw InputError("--suggest needs --paper, --distance and --camera; --" + std::string(name) + " is missing");
    }
  }
  SuggestionOptions options;
  options.type = FLAGS_target_type;
  options.paper = ParsePaper();
  options.distance_m = ParseDistanceM();
  options.camera = ReadCameraFile(FLAGS_camera);
  if (options.camera.width_px == 0) throw InputError(FLAGS_camera + ": the file states no image size; add it");
  if (const std::string faults = OnOneLine(options.Check()); !faults.empty()) throw InputError("--suggest: " + faults);
  const std::filesystem::path path = FLAGS_out;
  if (!path.empty() && path.extension() != ".yaml") {
    throw InputError(path.string() + ": a proposed target is written as .yaml");
  }
  const Outcome<Suggestion> suggestion = SuggestTarget(options);
  if (!suggestion) {
    PrintError(suggestion.reason() + "; use a larger paper, a shorter distance or another --target-type");
    return kWorkFailed;
  }
  const std::string text = SuggestionFile(*suggestion, options);
  if (path.empty()) {
    std::cout << text << std::flush;
    return kDone;
  }
  WriteFileAtomically(path, text);
  std::cout << path.string() << ": " << options.type << ", " << suggestion->num_points << " points; 'heba target "
            << path.string() << " --paper " << options.paper.name << " --out SHEET.pdf' writes the sheet" << std::endl;
  return kDone;
}

}  // namespace

int RunCommand_target(const std::vector<std::string>& arguments) {
  if (FLAGS_suggest) {
    if (!arguments.empty()) throw InputError("--suggest proposes a target, and takes no " + arguments[0]);
    return Suggest();
  }
  if (arguments.empty())
    throw InputError("TARGET.yaml is missing: heba target TARGET.yaml; --suggest proposes a target");
  for (const std::string name : {"distance", "camera", "target-type"}) {
    if (IsFlagGiven(name)) throw InputError("--" + name + " belongs to --suggest, which is missing");
  }
  if (FLAGS_out.empty()) throw InputError("'heba target' needs --out SHEET.svg, .pdf or .png");
  const std::filesystem::path path = FLAGS_out;
  SheetOptions options;
  options.dpi = FLAGS_dpi;
  if (const std::string faults = OnOneLine(options.Check()); !faults.empty()) throw InputError("--dpi: " + faults);
  if (!FLAGS_paper.empty()) options.paper = ParsePaper();
  const TargetSheet written = WriteTargetSheet(arguments[0], options, path);
  const size_t num_pages = written.sheet.pages.size();
  std::cout << path.string() << ": " << (num_pages > 1 ? std::to_string(num_pages) + " pages of " : "")
            << ShownSizeMm(written.sheet.page_mm) << ", " << written.sheet.points.size()
            << " points; print at 100 % and check both rulers\n"
            << written.points_file.string() << ": the positions of the points" << std::endl;
  for (const std::string& warning : written.warnings) std::cerr << "heba: warning: " << warning << std::endl;
  return kDone;
}

}  // namespace heba
