#include "tools/files/imported_files.h"

#include <algorithm>

#include "heba/data/rig.h"
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
std::string PosesOf(const ImportedRig& rig) {
  std::vector<PoseRow> rows;
  bool is_one_name = true;
  for (const ImportedRigCapture& capture : rig.captures) {
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
std::string TruthOf(const ImportedRig& rig, const std::string& mount) {
  RigProblem problem;
  RigTruth truth;
  for (const ImportedCamera& camera : rig.cameras) {
    RigCamera& entry = problem.cameras.emplace_back();
    entry.name = camera.name;
    entry.mount_name = mount;
    truth.mount_from_camera.push_back(*camera.mount_from_camera);
    truth.cameras.emplace_back();
  }
  return RigTruthToJson(problem, truth);
}

// Returns the line of a mount: of the cameras, or of the target.
std::string MountLine(const std::optional<Setup>& setup, Setup carried) {
  if (setup) return std::string("    mount: ") + (*setup == carried ? "gripper" : "world") + "\n";
  return "    # mount: world or gripper: the data set does not say what carries it\n";
}

}  // namespace

ImportedFiles FilesOf(const ImportedRig& rig, const fs::path& output) {
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
      config += "    - " + PathFrom(output, capture.image) + "\n";
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

}  // namespace heba
