#include "heba/io/import.h"

#include <filesystem>
#include <iostream>
#include <optional>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/io/camera_file.h"
#include "heba/io/export_format.h"
#include "heba/io/pose_file.h"
#include "targets/images/image.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/doctor/raw_folder.h"
#include "tools/files/detection_file.h"
#include "tools/files/result_folder.h"
#include "tools/text/console.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

// The contents of all files that `import` writes, complete before the first is written.
struct ImportedFiles {
  std::vector<std::pair<std::string, std::string>> files;
  std::string config;
};

bool All(const ImportedSet& set, bool (*has)(const ImportedCapture&)) {
  return std::all_of(set.captures.begin(), set.captures.end(), has);
}

ImportedFiles FilesOf(const ImportedSet& set, const fs::path& output) {
  ImportedFiles made;
  std::string& config = made.config;
  const auto add = [&](const std::string& name, const std::string& text) { made.files.emplace_back(name, text); };
  config = "# From a data set of " + set.format + ".\n";
  for (const std::string& remark : set.remarks) config += "# " + remark + "\n";
  config += set.setup ? "setup: " + std::string(SetupName(*set.setup)) + "\n"
                      : "# setup: eye_to_hand (camera fixed) or eye_in_hand: the data set does not say which\n";
  const bool has_images = All(set, [](const ImportedCapture& capture) { return !capture.image.empty(); });
  const bool has_corners =
      std::any_of(set.captures.begin(), set.captures.end(), [](const ImportedCapture& c) { return !c.ids.empty(); });
  const bool has_target_poses = All(set, [](const ImportedCapture& c) { return c.camera_from_target.has_value(); });
  if (!set.target.empty()) {
    add("target.yaml", set.target);
    config += "target: target.yaml\n";
  } else if (has_images || has_corners) {
    config += "# target: ...: the data set does not describe it\n";
  }
  if (set.camera) {
    Camera camera = *set.camera;
    if (camera.width_px == 0 && has_images) {
      const cv::Mat image = ReadGreyImage(set.captures.front().image);
      camera.width_px = image.cols;
      camera.height_px = image.rows;
    }
    if (camera.width_px > 0) {
      add("camera.yaml", CameraToYaml(camera));
      config += "camera:\n  intrinsics: camera.yaml\n";
    } else {
      config += "# camera: the data set has one, but does not state the size of its images\n";
    }
  }
  config += "captures:\n";
  const PoseFormat& ros = *FindPoseFormat("ros");
  if (has_images && !has_corners) {
    config += "  images:\n";
    for (const ImportedCapture& capture : set.captures) {
      const fs::path image = fs::weakly_canonical(capture.image);
      config += "    - " + QuotedForYaml(image.lexically_proximate(fs::weakly_canonical(output)).string()) + "\n";
    }
  } else if (has_corners) {
    std::vector<Capture> captures;
    std::vector<CaptureDetection> detections;
    for (const ImportedCapture& capture : set.captures) {
      captures.push_back({capture.name, capture.image, CaptureRole::kNone, Rigid3d()});
      CaptureDetection detection;
      detection.detection.ids = capture.ids;
      detection.detection.pixels = capture.pixels;
      detections.push_back(std::move(detection));
    }
    add("detections.json", DetectionsToJson(captures, detections));
    config += "  detections: detections.json\n";
  } else if (has_target_poses) {
    std::vector<PoseRow> rows;
    for (const ImportedCapture& c : set.captures) {
      rows.push_back({c.name, CaptureRole::kNone, *c.camera_from_target, 0, {}});
    }
    add("target_poses.csv", PoseFileText(rows, ros));
    config += "  target_poses: target_poses.csv\n";
  } else {
    config += "  # images: ...: the data set has poses only\n";
  }
  if (All(set, [](const ImportedCapture& capture) { return capture.base_from_gripper.has_value(); })) {
    std::vector<PoseRow> rows;
    for (const ImportedCapture& c : set.captures) {
      rows.push_back({has_images || has_corners || has_target_poses ? c.name : "",
                      CaptureRole::kNone,
                      *c.base_from_gripper,
                      0,
                      {}});
    }
    add("poses.csv", PoseFileText(rows, ros));
    config += "  poses: poses.csv\n  pose_format: ros\n";
  } else {
    config += "  # poses: ...: the data set has none\n";
  }
  return made;
}

// Throws InputError if the folder that `output` replaces contains a file that is imported.
void RefuseToSwallow(const ImportedSet& set, const fs::path& source, const fs::path& output) {
  std::vector<fs::path> kept = set.files;
  kept.push_back(source);
  for (const ImportedCapture& capture : set.captures) {
    if (!capture.image.empty()) kept.push_back(capture.image);
  }
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
                       ", poses in " + raw->poses.string() + "\n";
  std::cout << ForTerminal(report + RemarksText(made)) << "written: " << (output / "config.yaml").string() << std::endl;
  return kDone;
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
  const ImportedSet set = ImportDataSet(source, FLAGS_format);
  const ImportedFiles made = FilesOf(set, output);
  RefuseToSwallow(set, source, output);
  // The folder has its own marker, because any folder may contain a config.yaml.
  StagedFolder folder(output, "an imported data set");
  for (const auto& [name, text] : made.files) WriteFileAtomically(folder.staging() / name, text);
  WriteFileAtomically(folder.staging() / "config.yaml", made.config);
  folder.Commit();
  if (!FLAGS_quiet) {
    std::string text =
        source.string() + ": " + std::to_string(set.captures.size()) + " captures, read as " + set.format + "\n";
    for (const std::string& remark : set.remarks) text += "remark: " + remark + "\n";
    if (!set.setup) text += "remark: the data set does not say where the camera is: set setup in its config.yaml\n";
    std::cout << ForTerminal(text) << "written: " << (output / "config.yaml").string() << std::endl;
  }
  return kDone;
}

}  // namespace heba
