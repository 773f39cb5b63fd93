#include "tools/files/imported_files.h"

#include <algorithm>

#include "heba/data/problem.h"
#include "heba/io/camera_file.h"
#include "heba/io/export_format.h"
#include "heba/io/pose_file.h"
#include "heba/io/result_file.h"
#include "targets/images/image.h"
#include "tools/files/detection_file.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

bool All(const ImportedSet& set, bool (*has)(const ImportedCapture&)) {
  return std::all_of(set.captures.begin(), set.captures.end(), has);
}

// Returns the path of a file or folder for a config in the folder `output`.
std::string PathFrom(const fs::path& output, const fs::path& path) {
  return QuotedForYaml(fs::weakly_canonical(path).lexically_proximate(fs::weakly_canonical(output)).string());
}

// Returns the file with the poses of a rig. If a capture's images have one name in all cameras, that is the capture's;
// otherwise each camera has a column.
std::string PosesOf(const ImportedCell& rig) {
  std::vector<PoseRow> rows;
  bool is_one_name = true;
  for (const ImportedCellCapture& capture : rig.captures) {
    PoseRow& row = rows.emplace_back();
    row.pose = capture.base_from_gripper;
    row.images = capture.images;
    for (const std::string& image : capture.images) {
      if (row.image.empty()) row.image = image;
      is_one_name = is_one_name && (image.empty() || image == row.image);
    }
  }
  std::vector<std::string> cameras;
  for (const ImportedCamera& camera : rig.cameras) cameras.push_back(camera.name);
  return PoseFileText(rows, *FindPoseFormat("ros"), {}, is_one_name ? std::vector<std::string>() : cameras);
}

// Returns the file with the true poses of the cameras.
std::string TruthOf(const ImportedCell& rig, const std::string& mount) {
  Problem problem;
  CellTruth truth;
  for (const ImportedCamera& camera : rig.cameras) {
    ProblemCamera& entry = problem.cameras.emplace_back();
    entry.name = camera.name;
    entry.mount_name = mount;
    truth.mount_from_camera.push_back(*camera.mount_from_camera);
    truth.cameras.emplace_back();
  }
  return TruthToJson(problem, truth);
}

// Returns the line of a mount: of the cameras, or of the target.
std::string MountLine(const std::optional<Setup>& setup, Setup carried) {
  if (setup) return std::string("    mount: ") + (*setup == carried ? "gripper" : "world") + "\n";
  return "    # mount: world or gripper: the data set does not say what carries it\n";
}

}  // namespace

ImportedFiles FilesOf(const ImportedCell& rig, const fs::path& output) {
  ImportedFiles made;
  std::string& config = made.config;
  const auto add = [&](const std::string& name, const std::string& text) { made.files.emplace_back(name, text); };
  config = "# From a data set of " + rig.format + ".\n";
  for (const std::string& remark : rig.remarks) config += "# " + remark + "\n";
  if (rig.captures.empty()) {
    config += "# captures: {poses: ...}: the poses of the robot, a row for each capture ('heba help poses')\n";
  } else {
    add("poses.csv", PosesOf(rig));
    config += "captures:\n  poses: poses.csv\n  pose_format: ros\n";
  }
  config += "cameras:\n";
  for (const ImportedCamera& camera : rig.cameras) {
    config += "  " + camera.name + ":\n" + MountLine(rig.setup, Setup::kEyeInHand) +
              (camera.images.empty() ? "    # images: ...: the folder with the images of this camera\n"
                                     : "    images: " + PathFrom(output, camera.images) + "\n");
    if (!camera.camera) continue;
    add(camera.name + ".yaml", CameraToYaml(*camera.camera));
    config += "    intrinsics: " + camera.name + ".yaml\n";
  }
  if (rig.target.empty()) {
    config += "# targets: {NAME: {mount: ..., target: ...}}: the data set does not describe it ('heba help targets')\n";
  } else {
    add("target.yaml", rig.target);
    config += "targets:\n  " + rig.target_name + ":\n" + MountLine(rig.setup, Setup::kEyeToHand) +
              "    target: target.yaml\n";
  }
  const bool has_truth = std::all_of(rig.cameras.begin(), rig.cameras.end(),
                                     [](const ImportedCamera& camera) { return camera.mount_from_camera.has_value(); });
  if (has_truth && rig.setup) {
    add("truth.json", TruthOf(rig, *rig.setup == Setup::kEyeInHand ? "gripper" : "world"));
    config += "evaluate:\n  truth: truth.json\n";
  }
  return made;
}

namespace {

bool HasImages(const ImportedSet& set) {
  return All(set, [](const ImportedCapture& capture) { return !capture.image.empty(); });
}

bool HasCorners(const ImportedSet& set) {
  return std::any_of(set.captures.begin(), set.captures.end(),
                     [](const ImportedCapture& capture) { return !capture.ids.empty(); });
}

bool HasTargetPoses(const ImportedSet& set) {
  return All(set, [](const ImportedCapture& capture) { return capture.camera_from_target.has_value(); });
}

// Each of the following functions returns a part of the config with the files that it names.

ImportedFiles TargetPart(const ImportedSet& set) {
  if (!set.target.empty()) return {{{"target.yaml", set.target}}, "target: target.yaml\n"};
  if (HasImages(set) || HasCorners(set)) return {{}, "# target: ...: the data set does not describe it\n"};
  return {};
}

ImportedFiles CameraPart(const ImportedSet& set) {
  if (!set.camera) return {};
  Camera camera = *set.camera;
  if (camera.width_px == 0 && HasImages(set)) {
    const cv::Mat image = ReadGreyImage(set.captures.front().image);
    camera.width_px = image.cols;
    camera.height_px = image.rows;
  }
  if (camera.width_px <= 0) {
    return {{}, "# camera: the data set has one, but does not state the size of its images\n"};
  }
  return {{{"camera.yaml", CameraToYaml(camera)}}, "camera:\n  intrinsics: camera.yaml\n"};
}

// Returns the file with the corners.
std::string DetectionsOf(const ImportedSet& set) {
  NamedDetections detections;
  for (const ImportedCapture& capture : set.captures) {
    CaptureDetection& detection = detections.emplace_back(capture.name, CaptureDetection()).second;
    detection.detection.ids = capture.ids;
    detection.detection.pixels = capture.pixels;
  }
  return DetectionsToJson(detections);
}

// Returns the part with the corners, the images or the poses of the target, of which the first that the data set has
// are used.
ImportedFiles SeenPart(const ImportedSet& set, const fs::path& output) {
  if (HasCorners(set)) return {{{"detections.json", DetectionsOf(set)}}, "  detections: detections.json\n"};
  if (HasImages(set)) {
    ImportedFiles part{{}, "  images:\n"};
    for (const ImportedCapture& capture : set.captures) {
      part.config += "    - " + PathFrom(output, capture.image) + "\n";
    }
    return part;
  }
  if (!HasTargetPoses(set)) return {{}, "  # images: ...: the data set has poses only\n"};
  std::vector<PoseRow> rows;
  for (const ImportedCapture& capture : set.captures) {
    rows.push_back({capture.name, CaptureRole::kNone, *capture.camera_from_target, 0, {}});
  }
  return {{{"target_poses.csv", PoseFileText(rows, *FindPoseFormat("ros"))}}, "  target_poses: target_poses.csv\n"};
}

ImportedFiles PosesPart(const ImportedSet& set) {
  if (!All(set, [](const ImportedCapture& capture) { return capture.base_from_gripper.has_value(); })) {
    return {{}, "  # poses: ...: the data set has none\n"};
  }
  const bool is_named = HasImages(set) || HasCorners(set) || HasTargetPoses(set);
  std::vector<PoseRow> rows;
  for (const ImportedCapture& capture : set.captures) {
    rows.push_back({is_named ? capture.name : "", CaptureRole::kNone, *capture.base_from_gripper, 0, {}});
  }
  return {{{"poses.csv", PoseFileText(rows, *FindPoseFormat("ros"))}}, "  poses: poses.csv\n  pose_format: ros\n"};
}

}  // namespace

ImportedFiles FilesOf(const ImportedSet& set, const fs::path& output) {
  ImportedFiles made;
  made.config = "# From a data set of " + set.format + ".\n";
  for (const std::string& remark : set.remarks) made.config += "# " + remark + "\n";
  made.config += set.setup ? "setup: " + std::string(SetupName(*set.setup)) + "\n"
                           : "# setup: eye_to_hand (camera fixed) or eye_in_hand: the data set does not say which\n";
  for (const ImportedFiles& part :
       {TargetPart(set), CameraPart(set), {{}, "captures:\n"}, SeenPart(set, output), PosesPart(set)}) {
    made.files.insert(made.files.end(), part.files.begin(), part.files.end());
    made.config += part.config;
  }
  return made;
}

}  // namespace heba
