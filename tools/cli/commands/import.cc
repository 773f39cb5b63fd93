#include "heba/io/import.h"

#include <filesystem>
#include <iostream>
#include <optional>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/doctor/raw_folder.h"
#include "tools/files/imported_files.h"
#include "tools/files/result_folder.h"
#include "tools/text/console.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

// Throws InputError if the folder that `output` replaces contains the source or one of `kept`, which are imported.
void RefuseToSwallow(std::vector<fs::path> kept, const fs::path& source, const fs::path& output) {
  kept.push_back(source);
  const fs::path target = fs::weakly_canonical(output);
  for (const fs::path& path : kept) {
    const fs::path inside = fs::weakly_canonical(path).lexically_relative(target);
    if (!inside.empty() && *inside.begin() != "..") {
      throw InputError(output.string() + ": contains " + path.string() +
                       ", which is imported; name another folder (--out)");
    }
  }
}

// Imports images and poses that no program has described.
int ImportRawFolder(const fs::path& source, const fs::path& output) {
  std::optional<RawFolder> raw = FindRawFolder(source);
  if (!raw) {
    throw InputError(source.string() +
                     ": is neither a data set in a known format nor a folder of images with a table "
                     "of poses (or one file per pose); known formats: " +
                     Join(ImportFormatNames(), ", "));
  }
  RefuseToSwallow({}, source, output);
  if (!FLAGS_target.empty()) raw->target = FLAGS_target;
  StagedFolder folder(output, "an imported data set");
  const RawConfig made = ConfigOf(*raw, folder.staging() / "config.yaml", NumThreads());
  WriteFileAtomically(folder.staging() / "config.yaml", made.text);
  folder.Commit();
  if (FLAGS_quiet) return kDone;
  std::string report = source.string() + ": " + std::to_string(raw->num_images) + " images in " + raw->images.string() +
                       ", poses in " + made.poses.string() + "\n";
  std::cout << ForTerminal(report + RemarksText(made)) << "written: " << (output / "config.yaml").string() << std::endl;
  return kDone;
}

// Writes the files into the folder, whole or not at all, and prints the report.
int Write(const ImportedFiles& made, const fs::path& output, const std::string& report) {
  // The folder has its own marker, because any folder may contain a config.yaml.
  StagedFolder folder(output, "an imported data set");
  for (const auto& [name, text] : made.files) WriteFileAtomically(folder.staging() / name, text);
  WriteFileAtomically(folder.staging() / "config.yaml", made.config);
  folder.Commit();
  if (!FLAGS_quiet) {
    std::cout << ForTerminal(report) << "written: " << (output / "config.yaml").string() << std::endl;
  }
  return kDone;
}

std::string ReportText(const fs::path& source, const std::string& content, const std::string& format,
                       const std::vector<std::string>& remarks) {
  std::string text = source.string() + ": " + content + ", read as " + format + "\n";
  for (const std::string& remark : remarks) text += "remark: " + remark + "\n";
  return text;
}

int WriteSet(const ImportedSet& set, const fs::path& source, const fs::path& output) {
  std::vector<fs::path> kept = set.files;
  for (const ImportedCapture& capture : set.captures) {
    if (!capture.image.empty()) kept.push_back(capture.image);
  }
  const ImportedFiles made = FilesOf(set, output);
  RefuseToSwallow(std::move(kept), source, output);
  std::string report = ReportText(source, std::to_string(set.captures.size()) + " captures", set.format, set.remarks);
  if (!set.setup) report += "remark: the data set does not say where the camera is: set setup in its config.yaml\n";
  return Write(made, output, report);
}

int WriteCell(const ImportedCell& rig, const fs::path& source, const fs::path& output) {
  std::vector<fs::path> kept = rig.files;
  for (const ImportedCamera& camera : rig.cameras) {
    if (!camera.images.empty()) kept.push_back(camera.images);
  }
  RefuseToSwallow(std::move(kept), source, output);
  const std::string captures = rig.captures.empty() ? "" : ", " + std::to_string(rig.captures.size()) + " captures";
  std::string report =
      ReportText(source, std::to_string(rig.cameras.size()) + " cameras" + captures, rig.format, rig.remarks);
  if (rig.captures.empty()) {
    report += "remark: there are cameras only: add poses, mounts, images and targets to the config.yaml\n";
  } else if (!rig.setup) {
    report += "remark: the data set does not say where the cameras are: set their mounts in its config.yaml\n";
  }
  return Write(FilesOf(rig, output), output, report);
}

}  // namespace

int RunCommand_import(const std::vector<std::string>& arguments) {
  if (FLAGS_out.empty()) throw InputError("--out: name the folder for heba's own files");
  const fs::path source = arguments[0];
  const fs::path output = fs::absolute(FLAGS_out).lexically_normal();
  std::error_code error;
  if (!fs::exists(source, error)) throw InputError(source.string() + ": no such file or folder");
  if (FLAGS_format.empty() && fs::is_directory(source, error) && FindImportFormat(source) == nullptr) {
    return ImportRawFolder(source, output);
  }
  if (!FLAGS_target.empty()) throw InputError("--target: a data set in a known format describes its own target");
  if (const std::optional<ImportedCell> rig = ImportCell(source, FLAGS_format)) return WriteCell(*rig, source, output);
  return WriteSet(ImportDataSet(source, FLAGS_format), source, output);
}

}  // namespace heba
