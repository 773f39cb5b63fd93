#include <algorithm>
#include <filesystem>
#include <iostream>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/io/export_files.h"
#include "heba/io/export_format.h"
#include "heba/io/result_file.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/cli/pose_flag.h"
#include "tools/config/run_export.h"
#include "tools/config/run_folder.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

const ExportFormat& FormatAskedFor() {
  if (const ExportFormat* format = FindEntry(ExportFormats(), FLAGS_to)) return *format;
  std::vector<std::string> names = NamesOf(ExportFormats());
  names.emplace_back("all");
  if (FLAGS_to.empty()) throw InputError("'heba export' needs --to FORMAT, one of: " + Join(names, ", "));
  throw InputError("--to: format " + UnknownName(FLAGS_to, names));
}

// A result of one camera or of several, with the estimate of one method.
struct ResultOfMethod {
  RunResult result;
  std::string method;
};

// Returns the error of a result that has only other estimates than the one asked for.
InputError NoEstimate(const std::string& where, const std::vector<std::string>& names) {
  return InputError((FLAGS_method.empty() ? where + ": has no estimate"
                                          : "--method: " + where + " has no estimate of " + Quoted(FLAGS_method)) +
                    "; it has: " + Join(names, ", ") + DidYouMean(FLAGS_method, names));
}

// Refuses the flags that are for one camera.
void CheckFlagsOfSeveral() {
  for (const auto& [flag, value] :
       {std::pair{"--method", FLAGS_method}, std::pair{"--parent", FLAGS_parent}, std::pair{"--child", FLAGS_child}}) {
    if (value.empty()) continue;
    throw InputError(std::string(flag) + ": is for results of one camera; the frames of a rig are called by its names");
  }
}

// Returns the result; of one camera that of the refined estimate, or of the one that --method names.
ResultOfMethod ReadResultAskedFor(const fs::path& file) {
  const RunResult result = ReadRunResult(file);
  if (!IsShort(result)) {
    if (result.rig.cameras.size() > 1) CheckFlagsOfSeveral();
    if (!FLAGS_method.empty() && FLAGS_method != kBundleMethod) throw NoEstimate(file.string(), {kBundleMethod});
    return {result, kBundleMethod};
  }
  const Estimate* const found = FindFinal(result);
  if (FLAGS_method.empty() && found != nullptr) return {WithEstimate(result, *found), found->method};
  std::vector<std::string> names;
  for (const Estimate& estimate : result.estimates) {
    if (!estimate.ok) continue;
    if (estimate.method == FLAGS_method) return {WithEstimate(result, estimate), estimate.method};
    names.push_back(estimate.method);
  }
  throw NoEstimate(file.string(), names);
}

// Returns the name of a frame that a flag gives, or else the usual one. The names go into files of many languages; the
// characters that ROS allows are safe in all.
std::string FrameOfFlag(const char* flag, const std::string& given, const std::string& usual) {
  if (given.empty()) return usual;
  const bool is_plain = std::all_of(given.begin(), given.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '/';
  });
  if (!is_plain) {
    throw InputError(std::string("--") + flag + ": " + Quoted(given) +
                     " is not a valid frame name; letters, digits, _ and / are allowed");
  }
  return given;
}

// Returns the request with the child frame that --child-is names instead of the optical one.
ExportRequest WithChildAskedFor(const ExportRequest& request) {
  if (FLAGS_child_is.empty() || FLAGS_child_is == "optical") return request;
  if (FLAGS_child_is == "body") return WithChild(request, ExportFrame::kBody, OpticalFromBody());
  if (FLAGS_child_is.find(',') == std::string::npos) {
    throw InputError("--child-is: " + UnknownName(FLAGS_child_is, {"optical", "body"}) +
                     "; or the optical frame's pose in the child, x,y,z,qx,qy,qz,qw in m");
  }
  const Rigid3d link_from_optical = PoseOfFlag("child-is", FLAGS_child_is, *FindPoseFormat("ros"));
  return WithChild(request, ExportFrame::kLink, Inverse(link_from_optical));
}

// Returns the requests with the names of --parent and --child for the frames of the only camera.
ExportRequests WithNamedFrames(ExportRequests requests) {
  ExportRequest& camera = requests.cameras.front();
  const std::string usual_parent = camera.parent_frame;
  camera.parent_frame = FrameOfFlag("parent", FLAGS_parent, camera.parent_frame);
  camera.child_frame = FrameOfFlag("child", FLAGS_child, camera.child_frame);
  for (ExportRequest& base : requests.bases) {
    for (std::string* const frame : {&base.parent_frame, &base.child_frame}) {
      if (*frame == usual_parent) *frame = camera.parent_frame;
    }
  }
  if (camera.parent_frame == camera.child_frame) {
    throw InputError("--parent and --child are both " + Quoted(camera.parent_frame) +
                     "; a frame has no pose in itself");
  }
  if (camera.is_ur_controller && camera.parent_frame == "base_link" && camera.setup == Setup::kEyeToHand) {
    std::cerr << "heba: warning: the run's poses are those of a Universal Robots controller, in its frame base; "
                 "base_link of ROS is rotated by 180 deg about z relative to it, so name the parent base"
              << std::endl;
  }
  if (FLAGS_child_is.empty() && FLAGS_child.ends_with("_link")) {
    std::cerr << "heba: warning: " << FLAGS_child << " is by its name the body frame of a camera (x forward), but this "
              << "is the pose of the optical frame (z forward): --child-is body exports that of the body frame, and "
              << "--child-is optical confirms the optical one" << std::endl;
  }
  return requests;
}

// Returns the poses and arms to export, in the frames that the flags ask for.
ExportRequests RequestsAskedFor(const fs::path& run, const ResultOfMethod& from) {
  ExportRequests requests = ExportRequestsOf(run, from.result, from.method);
  for (ExportRequest& camera : requests.cameras) {
    camera = WithChildAskedFor(camera);
    camera.length_unit = FLAGS_units;
  }
  if (requests.cameras.size() == 1) requests = WithNamedFrames(std::move(requests));
  for (std::vector<ExportRequest>* const poses : {&requests.cameras, &requests.bases}) {
    for (ExportRequest& pose : *poses) pose = FLAGS_inverse ? Inverted(pose) : pose;
  }
  return requests;
}

// Warns of arms that are exported with errors that no arm has.
void WarnOfImplausibleArms(const RunResult& result) {
  for (size_t r = 0; r < result.arms.size(); ++r) {
    const std::string errors = result.arms[r] ? ImplausibleArmText(*result.arms[r]) : "";
    if (errors.empty()) continue;
    const std::string arm = result.arms.size() > 1 ? "the arm " + result.rig.robots[r] : "the arm";
    std::cerr << "heba: warning: " << arm << " is exported with " << errors << std::endl;
  }
}

// Returns the files of this content that have a text, or none.
std::vector<ExportedFile> Select(const std::vector<ExportedFile>& files, ExportedContent content, bool has_text) {
  std::vector<ExportedFile> selected;
  for (const ExportedFile& file : files) {
    if (file.content == content && !file.text.empty() == has_text) selected.push_back(file);
  }
  return selected;
}

// Returns why a format that was asked for by its name is refused: it must hold every camera, or an arm.
std::string WhyRefused(const std::vector<ExportedFile>& files) {
  const std::vector<ExportedFile> cameras = Select(files, ExportedContent::kCamera, false);
  if (!cameras.empty()) {
    const std::string& name = cameras.front().part;
    std::vector<std::string> others;
    for (const ExportedFile& other : cameras) others.push_back(other.part);
    others.erase(others.begin());
    return (name.empty() ? "" : "camera " + name + ": ") + cameras.front().reason +
           (others.empty() ? "" : "; nor does the format hold " + Join(others, ", "));
  }
  if (!Select(files, ExportedContent::kArm, true).empty()) return "";
  std::vector<std::string> reasons;
  for (const ExportedFile& arm : Select(files, ExportedContent::kArm, false)) reasons.push_back(arm.reason);
  reasons.erase(std::unique(reasons.begin(), reasons.end()), reasons.end());
  return Join(reasons, "; ");
}

// Prints the file with all poses of a format or, if it has none, all of its files.
void PrintFiles(const std::vector<ExportedFile>& files) {
  const size_t num_arms = Select(files, ExportedContent::kArm, true).size();
  if (num_arms > 1) {
    throw InputError("--to " + FLAGS_to + ": each of the " + std::to_string(num_arms) +
                     " arms has a file of its own; --out FOLDER is needed");
  }
  const std::vector<ExportedFile> with_all = Select(files, ExportedContent::kAllPoses, true);
  if (!with_all.empty()) {
    std::cout << with_all.front().text << std::flush;
  } else {
    for (const ExportedFile& file : files) std::cout << file.text << std::flush;
  }
}

// Returns whether this is the file of a camera or an arm without a name, the only one of its format.
bool IsOnlyFile(const ExportedFile& file) { return file.part.empty() && !file.format.name.empty(); }

// Writes or removes a file, and prints which.
void WriteFile(const fs::path& path, const ExportedFile& file) {
  std::error_code error;
  if (!file.text.empty()) {
    WriteFileAtomically(path, file.text);
  } else {
    fs::remove(path, error);  // It would be an earlier export of another result.
  }
  if (FLAGS_quiet) return;
  const bool is_only = IsOnlyFile(file);
  const bool is_inverted = FLAGS_inverse && file.content == ExportedContent::kCamera;
  const std::string description = is_only ? ": " + file.format.description + (is_inverted ? ", inverted" : "") : "";
  std::cout << (file.text.empty() ? "not " + (is_only ? file.format.name : file.name) + ": " + file.reason
                                  : path.string() + description)
            << std::endl;
}

// Writes the files into the folder --out; the only file of one format also to a file of that name.
void WriteFiles(const std::vector<ExportedFile>& files) {
  const fs::path out = FLAGS_out;
  std::error_code error;
  const bool is_folder = fs::is_directory(out, error);
  if (files.size() == 1 && IsOnlyFile(files.front()) && !is_folder) {
    WriteFile(out, files.front());
    return;
  }
  if (!is_folder && fs::exists(out, error)) {
    throw InputError("--out: " + out.string() + " is a file; " +
                     (FLAGS_to == "all" ? "--to all needs a folder" : "the export of a rig needs a folder"));
  }
  // Only an earlier export is replaced, because the user did not choose the file names.
  for (const ExportedFile& file : files) {
    const fs::path path = out / file.name;
    if (fs::exists(path, error) && ReadTextFile(path).find(kExportMark) == std::string::npos) {
      throw InputError(path.string() + ": was not exported by heba and is not replaced; name another folder");
    }
  }
  fs::create_directories(out, error);
  for (const ExportedFile& file : files) WriteFile(out / file.name, file);
}

}  // namespace

int RunCommand_export(const std::vector<std::string>& arguments) {
  const bool all = FLAGS_to == "all";
  const std::vector<ExportFormat> formats = all ? ExportFormats() : std::vector<ExportFormat>{FormatAskedFor()};
  if (FLAGS_units != "m" && FLAGS_units != "mm") throw InputError("--units: " + UnknownName(FLAGS_units, {"m", "mm"}));
  const fs::path run = RunFolderOf(arguments[0]);
  const fs::path file = run / "result.json";
  const ResultOfMethod from = ReadResultAskedFor(file);
  if (FLAGS_units != "m" && !all && FLAGS_to != "matrix") {
    throw InputError("--units: format " + FLAGS_to + " has a fixed unit; only matrix can be written in both");
  }
  const ExportRequests requests = RequestsAskedFor(run, from);
  const Grade grade = from.result.verdict.grade;
  if (grade == Grade::kBad && !FLAGS_quiet) {
    std::cerr << "heba: warning: the verdict of this run is bad: " << run.string() << "/report.html gives the reasons"
              << std::endl;
  }
  const std::vector<ExportedFile> files = FilesToExport(formats, requests, grade, FLAGS_force, "--force writes it");
  if (!FLAGS_quiet && !Select(files, ExportedContent::kArm, true).empty()) WarnOfImplausibleArms(from.result);
  const std::string why_refused = all ? "" : WhyRefused(files);
  if (!why_refused.empty()) {
    PrintError(file.string() + ": " + why_refused);
    return kWorkFailed;
  }
  if (FLAGS_out.empty() && all) throw InputError("--to all needs --out FOLDER");
  if (FLAGS_out.empty()) {
    PrintFiles(files);
  } else {
    WriteFiles(files);
  }
  return kDone;
}

}  // namespace heba
