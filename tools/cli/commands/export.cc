#include <algorithm>
#include <filesystem>
#include <iostream>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/config/yaml_reader.h"
#include "heba/io/export_format.h"
#include "heba/io/result_file.h"
#include "heba/io/rig_export.h"
#include "heba/robot/ur_kinematics.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/cli/pose_flag.h"
#include "tools/config/finished_run.h"

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

// Returns the refined estimate, or the one that --method names.
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
                   "; it has: " + Join(names, ", ") + DidYouMean(FLAGS_method, names));
}

// Sets the name of a frame. The names go into files of many languages; the characters that ROS allows are safe in all.
void ReadFrame(const char* flag, const std::string& given, std::string* frame) {
  if (given.empty()) return;
  const bool is_plain = std::all_of(given.begin(), given.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '/';
  });
  if (!is_plain) {
    throw InputError(std::string("--") + flag + ": " + Quoted(given) +
                     " is not a valid frame name; letters, digits, _ and / are allowed");
  }
  *frame = given;
}

// Returns whether the run's poses are those of a Universal Robots controller, according to the config next to the
// result.
bool PosesAreOfUrController(const fs::path& run) {
  const fs::path file = run / "config.yaml";
  std::error_code error;
  if (!fs::is_regular_file(file, error)) return false;
  MapReader config(ReadYamlFile(file));
  const std::optional<ConfigValue> section = config.Find("captures");
  if (!section || !section->IsMap()) return false;
  MapReader captures(*section);
  const auto text_of = [&](const std::string& key) {
    const std::optional<ConfigValue> value = captures.Find(key);
    return value && value->IsText() ? value->AsText() : std::string();
  };
  const std::string format = text_of("pose_format");
  return format == "ur" || (format == "joints" && FindUrRobot(text_of("robot")) != nullptr);
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

ExportRequest RequestAskedFor(const fs::path& run) {
  const fs::path file = run / "result.json";
  const RunResult result = ReadResult(file);
  ExportRequest request = WithChildAskedFor(
      MakeExportRequest(result, EstimateAskedFor(result, file.string()), PosesAreOfUrController(run)));
  ReadFrame("parent", FLAGS_parent, &request.parent_frame);
  ReadFrame("child", FLAGS_child, &request.child_frame);
  if (request.parent_frame == request.child_frame) {
    throw InputError("--parent and --child are both " + Quoted(request.parent_frame) +
                     "; a frame has no pose in itself");
  }
  if (request.is_ur_controller && request.parent_frame == "base_link" && request.setup == Setup::kEyeToHand) {
    std::cerr << "heba: warning: the run's poses are those of a Universal Robots controller, in its frame base; "
                 "base_link of ROS is rotated by 180 deg about z relative to it, so name the parent base"
              << std::endl;
  }
  if (FLAGS_child_is.empty() && FLAGS_child.ends_with("_link")) {
    std::cerr << "heba: warning: " << FLAGS_child << " is by its name the body frame of a camera (x forward), but this "
              << "is the pose of the optical frame (z forward): --child-is body exports that of the body frame, and "
              << "--child-is optical confirms the optical one" << std::endl;
  }
  if (result.verdict.grade == Grade::kBad && !FLAGS_quiet) {
    std::cerr << "heba: warning: the verdict of this run is bad: " << file.parent_path().string()
              << "/report.html gives the reasons" << std::endl;
  }
  if (FLAGS_units != "m" && FLAGS_units != "mm") throw InputError("--units: " + UnknownName(FLAGS_units, {"m", "mm"}));
  request.length_unit = FLAGS_units;
  return FLAGS_inverse ? Inverted(request) : request;
}

// Returns why a calibrated arm is not written; empty if it is.
std::string WhyNoArm(const ExportFormat& format, Grade grade) {
  if (FLAGS_force || grade != Grade::kBad || HeldBy(format) != ExportHolds::kArm) return "";
  return "the verdict of this run is bad, and a robot would move by it; --force writes it";
}

// Writes every format that can hold this result into the folder --out.
int ExportAll(const ExportRequest& request) {
  if (FLAGS_out.empty()) throw InputError("--to all needs --out FOLDER");
  const fs::path folder = FLAGS_out;
  std::error_code error;
  if (fs::exists(folder, error) && !fs::is_directory(folder, error)) {
    throw InputError("--out: " + folder.string() + " is a file; --to all needs a folder");
  }
  // Only an earlier export is replaced, because the user did not choose the file names.
  for (const ExportFormat& format : ExportFormats()) {
    const fs::path file = folder / format.file_name;
    if (fs::exists(file, error) && ReadTextFile(file).find(kExportMark) == std::string::npos) {
      throw InputError(file.string() + ": was not exported by heba and is not replaced; name another folder");
    }
  }
  fs::create_directories(folder, error);
  for (const ExportFormat& format : ExportFormats()) {
    const std::string why_not = WhyNoArm(format, request.grade.value_or(Grade::kGood));
    const Outcome<std::string> text = why_not.empty() ? ExportText(format, request) : Failure{why_not};
    if (text) {
      WriteFileAtomically(folder / format.file_name, *text);
    } else {
      fs::remove(folder / format.file_name, error);  // It would be an earlier export of another result.
    }
    if (FLAGS_quiet) continue;
    std::cout << (text ? (folder / format.file_name).string() + ": " + format.description +
                             (FLAGS_inverse ? ", inverted" : "")
                       : "not " + format.name + ": " + text.reason())
              << "\n";
  }
  std::cout << std::flush;
  return kDone;
}

// Writes the files of a rig into the folder --out, or those of one format with all cameras to standard output.
int ExportOfRig(const fs::path& file) {
  const RigResult result = ReadRigResult(file);
  for (const auto& [flag, value] :
       {std::pair{"--method", FLAGS_method}, std::pair{"--parent", FLAGS_parent}, std::pair{"--child", FLAGS_child}}) {
    if (!value.empty()) {
      throw InputError(std::string(flag) +
                       ": is for results of one camera; the frames of a rig are called by its names");
    }
  }
  if (FLAGS_units != "m" && FLAGS_units != "mm") throw InputError("--units: " + UnknownName(FLAGS_units, {"m", "mm"}));
  std::vector<ExportRequest> cameras;
  for (const ExportRequest& camera : RigExportRequests(result)) {
    // The frames of several cameras must keep names of their own.
    ExportRequest request = WithChildAskedFor(camera);
    if (request.child != camera.child) request.child_frame = camera.child_frame;
    if (request.child == ExportFrame::kBody) {
      request.child_frame.replace(request.child_frame.rfind("_optical_frame"), std::string::npos, "_link");
    }
    request.length_unit = FLAGS_units;
    cameras.push_back(FLAGS_inverse ? Inverted(request) : request);
  }
  std::vector<ExportRequest> bases;
  for (const ExportRequest& base : BaseExportRequests(result)) bases.push_back(FLAGS_inverse ? Inverted(base) : base);
  if (result.verdict.grade == Grade::kBad && !FLAGS_quiet) {
    std::cerr << "heba: warning: the verdict of this run is bad: " << file.parent_path().string()
              << "/report.html gives the reasons" << std::endl;
  }
  std::vector<ExportedFile> files;
  for (const ExportFormat& format : ExportFormats()) {
    if (FLAGS_to != "all" && format.name != FormatAskedFor().name) continue;
    const std::string why_not = WhyNoArm(format, result.verdict.grade);
    if (!why_not.empty() && FLAGS_to != "all") {
      PrintError(file.string() + ": " + why_not);
      return kWorkFailed;
    }
    if (!why_not.empty()) continue;
    for (ExportedFile& exported : ExportRig(format, cameras, bases, result)) files.push_back(std::move(exported));
  }
  // A format that was asked for by its name must hold every camera, as with one camera.
  std::vector<std::string> refused;
  std::string reason;
  for (const ExportedFile& exported : files) {
    if (!exported.text.empty() || exported.camera.empty()) continue;
    if (refused.empty()) reason = exported.reason;
    refused.push_back(exported.camera);
  }
  if (FLAGS_to != "all" && !refused.empty()) {
    const std::vector<std::string> others(refused.begin() + 1, refused.end());
    PrintError(file.string() + ": camera " + refused.front() + ": " + reason +
               (others.empty() ? "" : "; nor does the format hold " + Join(others, ", ")));
    return kWorkFailed;
  }
  const auto holds_arm = [](const ExportedFile& exported) { return !exported.arm.empty() && !exported.text.empty(); };
  const auto num_arms = std::count_if(files.begin(), files.end(), holds_arm);
  if (FLAGS_to != "all" && num_arms == 0 && !files.front().arm.empty()) {
    std::vector<std::string> reasons;
    for (const ExportedFile& exported : files) reasons.push_back(exported.reason);
    PrintError(file.string() + ": " + Join(reasons, "; "));
    return kWorkFailed;
  }
  if (FLAGS_out.empty() && num_arms > 1 && FLAGS_to != "all") {
    throw InputError("--to " + FLAGS_to + ": each of the " + std::to_string(num_arms) +
                     " arms has a file of its own; --out FOLDER is needed");
  }
  if (FLAGS_out.empty() && FLAGS_to != "all") {
    for (const ExportedFile& exported : files) {
      if (!exported.holds_all || exported.text.empty()) continue;
      std::cout << exported.text << std::flush;
      return kDone;
    }
    for (const ExportedFile& exported : files) std::cout << exported.text;
    std::cout << std::flush;
    return kDone;
  }
  if (FLAGS_out.empty()) throw InputError("--to all needs --out FOLDER");
  const fs::path folder = FLAGS_out;
  std::error_code error;
  if (fs::exists(folder, error) && !fs::is_directory(folder, error)) {
    throw InputError("--out: " + folder.string() + " is a file; the export of a rig needs a folder");
  }
  for (const ExportedFile& exported : files) {
    const fs::path path = folder / exported.name;
    if (fs::exists(path, error) && ReadTextFile(path).find(kExportMark) == std::string::npos) {
      throw InputError(path.string() + ": was not exported by heba and is not replaced; name another folder");
    }
  }
  fs::create_directories(folder, error);
  for (const ExportedFile& exported : files) {
    const fs::path path = folder / exported.name;
    if (!exported.text.empty()) {
      WriteFileAtomically(path, exported.text);
    } else {
      fs::remove(path, error);  // It would be an earlier export of another result.
    }
    if (FLAGS_quiet) continue;
    std::cout << (exported.text.empty() ? "not " + exported.name + ": " + exported.reason : path.string()) << "\n";
  }
  std::cout << std::flush;
  return kDone;
}

}  // namespace

int RunCommand_export(const std::vector<std::string>& arguments) {
  const bool all = FLAGS_to == "all";
  const ExportFormat* format = all ? nullptr : &FormatAskedFor();
  const fs::path run = RunFolderOf(arguments[0]);
  if (IsRigResult(run / "result.json")) return ExportOfRig(run / "result.json");
  const ExportRequest request = RequestAskedFor(run);
  if (all) return ExportAll(request);
  if (FLAGS_units != "m" && format->name != "matrix") {
    throw InputError("--units: format " + format->name + " has a fixed unit; only matrix can be written in both");
  }
  const std::string why_not = WhyNoArm(*format, request.grade.value_or(Grade::kGood));
  if (!why_not.empty()) {
    PrintError((run / "result.json").string() + ": " + why_not);
    return kWorkFailed;
  }
  const Outcome<std::string> text = ExportText(*format, request);
  if (!text) {
    PrintError((run / "result.json").string() + ": " + text.reason());
    return kWorkFailed;
  }
  if (FLAGS_out.empty()) {
    std::cout << *text << std::flush;
    return kDone;
  }
  std::error_code error;
  const fs::path out = FLAGS_out;
  const fs::path path = fs::is_directory(out, error) ? out / format->file_name : out;
  WriteFileAtomically(path, *text);
  if (!FLAGS_quiet) std::cout << path.string() << ": " << format->description << std::endl;
  return kDone;
}

}  // namespace heba
