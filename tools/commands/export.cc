#include <algorithm>
#include <filesystem>
#include <iostream>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/io/export.h"
#include "heba/io/result_file.h"
#include "tools/command.h"
#include "tools/flags.h"

namespace heba {
namespace {

const ExportFormat& FormatAskedFor() {
  std::vector<std::string> names;
  for (const ExportFormat& format : ExportFormats()) {
    if (format.name == FLAGS_to) return format;
    names.push_back(format.name);
  }
  if (FLAGS_to.empty()) throw InputError("'heba export' needs --to FORMAT, one of: " + Join(names, ", "));
  throw InputError("--to: format " + Quoted(FLAGS_to) + " is unknown; one of: " + Join(names, ", ") +
                   DidYouMean(FLAGS_to, names));
}

// The refined one, or the one that --method names.
const Estimate& EstimateAskedFor(const RunResult& result, const std::string& where) {
  std::vector<std::string> names;
  for (const Estimate& estimate : result.estimates) {
    if (estimate.ok) names.push_back(estimate.method);
  }
  const Estimate* refined = FindRefined(result);
  if (FLAGS_method.empty() && refined != nullptr) return *refined;
  for (const Estimate& estimate : result.estimates) {
    if (estimate.ok && estimate.method == FLAGS_method) return estimate;
  }
  throw InputError((FLAGS_method.empty() ? where + ": has no refined estimate; name another with --method"
                                         : "--method: " + where + " has no estimate of " + Quoted(FLAGS_method)) +
                   "; it has: " + Join(names, ", "));
}

// Names of frames go into files of many languages: those that ROS allows are safe in all of them.
void ReadFrame(const char* flag, const std::string& given, std::string* frame) {
  if (given.empty()) return;
  const bool is_plain = std::all_of(given.begin(), given.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '/';
  });
  if (!is_plain) {
    throw InputError(std::string("--") + flag + ": " + Quoted(given) +
                     " is no name of a frame; letters, digits, _ and / are possible");
  }
  *frame = given;
}

}  // namespace

int RunCommand_export(const std::vector<std::string>& arguments) {
  const ExportFormat& format = FormatAskedFor();
  const std::filesystem::path file = std::filesystem::path(arguments[0]) / "result.json";
  const RunResult result = ReadResult(file);
  ExportRequest request = MakeExportRequest(result, EstimateAskedFor(result, file.string()));
  ReadFrame("parent", FLAGS_parent, &request.parent_frame);
  ReadFrame("child", FLAGS_child, &request.camera_frame);
  if (request.parent_frame == request.camera_frame) {
    throw InputError("--parent and --child are both " + Quoted(request.parent_frame) +
                     "; a frame has no pose in itself");
  }
  if (FLAGS_units != "m" && FLAGS_units != "mm") {
    throw InputError("--units: " + Quoted(FLAGS_units) + "; m or mm");
  }
  if (FLAGS_units != "m" && format.name != "matrix") {
    throw InputError("--units: format " + format.name + " has its own; only matrix is written in either");
  }
  request.length_unit = FLAGS_units;
  const Outcome<std::string> text = ExportText(format, request);
  if (!text) {
    PrintError(file.string() + ": " + text.reason());
    return kWorkFailed;
  }
  if (FLAGS_out.empty()) {
    std::cout << *text << std::flush;
    return kDone;
  }
  std::error_code error;
  const bool is_folder = std::filesystem::is_directory(FLAGS_out, error);
  const std::filesystem::path out = FLAGS_out;
  const std::filesystem::path path = is_folder ? out / format.file_name : out;
  WriteFileAtomically(path, *text);
  if (!FLAGS_quiet) std::cout << path.string() << ": " << format.description << std::endl;
  return kDone;
}

}  // namespace heba
